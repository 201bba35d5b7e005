"""The first directory of TIFF 6.0 and BigTIFF files, read without decoding anything."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np

_LAYOUTS = {1: 'B', 3: 'H', 4: 'L', 16: 'Q'}  # of integers, by the type of a field
_FIELDS = 4096  # that are read at most


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
    order = '<' if content[:2] == b'II' else '>'
    big = content[2:4] in (b'+\0', b'\0+')
    offset_at, word, count_layout, field = (8, 'Q', 'Q', 'HHQ') if big else (4, 'L', 'H', 'HHL')
    (start,) = struct.unpack_from(order + word, content, offset_at)
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
    return found
