"""The directories of TIFF 6.0 and BigTIFF files, read without decoding anything."""

import struct
from dataclasses import dataclass

import numpy as np

_LAYOUTS = {
    1: 'B',
    3: 'H',
    4: 'L',
    13: 'L',
    16: 'Q',
    18: 'Q',
}  # of integers, by the type of a field
_FIELDS = 4096  # that are read at most
_DIRECTORIES = 1000  # the same
_PARTS = 330  # tag of the places of directories that belong to one


@dataclass(frozen=True, slots=True)
class Field:
    """Integers of a directory: how many, where the first one is, and its layout for `struct`."""

    count: int
    place: int
    layout: str

    def values(self, content: bytes) -> np.ndarray:
        """Return the integers, of float64; a ValueError if they are not in the file."""
        kind = np.dtype(f'{self.layout[0]}u{struct.calcsize(self.layout)}')
        return np.frombuffer(content, kind, self.count, self.place).astype(float)


def is_tiff(content: bytes) -> bool:
    """Return whether a file begins as TIFF or BigTIFF."""
    return content[:4] in (b'II*\0', b'MM\0*', b'II+\0', b'MM\0+')


def first_directory(content: bytes) -> dict[int, Field]:
    """Return the fields of integers in the first directory by their tags.

    A struct.error, a ValueError or an OverflowError says that the directory is not in the file.
    """
    order, big = _form(content)
    place, layout = first_at(content)
    return _directory(content, struct.unpack_from(layout, content, place)[0], order, big)[0]


def first_at(content: bytes) -> tuple[int, str]:
    """Return where a file says where its first directory is, and the layout for `struct`."""
    order, big = _form(content)
    return (8, f'{order}Q') if big else (4, f'{order}L')


def directories(content: bytes) -> dict[int, dict[int, Field]]:
    """Return the fields of all directories by their places: pages, and what is part of these.

    What comes after a damage is left out; errors of the first one are as of `first_directory`.
    """
    order, big = _form(content)
    place, layout = first_at(content)
    found: dict[int, dict[int, Field]] = {}
    waiting = [struct.unpack_from(layout, content, place)[0]]
    while waiting and len(found) < _DIRECTORIES:
        start = waiting.pop(0)
        if start == 0 or start in found:
            continue
        try:
            fields, following = _directory(content, start, order, big)
            parts = fields[_PARTS].values(content).tolist() if _PARTS in fields else []
        except (struct.error, ValueError, OverflowError):
            if not found:
                raise
            continue
        found[start] = fields
        waiting += [*map(int, parts), following]
    return found


def _form(content: bytes) -> tuple[str, bool]:
    """Return the byte order of a file, and whether it is BigTIFF."""
    return '<' if content[:2] == b'II' else '>', content[2:4] in (b'+\0', b'\0+')


def _directory(content: bytes, start: int, order: str, big: bool) -> tuple[dict[int, Field], int]:
    """Return the fields of the directory at a place, and the place of the next one or 0."""
    word, count_layout, field = ('Q', 'Q', 'HHQ') if big else ('L', 'H', 'HHL')
    (count,) = struct.unpack_from(order + count_layout, content, start)
    place = start + struct.calcsize(order + count_layout)
    room = struct.calcsize(order + word)
    found = {}
    for _ in range(min(count, _FIELDS)):
        tag, kind, values = struct.unpack_from(order + field, content, place)
        place += struct.calcsize(order + field)
        (elsewhere,) = struct.unpack_from(order + word, content, place)
        if kind in _LAYOUTS:
            layout = order + _LAYOUTS[kind]
            fits = values * struct.calcsize(layout) <= room
            found[tag] = Field(values, place if fits else elsewhere, layout)
        place += room
    following = content[place : place + room]
    return found, int.from_bytes(following, 'little' if order == '<' else 'big')
