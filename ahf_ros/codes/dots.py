"""Rings of dots: a disc, small dots round it that are the code, and a border about them.

After Knyaz & Sibiryakov, ISPRS Commission V, 1998. Dot s stands at s 360/n degrees
counter-clockwise from any start as seen on the printed target. A word and its mirror image are
one code, as are its rotations, so that a target may be read from behind. The smallest of all of
them is canonical.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import pi, sin
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.codes.cyclic import CyclicFamily, mirrored_words, smallest_rotation
from ahf_ros.codes.data_file import Entry, read_data_file

DOTS_DESIGN = Path(__file__).with_name('dots.json')
"""The design of rings of dots that this package prints."""

_BITS = (6, 20)  # of a word


@dataclass(frozen=True, slots=True, eq=False)
class DotFamily(CyclicFamily):
    """The code words of one kind of ring of dots, and the proportions of its print.

    Attributes
    ----------
    source : str
        Where the design comes from.
    dot_circle, dot_radius : float
        Radius of the circle of the small dots, and their own, in radii of the disc.
    ground_radius, border_radius : float
        Inner and outer radius of the border, in radii of the disc.
    """

    source: str
    dot_circle: float
    dot_radius: float
    ground_radius: float
    border_radius: float

    def canonical(self, words: Any) -> np.ndarray:
        """Return the smallest of all words that are the same code, ndarray of int64."""
        return smallest_bracelet(words, self.bits)

    def places(self, word: int, turn: float = 0.0) -> np.ndarray:
        """Return the centres of the small dots of a word, shape (n, 2), in radii of the disc.

        `turn` is the direction of the place of dot 0, rad.
        """
        which = np.flatnonzero(word >> np.arange(self.bits) & 1)
        angles = turn + 2 * pi * which / self.bits
        places: np.ndarray = self.dot_circle * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return places

    def ids(self, words: np.ndarray) -> np.ndarray:
        """Return the IDs of words in any rotation or reflection, 0 where there is none."""
        codes = self.canonical(words)
        index = np.minimum(np.searchsorted(self.words, codes), self.words.size - 1)
        ids: np.ndarray = np.where(self.words[index] == codes, index + 1, 0)
        return ids


@lru_cache(maxsize=8)
def dot_family(path: str = '') -> DotFamily:
    """Return a family of rings of dots.

    Parameters
    ----------
    path : str
        Data file, JSON or YAML, as docs/dots.md describes it; our own design where empty.

    Raises
    ------
    ValueError
        If the file cannot be read or does not describe such a family, naming line and field.

    Examples
    --------
    >>> family = dot_family()
    >>> family.words.size, family.number(0b1000000001)
    (76, 2)
    """
    return parse_design(read_data_file(path or DOTS_DESIGN))


def parse_design(file: Entry) -> DotFamily:
    """Return the family that the content of a data file describes; see `dot_family`."""
    lengths = ('dot_circle', 'dot_radius', 'ground_radius', 'border_radius')
    fields = file.keys(('family', 'bits', *lengths), ('source',))
    circle, radius, ground, border = (
        fields[name].number(1e-3, 'a length in radii of the disc') for name in lengths
    )
    bits = fields['bits'].integer(*_BITS)
    if circle - radius <= 1:
        fields['dot_circle'].refuse(f'more than {1 + radius:g}, clear of the disc')
    if circle + radius >= ground:
        fields['ground_radius'].refuse(f'more than {circle + radius:g}, clear of the dots')
    if ground >= border:
        fields['border_radius'].refuse(f'more than {ground:g}, the ground_radius')
    widest = circle * sin(pi / bits)
    if radius >= widest:
        fields['dot_radius'].refuse(f'less than {widest:.3g}, so that the dots do not overlap')
    words = np.arange(1, (1 << bits) - 1)  # neither the empty ring nor the full one
    words = words[words == smallest_bracelet(words, bits)]
    words.setflags(write=False)
    source = fields['source'].text() if 'source' in fields else ''
    return DotFamily(
        name=fields['family'].text(),
        bits=bits,
        words=words,
        source=source,
        dot_circle=circle,
        dot_radius=radius,
        ground_radius=ground,
        border_radius=border,
    )


def smallest_bracelet(words: Any, bits: int) -> np.ndarray:
    """Return the smallest of all rotations and reflections of each word.

    Parameters
    ----------
    words : array_like of int, any shape
        Words of `bits` bits, 0 to 2^bits - 1.
    bits : int
        Length of a word.

    Returns
    -------
    ndarray of int64, shape of `words`
    """
    words = np.asarray(words, dtype=np.int64)
    smallest: np.ndarray = np.minimum(
        smallest_rotation(words, bits), smallest_rotation(mirrored_words(words, bits), bits)
    )
    return smallest
