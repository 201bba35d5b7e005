"""Decompression that never allocates more than a bound, whatever the data claim."""

from __future__ import annotations

import bz2
import sys
from typing import Any

from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

LARGEST = 2**29
"""Bytes that a message or a chunk of messages may have once it is decompressed."""

ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
"""First bytes of data that zstd compressed; no serialized message begins like that."""

_DECOMPRESSORS: dict[str, Any] = {
    'zstd': zstd.ZstdDecompressor,
    'lz4': LZ4FrameDecompressor,
    'bz2': bz2.BZ2Decompressor,
}


def decompress(data: bytes, compression: str, limit: int = LARGEST) -> bytes:
    """Return data as they were before compression.

    Parameters
    ----------
    data : bytes
    compression : str
        'zstd', 'lz4' or 'bz2'; empty or 'none' where there is none.
    limit : int
        Bytes that the result may have.

    Raises
    ------
    ValueError
        If the compression is unknown, the data are damaged or end early, or the result is
        larger than `limit`, in which case it is not allocated.
    """
    if compression in ('', 'none'):
        return data
    if compression not in _DECOMPRESSORS:
        raise ValueError(f'compression is {compression!r}, accepted is zstd, lz4 or bz2')
    parts: list[bytes] = []
    size = 0
    try:
        while data:
            decompressor = _DECOMPRESSORS[compression]()
            while not decompressor.eof:
                part = decompressor.decompress(data, limit + 1 - size)
                data = b''
                size += len(part)
                if size > limit:
                    raise ValueError(f'{compression} data of more than {limit} bytes')
                if not part and decompressor.needs_input and not decompressor.eof:
                    raise ValueError(f'{compression} data end early')
                parts.append(part)
            data = decompressor.unused_data or b''
    except (OSError, EOFError, RuntimeError, zstd.ZstdError) as error:
        raise ValueError(f'{compression} data are damaged: {error}') from error
    return b''.join(parts)
