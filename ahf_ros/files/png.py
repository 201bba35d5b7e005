"""The chunks of PNG files (ISO/IEC 15948), read without decoding anything."""

import struct
from collections.abc import Iterator

_SIGNATURE = b'\x89PNG\r\n\x1a\n'


def is_png(content: bytes) -> bool:
    """Return whether a file begins as PNG."""
    return content.startswith(_SIGNATURE)


def png_chunks(content: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Yield the kind of each chunk, where its data begin, and how many bytes it says they have.

    The last one has the kind IEND. Raises a struct.error if the file ends before it.
    """
    place, kind = len(_SIGNATURE), b''
    while kind != b'IEND':
        size, kind = struct.unpack_from('>L4s', content, place)
        yield kind, place + 8, size
        place += 12 + size
