"""Code words of ring targets: a dot and a concentric band of sectors (Schneider type).

A code word of n bits is read round the band, least significant bit first: bit s is the sector
from s 360/n to (s + 1) 360/n degrees counter-clockwise as seen on the printed target, 1 where the
sector has the colour of the dot. The direction zero is any sector edge, so that all rotations of a
word are the same code; the smallest one is canonical. No family has the word without marks, which
is a bare dot, or the one of nothing but marks, unless its file lists that.

Each family is a data file: see docs/ring_targets.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import gcd
from typing import Any, ClassVar

import numpy as np

from ahf_ros.base.opening import reader
from ahf_ros.prints import RING_FOLDER, RING_NAMES, VENDOR_NAMES
from ahf_ros.prints.cyclic import CyclicPrint, mirrored_words, smallest_rotation
from ahf_ros.prints.data_file import Entry, pinhole_in, read_data_file
from ahf_ros.prints.prints import Disc, Proportions, Ring, Sectors, Shape

FAMILY_NAMES = VENDOR_NAMES
"""The ring code families that vendors print."""

BITS = (6, 24)
"""Fewest and most bits of a family."""

POLARITIES = 'dark', 'bright', 'both'
"""Colours that dot and marks of a family may have."""

Radii = tuple[float, float]

_MAXIMUM_RADIUS = 12.0  # of bands and circles, dot radii
_QUIET_ZONE = 4.2  # that of a band up to 3.5, dot radii
_WIDER = 1.2  # quiet zone of larger targets, times their reach


@dataclass(frozen=True, slots=True, eq=False)
class RingPrint(CyclicPrint):
    """The words of one kind of ring target, and its print; lengths are in radii of the dot.

    Where the radii of the band are free, `bounds` has those of the inner and of the outer one, and
    the radii are in their middle. `pinhole` is the radius of the hole in the dot, 0 for none,
    `polarity` the colour of dot and marks, 'dark', 'bright' or 'both', and `circles` are further
    rings of their colour, by their inner and outer radii.
    """

    direction: ClassVar[str] = 'counter-clockwise'

    band_inner: float
    band_outer: float
    bounds: tuple[Radii, Radii] | None = None
    pinhole: float = 0.0
    polarity: str = 'both'
    circles: tuple[Radii, ...] = ()

    @property
    def band(self) -> tuple[float, float]:
        """Radii of the band, in radii of the dot."""
        return self.band_inner, self.band_outer

    @property
    def reach(self) -> float:
        """Radius of the circle that holds all ink."""
        return max(self.band_outer, *(outer for _, outer in self.circles), 0.0)

    @property
    def proportions(self) -> Proportions:
        """What all targets have in common."""
        radii = {'dot': 1.0, 'band_inner': self.band_inner, 'band_outer': self.band_outer}
        for number, (inner, outer) in enumerate(self.circles, 1):
            radii |= {f'circle_{number}_inner': inner, f'circle_{number}_outer': outer}
        return Proportions(
            reach=self.reach,
            radius=1.0,
            quiet_zone=max(_QUIET_ZONE, _WIDER * self.reach),
            radii=radii,
            pinhole=self.pinhole,
            polarity='bright' if self.polarity == 'bright' else 'dark',
        )

    def ink(self, word: int, pinhole: float = 0.0) -> tuple[Shape, ...]:
        """Return dot, band and further circles of a word."""
        band = Sectors(*self.band, tuple(sectors(word, self.bits).tolist()))
        return (Disc(1.0, pinhole), band, *(Ring(*ends) for ends in self.circles))

    def mirrored(self, word: int) -> int | None:
        """Return the ID that a word has in a mirror.

        Examples
        --------
        >>> family('metashape12').mirrored(71)
        12
        """
        return self.number(mirrored_words(word, self.bits))

    @property
    def has_all_words(self) -> bool:
        """Whether the family has all words of its bits, but that of none and that of all marks."""
        # Burnside's lemma: as many as the mean number of words that a turn leaves as they are.
        every = sum(2 ** gcd(turn, self.bits) for turn in range(self.bits)) // self.bits
        return len(self.words) >= every - 2


@cache
def family(name: str) -> RingPrint:
    """Return a family of ring codes by its name; raise a ValueError if there is none.

    The lists of metashape12, metashape14, aicon12 and aicon14 were compared with published tables
    and photographs.

    Examples
    --------
    >>> family('metashape12').word(1)
    71
    >>> family('metashape12').number(0b100011100000)
    1
    """
    if name not in RING_NAMES:
        raise ValueError(f'family is {name!r}, accepted is one of {", ".join(RING_NAMES)}')
    return ring_family(str(RING_FOLDER / f'{name}.json'))


@reader('a data file of rings')
def ring_family(path: str) -> RingPrint:
    """Return the family of ring codes that a data file describes.

    A ValueError names the line and the field of what is not accepted in it.
    """
    fields = read_data_file(path).keys(
        ('family', 'bits', 'band'),
        ('words', 'codes', 'numbers', 'pinhole', 'polarity', 'circles', 'source'),
    )
    bits = fields['bits'].integer(*BITS)
    polarity = fields['polarity'].value if 'polarity' in fields else 'both'
    if polarity not in POLARITIES:
        fields['polarity'].refuse(' or '.join(POLARITIES))
    inner, outer = bounds = _band(fields['band'])
    circles = _circles(fields['circles'], bounds) if 'circles' in fields else ()
    if ('words' in fields) == ('codes' in fields):
        fields['family'].refuse('a family with either the field words or the field codes')
    if 'codes' in fields:
        words, numbers = _table(fields['codes'], bits)
    else:
        words = _words(fields['words'], bits)
        numbers = _numbers(fields.get('numbers'), words, bits)
    for of in (words, numbers):
        of.setflags(write=False)
    return RingPrint(
        name=fields['family'].text(),
        bits=bits,
        words=words,
        numbers=numbers,
        band_inner=sum(inner) / 2,
        band_outer=sum(outer) / 2,
        bounds=None if inner[0] == inner[1] and outer[0] == outer[1] else bounds,
        pinhole=pinhole_in(fields),
        polarity=polarity,
        circles=circles,
    )


def _band(entry: Entry) -> tuple[Radii, Radii]:
    """Return the bounds of both radii of a band, which are equal where these are known."""
    accepted = 'a radius in radii of the dot, or the least and the largest one'
    bounds: list[Radii] = []
    for of in entry.list('its inner and outer radius, in radii of the dot', (2,)):
        ends = of.list(accepted, (2,)) if isinstance(of.value, list) else [of, of]
        least, most = (end.number(accepted, 1.0) for end in ends)
        bounds.append((least, most) if least <= most else of.refuse(accepted))
    inner, outer = bounds
    if not (inner[0] > 1 and inner[1] < outer[0] and outer[1] <= _MAXIMUM_RADIUS):
        entry.refuse(f'two radii that grow from above 1 to {_MAXIMUM_RADIUS:g} at most')
    return inner, outer


def _circles(entry: Entry, band: tuple[Radii, Radii]) -> tuple[Radii, ...]:
    """Return the inner and outer radii of further circles, which touch neither dot nor band."""
    accepted = f'two radii that grow to {_MAXIMUM_RADIUS:g} at most, clear of all other ink'
    taken: list[Radii] = [(0.0, 1.0), (band[0][0], band[1][1])]
    for circle in entry.list('a list of circles, each with its inner and outer radius'):
        inner, outer = (of.number(accepted, 1.0) for of in circle.list(accepted, (2,)))
        clear = all(outer < low or inner > high for low, high in taken)
        if not (inner < outer <= _MAXIMUM_RADIUS and clear):
            circle.refuse(accepted)
        taken.append((inner, outer))
    return tuple(taken[2:])


def _table(codes: Entry, bits: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the words of a table by their IDs, ascending, and these."""
    words: dict[int, int] = {}
    taken: set[int] = set()
    for number, entry in codes.items():
        if not number.isdecimal() or not 0 < int(number) < 1 << 31:
            entry.refuse('a word whose name is its ID, an integer from 1 to 2147483647')
        if int(number) in taken:
            entry.refuse(f'one word for the ID {int(number)}')
        taken.add(int(number))
        words[_new_word(entry, words, bits)] = int(number)
    if not words:
        codes.refuse('a mapping of one ID at least to its word')
    order = sorted(words)
    return np.array(order, np.int64), np.array([words[word] for word in order], np.int64)


def _new_word(entry: Entry, known: dict[int, int], bits: int) -> int:
    word = int(smallest_rotation(entry.integer(1, (1 << bits) - 1), bits))
    if word in known:
        entry.refuse('a word that is no rotation of one before it')
    return word


def _words(rule: Entry, bits: int) -> np.ndarray:
    """Return the canonical words that a rule or a list names, ascending."""
    if isinstance(rule.value, list):
        known: dict[int, int] = {}
        for entry in rule.list('a list of words'):
            known[_new_word(entry, known, bits)] = 0
        words = np.array(sorted(known), np.int64)
    else:
        # A word that is even or has its highest bit has a smaller rotation, or is 0 or all ones.
        words = np.arange(1, 1 << (bits - 1), 2, dtype=np.int64)
        if rule.value != 'all':
            words = words[conforming(words, bits, **_rules(rule, bits))]
        words = words[words == smallest_rotation(words, bits)]
    if not words.size:
        rule.refuse('a rule that some word follows')
    return words


def _rules(rule: Entry, bits: int) -> dict[str, Any]:
    """Return the arguments of `conforming` that a mapping gives."""
    accepted: dict[str, Any] = {}
    for name, entry in rule.keys((), ('parity', 'opposite_pairs', 'changes', 'above')).items():
        if name == 'parity':
            if entry.value not in ('even', 'odd'):
                entry.refuse('even or odd')
            accepted[name] = entry.value
        elif name == 'opposite_pairs':
            accepted[name] = entry.integer(1, bits // 2)
            if bits % 2:
                entry.refuse('nothing where the number of bits is odd')
        else:
            least, most = (2, bits) if name == 'changes' else (0, 1 << bits)
            accepted[name] = entry.integer(least, most)
    return accepted


def conforming(
    words: np.ndarray,
    bits: int,
    parity: str = '',
    opposite_pairs: int = 0,
    changes: int | None = None,
    above: int = 0,
) -> np.ndarray:
    """Return whether words follow rules of a family, see docs/ring_targets.md, shape (k,)."""
    good = words > above
    if parity:
        good &= marks(words, bits) % 2 == (parity == 'odd')
    if opposite_pairs:
        half = bits // 2
        good &= marks(words & (words >> half) & ((1 << half) - 1), half) >= opposite_pairs
    if changes is not None:
        good &= borders(words, bits) <= changes
    return good


def marks(words: np.ndarray, bits: int) -> np.ndarray:
    """Return the numbers of ones of words."""
    count = np.zeros_like(words)
    for bit in range(bits):
        count += words >> bit & 1
    return count


@cache
def least_marked(code: RingPrint) -> float:
    """Return the share of the band that has marks in the word with the fewest of these."""
    return float(marks(code.words, code.bits).min() / code.bits)


def borders(words: np.ndarray, bits: int) -> np.ndarray:
    """Return the numbers of borders between ones and zeros of words, read in a circle."""
    return marks(words ^ (words >> 1 | (words & 1) << (bits - 1)), bits)


def _numbers(rule: Entry | None, words: np.ndarray, bits: int) -> np.ndarray:
    """Return the IDs of words: their rank, or what they are if they are read in some way."""
    if rule is None or rule.value == 'rank':
        return np.arange(1, words.size + 1)
    if not isinstance(rule.value, dict):
        rule.refuse('rank, or a mapping with the fields first_bit and direction')
    mirrored = False
    accepted = {
        'first_bit': ('lowest', 'highest'),
        'direction': ('counter-clockwise', 'clockwise'),
    }
    for name, entry in rule.keys((), tuple(accepted)).items():
        if entry.value not in accepted[name]:
            entry.refuse(' or '.join(accepted[name]))
        mirrored ^= entry.value == accepted[name][1]
    return smallest_rotation(mirrored_words(words, bits), bits) if mirrored else words.copy()


def canonical(words: np.ndarray, family: RingPrint) -> tuple[np.ndarray, np.ndarray]:
    """Return the canonical code words and the IDs of words of a family in any rotation.

    All are ndarrays of int64, shape (k,), and every word is one of the family.
    """
    codes = family.canonical(words)
    return codes, family.ids(codes)


def sectors(word: int, bits: int) -> np.ndarray:
    """Return the colours of the sectors of a band, ndarray of bool, shape (bits,).

    Element s is the sector from s 360/bits to (s + 1) 360/bits degrees counter-clockwise as seen
    on the printed target: true where it has the colour of the dot.
    """
    return (word >> np.arange(bits) & 1).astype(bool)


def words_of_print(
    code: RingPrint, word: int, families: Sequence[RingPrint]
) -> dict[RingPrint, int]:
    """Return the canonical words of those of some families whose targets have the print of a word.

    A word all of whose runs are a multiple of some angle may be a word of other numbers of
    sectors, too: 000111000111 of 12 bit is 0000111100001111 of 16. Nothing in an image of the
    target shows which one is meant. `word` is one of `code`, which is included if it is one of
    these.

    Examples
    --------
    >>> one, other = family('metashape12'), family('metashape16')
    >>> list(words_of_print(one, 455, (one, other)).values())
    [455, 3855]
    """
    return words_of_prints(code, np.array([word]), families)[0]


def words_of_prints(
    code: RingPrint, words: np.ndarray, families: Sequence[RingPrint]
) -> list[dict[RingPrint, int]]:
    """Return the same for each of k words, ndarray of int, shape (k,)."""
    same = (code.band, code.circles)
    alike = [other for other in families if (other.band, other.circles) == same]
    inked = code.canonical(words)[:, None] >> np.arange(code.bits) & 1  # a run begins at sector 0
    spread = {}
    for bits in {other.bits for other in alike}:
        blocks = inked.reshape(len(words), gcd(bits, code.bits), -1)
        whole = (blocks == blocks[..., :1]).all(axis=(1, 2))
        repeated = np.repeat(blocks[..., 0], bits // blocks.shape[1], axis=1)
        canonical = smallest_rotation(repeated @ (1 << np.arange(bits)), bits)
        spread[bits] = np.where(whole, canonical, 0)
    found: list[dict[RingPrint, int]] = [{} for _ in words]
    for other in alike:
        of_print = spread[other.bits]
        for index in np.flatnonzero(other.has(of_print)).tolist():
            found[index][other] = int(of_print[index])
    return found
