"""Code words of ring targets: a dot and a concentric band of sectors (Schneider type).

A code word of n bits is read round the band, least significant bit first: bit s is the sector
from s 360/n to (s + 1) 360/n degrees counter-clockwise as seen on the printed target, 1 where the
sector has the colour of the dot. The direction zero is any sector edge, so that all rotations of a
word are the same code; the smallest one is canonical.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from string import ascii_lowercase, digits

import numpy as np

from ahf_ros.codes.cyclic import CyclicFamily, smallest_rotation
from ahf_ros.codes.names import RING_NAMES

BAND_RADII = {'metashape': (2.25, 3.5), 'aicon': (2.0, 3.0)}
"""Inner and outer radius of the bands that vendors print, in radii of the dot."""

FAMILY_NAMES = RING_NAMES
"""The ring code families that `family` knows."""


@dataclass(frozen=True, slots=True, eq=False)
class Family(CyclicFamily):
    """The code words of one kind of ring target, and the proportions of its print.

    Attributes
    ----------
    band_inner, band_outer : float
        Radii of the band, in radii of the dot.
    """

    band_inner: float
    band_outer: float

    @property
    def band(self) -> tuple[float, float]:
        """Radii of the band, in radii of the dot."""
        return self.band_inner, self.band_outer


def sector_count(name: str) -> int:
    """Return the number of sectors of a family, without its words."""
    return int(name.lstrip(ascii_lowercase))


@cache
def family(name: str) -> Family:
    """Return a family of ring codes by its name.

    The words have even parity and are not all ones. Metashape keeps those above 2^(n/2) + 1;
    AICON (patent DE 197 33 466) those with at least one pair of opposite ones. The lists of 12
    and 14 bit were compared with published tables and photographs; the order of 16 and 20 bit is
    the same rule carried on.

    Parameters
    ----------
    name : str
        One of `FAMILY_NAMES`.

    Raises
    ------
    ValueError
        If there is no family of that name.

    Examples
    --------
    >>> family('metashape12').word(1)
    71
    >>> family('metashape12').number(0b100011100000)
    1
    """
    if name not in FAMILY_NAMES:
        raise ValueError(f'family is {name!r}, accepted is one of {", ".join(FAMILY_NAMES)}')
    vendor, bits = name.rstrip(digits), sector_count(name)
    words = _even_canonical_words(bits)
    half = bits // 2
    if vendor == 'metashape':
        words = words[words > (1 << half) + 1]
    else:
        words = words[words & (words >> half) & ((1 << half) - 1) != 0]
    words.setflags(write=False)
    inner, outer = BAND_RADII[vendor]
    return Family(name=name, bits=bits, words=words, band_inner=inner, band_outer=outer)


def mirrored(word: int, bits: int) -> int:
    """Return a word as it reads in a mirror, in some rotation.

    Examples
    --------
    >>> f'{mirrored(0b1011, 6):06b}'
    '110100'
    """
    return int(f'{word:0{bits}b}'[::-1], 2)


def canonical(words: np.ndarray, family: Family) -> tuple[np.ndarray, np.ndarray]:
    """Return the canonical code words and the IDs of words of a family in any rotation.

    Parameters
    ----------
    words : ndarray of int64, shape (k,)
        Each a word of the family.
    family : Family

    Returns
    -------
    codes : ndarray of int64, shape (k,)
    ids : ndarray of int64, shape (k,)
    """
    codes = smallest_rotation(words, family.bits)
    return codes, np.searchsorted(family.words, codes) + 1


def sectors(word: int, bits: int) -> np.ndarray:
    """Return the colours of the sectors of a band.

    Parameters
    ----------
    word : int
        A code word, in any rotation.
    bits : int
        Length of the word.

    Returns
    -------
    ndarray of bool, shape (bits,)
        Element s is the sector from s 360/bits to (s + 1) 360/bits degrees counter-clockwise as
        seen on the printed target: true where it has the colour of the dot.
    """
    return (word >> np.arange(bits) & 1).astype(bool)


def _even_canonical_words(bits: int) -> np.ndarray:
    """Return the words of even parity, not all ones, that are their own smallest rotation."""
    # Any other word than zero has a smaller rotation if it is even or has its highest bit.
    words = np.append(0, np.arange(1, 1 << (bits - 1), 2, dtype=np.int64))
    parity = np.zeros_like(words)
    for bit in range(bits):
        parity ^= words >> bit & 1
    words = words[parity == 0]
    return words[words == smallest_rotation(words, bits)]
