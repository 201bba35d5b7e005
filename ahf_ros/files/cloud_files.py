"""Organised clouds as PLY and PCD files, little-endian, with all their fields.

A cloud is an array (height, width) with the fields x, y, z and any others. Missing points are NaN
and keep their place. PCD has WIDTH and HEIGHT [1]_; PLY has `obj_info num_cols` and `num_rows`, as
the range scans of Stanford do [2]_. Compressed PCD and lists in PLY are not read.

plyfile is under the GPL; the maintained libraries for PCD bring many dependencies.

References
----------
.. [1] The PCD file format, pointclouds.org.
.. [2] The Stanford 3D scanning repository, graphics.stanford.edu/data/3Dscanrep.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ahf_ros.base.opening import LARGEST, Most, read_bytes, reader
from ahf_ros.base.text import shown

AXES = ('x', 'y', 'z')
"""Fields that a cloud must have."""

_LONGEST_HEADER = 2**16
_PLY_TYPES = {
    **{'i1': 'char', 'u1': 'uchar', 'i2': 'short', 'u2': 'ushort', 'i4': 'int', 'u4': 'uint'},
    **{'f4': 'float', 'f8': 'double'},
}
_FROM_PLY = {name: kind for kind, name in _PLY_TYPES.items()} | {
    **{'int8': 'i1', 'uint8': 'u1', 'int16': 'i2', 'uint16': 'u2', 'int32': 'i4'},
    **{'uint32': 'u4', 'float32': 'f4', 'float64': 'f8'},
}
_PLY_ORDERS = {'binary_little_endian': '<', 'binary_big_endian': '>'}
_PCD_TYPES = {'I': 'i', 'U': 'u', 'F': 'f'}


def write_ply(cloud: np.ndarray) -> bytes:
    """Return a cloud as the content of a PLY file."""
    height, width = cloud.shape
    packed = _packed(cloud)
    lines = [
        'ply',
        'format binary_little_endian 1.0',
        f'obj_info num_cols {width}',
        f'obj_info num_rows {height}',
        f'element vertex {cloud.size}',
        *(f'property {_PLY_TYPES[kind.str[1:]]} {name}' for name, kind in _fields(packed)),
        'end_header',
    ]
    return '\n'.join([*lines, '']).encode() + packed.tobytes()


def write_pcd(cloud: np.ndarray) -> bytes:
    """Return a cloud as the content of a PCD file."""
    height, width = cloud.shape
    packed = _packed(cloud)
    fields = _fields(packed)
    lines = [
        '# .PCD v0.7 - Point Cloud Data file format',
        'VERSION 0.7',
        f'FIELDS {" ".join(name for name, _ in fields)}',
        f'SIZE {" ".join(str(kind.itemsize) for _, kind in fields)}',
        f'TYPE {" ".join(kind.kind.upper() for _, kind in fields)}',
        f'COUNT {" ".join("1" for _ in fields)}',
        f'WIDTH {width}',
        f'HEIGHT {height}',
        'VIEWPOINT 0 0 0 1 0 0 0',
        f'POINTS {cloud.size}',
        'DATA binary',
    ]
    return '\n'.join([*lines, '']).encode() + packed.tobytes()


@reader('a cloud in PLY or PCD')
def read_cloud(path: str | Path) -> np.ndarray:
    """Return the cloud in a PLY or PCD file; one that is not organised has a single row.

    A ValueError names the file and what is missing, damaged or not accepted.
    """
    readers: dict[str, Callable[[bytes], np.ndarray]] = {'.ply': _read_ply, '.pcd': _read_pcd}
    suffix = Path(path).suffix.lower()
    if suffix not in readers:
        raise ValueError(f'{path} ends in {suffix!r}, accepted are {", ".join(readers)}')
    cloud = readers[suffix](read_bytes(path, Most.CLOUD))
    if missing := [name for name in AXES if name not in (cloud.dtype.names or ())]:
        raise ValueError(f'{path} has no field {missing[0]}, accepted are clouds with x, y and z')
    return cloud


def _packed(cloud: np.ndarray) -> np.ndarray:
    """Return a cloud in the order of its rows, little-endian and without gaps."""
    kinds = [(name, kind.newbyteorder('<')) for name, kind in _fields(cloud)]
    packed = np.empty(cloud.shape, kinds)
    for name, _ in kinds:
        packed[name] = cloud[name]
    return packed


def _fields(cloud: np.ndarray) -> list[tuple[str, np.dtype]]:
    return [(name, cloud.dtype[name]) for name in cloud.dtype.names or ()]


def _header(content: bytes, end: str) -> tuple[list[list[str]], bytes]:
    """Return the words of the lines of a header up to one that begins with `end`, and the rest."""
    found = re.search(rf'^{end}[^\n]*\n'.encode(), content[:_LONGEST_HEADER], re.MULTILINE)
    if not found:
        raise ValueError(f'the header has no line {end}')
    lines = content[: found.end()].decode('utf-8', 'replace').splitlines()
    return [words for line in lines if (words := line.split())], content[found.end() :]


def _number(words: list[str]) -> int:
    if len(words) < 2 or not re.fullmatch(r'\d{1,12}', words[-1]):
        raise ValueError(f'{shown(" ".join(words))}: accepted is an integer of at least 0')
    return int(words[-1])


def _table(data: bytes, kinds: list[tuple[str, str]], count: int, order: str) -> np.ndarray:
    """Return points of fields and types, in binary of a byte order, or in text where it is ''."""
    names = [name for name, _ in kinds]
    if len(set(names)) < len(names):
        raise ValueError(f'fields are {shown(names)}, accepted is each name once')
    if not order:
        kind = np.dtype([(name, f'<{it}') for name, it in kinds])
        words = data.split()
        if len(words) < count * len(kinds):
            raise ValueError(f'{count} points are announced and {len(words)} numbers are there')
        table = np.zeros(count, kind)
        for index, name in enumerate(names):
            table[name] = _column(words[index : count * len(kinds) : len(kinds)], name, kind[name])
        return table
    kind = np.dtype([(name, order + it) for name, it in kinds])
    if len(data) < count * kind.itemsize:
        raise ValueError(
            f'{count} points of {kind.itemsize} bytes are announced and {len(data)} bytes are '
            'there: the file is cut'
        )
    return np.frombuffer(data, kind, count)


def _column(words: list[bytes], name: str, kind: np.dtype) -> np.ndarray:
    """Return the numbers of a field in a text, which its type has to hold; NaN are missing."""
    found = np.array(words, 'S').astype(float)
    limits = np.iinfo(kind) if kind.kind in 'iu' else None
    least, most = (limits.min, limits.max) if limits else (-LARGEST, LARGEST)
    bad = ~((found >= least) & (found <= most) | (np.isnan(found) & (limits is None)))
    if bad.any():
        raise ValueError(
            f'{shown(name)} is {found[bad][0]:g}, accepted are numbers from {least:g} to {most:g}'
        )
    return found


def _read_ply(content: bytes) -> np.ndarray:
    lines, data = _header(content, 'end_header')
    if lines[0] != ['ply']:
        raise ValueError('the first line is not ply')
    form = next((words[1] for words in lines if words[0] == 'format' and len(words) > 1), '')
    if form != 'ascii' and form not in _PLY_ORDERS:
        raise ValueError(f'format is {shown(form)}, accepted is one of PLY')
    elements = [words for words in lines if words[0] == 'element']
    if not elements or elements[0][1:2] != ['vertex']:
        raise ValueError('the first element is not vertex')
    count = _number(elements[0])
    start = lines.index(elements[0]) + 1
    kinds = []
    for words in lines[start:]:
        if words[0] == 'element':
            break
        if words[0] == 'property':
            if len(words) != 3 or words[1] not in _FROM_PLY:
                raise ValueError(f'{shown(" ".join(words))} is not accepted of a vertex')
            kinds.append((words[2], _FROM_PLY[words[1]]))
    points = _table(data, kinds, count, _PLY_ORDERS.get(form, ''))
    grid = {words[1]: _number(words) for words in lines if words[0] == 'obj_info' and words[2:]}
    shape = grid.get('num_rows', 1), grid.get('num_cols', count)
    if shape[0] * shape[1] != count:
        raise ValueError(
            f'num_rows is {shape[0]} and num_cols {shape[1]} with {count} vertices, accepted are '
            'as many vertices as places'
        )
    return points.reshape(shape)


def _read_pcd(content: bytes) -> np.ndarray:
    lines, data = _header(content, 'DATA')
    values = {words[0]: words[1:] for words in lines}
    for name in ('FIELDS', 'SIZE', 'TYPE', 'WIDTH', 'HEIGHT'):
        if not values.get(name):
            raise ValueError(f'the header has no {name}')
    form = ' '.join(values['DATA'])
    if form not in ('binary', 'ascii'):
        raise ValueError(f'DATA is {shown(form)}, accepted are binary and ascii')
    names, sizes, types = values['FIELDS'], values['SIZE'], values['TYPE']
    counts = values.get('COUNT', ['1'] * len(names))
    kinds = []
    for name, kind, size, count in zip(names, types, sizes, counts, strict=False):
        code = f'{_PCD_TYPES.get(kind, "?")}{size}'
        if code not in (*_PLY_TYPES, 'i8', 'u8') or count != '1':
            raise ValueError(
                f'field {shown(name)} has TYPE {shown(kind)}, SIZE {shown(size)} and COUNT '
                f'{shown(count)}, accepted are single numbers of 1 to 8 bytes'
            )
        kinds.append((name, code))
    if len(kinds) < len(names):
        raise ValueError('SIZE, TYPE or COUNT has fewer entries than FIELDS')
    shape = _number(['HEIGHT', *values['HEIGHT']]), _number(['WIDTH', *values['WIDTH']])
    points = _table(data, kinds, shape[0] * shape[1], '<' if form == 'binary' else '')
    return points.reshape(shape)
