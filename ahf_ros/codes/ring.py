"""Code words of ring targets: a dot and a concentric band of sectors (Schneider type).

A code word of n bits is read round the band, least significant bit first: bit s is the sector
from s 360/n to (s + 1) 360/n degrees counter-clockwise as seen on the printed target, 1 where the
sector has the colour of the dot. The direction zero is any sector edge, so that all rotations of a
word are the same code; the smallest one is canonical.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from math import gcd
from string import ascii_lowercase, digits

import numpy as np

from ahf_ros.codes import RING_NAMES
from ahf_ros.codes.cyclic import CyclicFamily, smallest_rotation

BAND_RADII = {'metashape': (2.25, 3.5), 'aicon': (2.0, 3.0)}
"""Inner and outer radius of the bands that vendors print, in radii of the dot."""

FAMILY_NAMES = RING_NAMES
"""The ring code families that `family` knows."""


@dataclass(frozen=True, slots=True, eq=False)
class Family(CyclicFamily):
    """The code words of one kind of ring target, and the radii of its band, in dot radii."""

    band_inner: float
    band_outer: float

    @property
    def band(self) -> tuple[float, float]:
        """Radii of the band, in radii of the dot."""
        return self.band_inner, self.band_outer


@cache
def family(name: str) -> Family:
    """Return a family of ring codes by its name; raise a ValueError if there is none.

    The words have even parity and are not all ones. Metashape keeps those above 2^(n/2) + 1;
    AICON (patent DE 197 33 466) those with at least one pair of opposite ones. The lists of 12
    and 14 bit were compared with published tables and photographs; the order of 16 and 20 bit is
    the same rule carried on.

    Examples
    --------
    >>> family('metashape12').word(1)
    71
    >>> family('metashape12').number(0b100011100000)
    1
    """
    if name not in FAMILY_NAMES:
        raise ValueError(f'family is {name!r}, accepted is one of {", ".join(FAMILY_NAMES)}')
    vendor, bits = name.rstrip(digits), _sector_count(name)
    # A word that is even or has its highest bit has a smaller rotation, or is 0 or all ones.
    words = np.arange(1, 1 << (bits - 1), 2, dtype=np.int64)
    parity = np.zeros_like(words)
    for bit in range(bits):
        parity ^= words >> bit & 1
    words = words[parity == 0]
    words = words[words == smallest_rotation(words, bits)]
    half = bits // 2
    if vendor == 'metashape':
        words = words[words > (1 << half) + 1]
    else:
        words = words[words & (words >> half) & ((1 << half) - 1) != 0]
    words.setflags(write=False)
    inner, outer = BAND_RADII[vendor]
    return Family(name=name, bits=bits, words=words, band_inner=inner, band_outer=outer)


def _sector_count(name: str) -> int:
    """Return the number of sectors of a family, without its words, which may be many."""
    return int(name.lstrip(ascii_lowercase))


def canonical(words: np.ndarray, family: Family) -> tuple[np.ndarray, np.ndarray]:
    """Return the canonical code words and the IDs of words of a family in any rotation.

    All are ndarrays of int64, shape (k,), and every word is one of the family.
    """
    codes = family.canonical(words)
    return codes, np.searchsorted(family.words, codes) + 1


def sectors(word: int, bits: int) -> np.ndarray:
    """Return the colours of the sectors of a band, ndarray of bool, shape (bits,).

    Element s is the sector from s 360/bits to (s + 1) 360/bits degrees counter-clockwise as seen
    on the printed target: true where it has the colour of the dot.
    """
    return (word >> np.arange(bits) & 1).astype(bool)


@lru_cache(maxsize=100_000)
def words_of_print(name: str, word: int) -> dict[str, int]:
    """Return the canonical words of all families whose targets have the print of a word.

    A word all of whose runs are a multiple of some angle may be a word of other numbers of
    sectors, too: 000111000111 of 12 bit is 0000111100001111 of 16. Nothing in an image of the
    target shows which one is meant. `word` is a word of the family `name`, which is included.

    Examples
    --------
    >>> words_of_print('metashape12', 455)
    {'metashape12': 455, 'metashape16': 3855, 'metashape20': 31775}
    >>> words_of_print('metashape12', 71)
    {'metashape12': 71}
    """
    code = family(name)
    inked = sectors(word, code.bits)
    edges = np.flatnonzero(inked != np.roll(inked, 1))
    widest = gcd(code.bits, *np.diff(edges).tolist())
    blocks = np.roll(inked, -edges[0])[::widest]  # the print in as few sectors as show it
    words = {}
    for other in FAMILY_NAMES:
        count = _sector_count(other)
        times, rest = divmod(count, len(blocks))
        if rest or family(other).band != code.band:
            continue
        spread = int(np.repeat(blocks, times) @ (1 << np.arange(count)))
        if family(other).number(spread):
            words[other] = int(family(other).canonical(spread))
    return words
