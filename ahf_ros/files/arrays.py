"""Arrays in npz archives, whose headers are checked before anything is unpacked."""

import io
import math
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ahf_ros.base.opening import Most, read_bytes, reader

_COMPRESSIONS = zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED
_ENCRYPTED = 1  # flag of a member
_LONGEST_TEXT = 4096  # bytes
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


@reader('an archive of arrays as numpy writes it')
def read_arrays(
    path: str | Path, expected: Mapping[str, tuple[str, tuple[int, ...]]]
) -> dict[str, np.ndarray]:
    """Return arrays of an npz file by their names, of an expected kind and shape each.

    Kinds are those of `numpy.dtype`, such as f for floats. A ValueError names the file and the
    array that is not there, damaged, of objects, or of another kind or shape.
    """
    found = {}
    with zipfile.ZipFile(io.BytesIO(read_bytes(path, Most.ARRAYS))) as archive:
        members = {it.filename: it for it in archive.infolist()}
        for name, (kind, shape) in expected.items():
            member = members.get(f'{name}.npy')
            if member is None:
                raise ValueError(f'{path} has no array {name}, accepted are {", ".join(expected)}')
            if member.flag_bits & _ENCRYPTED or member.compress_type not in _COMPRESSIONS:
                raise ValueError(f'{path}: {name} is encrypted or packed, accepted is deflated')
            with archive.open(member) as file:
                header = _HEADERS[np.lib.format.read_magic(file)](file)
                _check(f'{path}: {name}', header, kind, shape)
                size = math.prod(shape) * header[2].itemsize
                content = file.read(size + 1)
            if len(content) != size:
                raise ValueError(f'{path}: {name} is cut or too long, accepted are {size} bytes')
            array = np.frombuffer(content, header[2])
            found[name] = array.reshape(shape[::-1]).T if header[1] else array.reshape(shape)
    return found


def _check(
    name: str, header: tuple[tuple[int, ...], bool, np.dtype], kind: str, shape: tuple[int, ...]
) -> None:
    if header[0] != shape:
        raise ValueError(f'{name} has the shape {header[0]}, accepted is {shape}')
    if header[2].kind != kind or not 0 < header[2].itemsize <= _LONGEST_TEXT:
        raise ValueError(f'{name} is of {header[2]}, accepted are numbers of kind {kind}')
