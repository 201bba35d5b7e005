"""Decoding of bands: one circular dynamic program over word and cover.

Every valid word competes at all rotations and phases. A band is seen at each angle, as paper or as
ink, or something covers it, which explains anything at a price. The path with the most evidence
(Viterbi 1967) gives the word, its margin over the next ID, the angles that are covered and the log
odds against everything that is no target: bare paper, and arcs of ink of any length.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ahf_ros import kernels
from ahf_ros.families.ring.codewords import best_words, likeliest_bits, prior
from ahf_ros.families.ring.likelihood import SURPRISES, Evidence
from ahf_ros.families.words import margins
from ahf_ros.prints.ring import RingPrint, canonical
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.normal import normal_integral

_MAXIMUM_READING = 5.0  # for or against a word
_LIKE_PAPER = 8.5  # the same of something that looks like paper
_IN_LIGHT = 15.0  # times the probability of edges of light beyond the least, by which that grows
_MORE = 0.6  # of each further reading of that
_COVERED = 0.1  # price of each further reading that something else covers
_RANKED = 1.2  # evidence of a reading that ranks words, which one cover must not settle
_DRAW = 5.0  # lead of a word that is not expected, which is as good as none
_NEAR = 3  # angles on either side of the clearest one
_REFINED = 2  # best words, that compete at the phases beside theirs as well
_PHASE = 0.6  # error of the phase of sectors, angles
_ASIDE = np.radians([1.5, 2.25, 3.0, 3.75, 4.5])  # of bands along themselves beside their dots
_SIDES = 8  # on which they are

COVER = 6.0
"""Price of something that covers a stretch of the band."""

CLEAR = 15.0
"""Log odds of a word against the next ID that leave no doubt of it."""

DOUBT = 3.0
"""Log odds of arcs of any length against a word that leave one."""


@dataclass(frozen=True, slots=True)
class Words(ArrayRecord):
    """The words read from k bands at m angles.

    Attributes
    ----------
    words : ndarray of int64, shape (k,)
        The best valid word, in the rotation read from `starts`; 0 where there is none.
    starts : ndarray of float64, shape (k,)
        Where in the frame the sector of the lowest bit starts, rad counter-clockwise from +x.
    margin : ndarray of float64, shape (k,)
        Log odds of the word against the best one of another ID.
    marked : ndarray of float64, shape (k,)
        Log odds of the word against bare paper, and against anything.
    coded : ndarray of float64, shape (k,)
        Log odds of the word against arcs of ink of any length, and covers of any length; with
        where they end, see `borders`.
    beside : ndarray of float64, shape (k,)
        By how much these grow if the band may be beside its dot, as far as a lens moves it.
    other : ndarray of int64, shape (k,)
        The sectors as they look, in the same rotation, whether or not a family has that word.
    ahead : ndarray of float64, shape (k,)
        Log odds of these against the word and what covers it.
    seen : ndarray of float64, shape (k,)
        Log odds of the word, where it is not covered, against anything.
    typical : ndarray of float64, shape (k,)
        The same as targets with this word have it on average, in light with as many edges.
    unlike : ndarray of float64, shape (k,)
        Share of sectors in which targets are not what their words print, see `appearance`; NaN
        where light is uneven.
    outer : ndarray of float64, shape (k,)
        Evidence of the outer edges of marks, negative where most marks do not end there.
    hidden : ndarray of bool, shape (k, m)
        Where something covers the band.
    """

    words: np.ndarray
    starts: np.ndarray
    margin: np.ndarray
    marked: np.ndarray
    coded: np.ndarray
    beside: np.ndarray
    other: np.ndarray
    ahead: np.ndarray
    seen: np.ndarray
    typical: np.ndarray
    unlike: np.ndarray
    outer: np.ndarray
    hidden: np.ndarray

    def as_they_look(self) -> Words:
        """Return the sectors as they look in place of words that something covers."""
        return replace(self, words=self.other, hidden=np.zeros_like(self.hidden))

    @staticmethod
    def none(count: int, angles: int = 1) -> Words:
        """Return bands without words."""
        return Words(
            words=np.zeros(count, np.int64),
            starts=np.zeros(count),
            margin=np.zeros(count),
            marked=np.zeros(count),
            coded=np.zeros(count),
            beside=np.zeros(count),
            other=np.zeros(count, np.int64),
            ahead=np.zeros(count),
            seen=np.zeros(count),
            typical=np.zeros(count),
            unlike=np.zeros(count),
            outer=np.zeros(count),
            hidden=np.zeros((count, angles), bool),
        )


def decode(
    evidence: Evidence,
    overhang: np.ndarray,
    family: RingPrint,
    expected: frozenset[int] = frozenset(),
    *,
    draft: bool = False,
) -> Words:
    """Return the words with the most evidence, of k bands at m angles in the order of sectors.

    `overhang`, shape (k,), is by how many angles ink is longer at either end than its sectors;
    `expected` are IDs that are likely to be there. Empty: all IDs are equally likely. In a `draft`
    nothing else explains the marks, so that `coded` is 0, and words stand for the sectors as they
    look as well.
    """
    of_bands = without_outliers(evidence)
    count, angles = of_bands.paper.shape
    cap = _RANKED * of_bands.weight[:, None]
    ranked = np.clip(of_bands.ink - of_bands.paper, -cap, cap)
    ones, pairs = _of_sectors(ranked, overhang, evidence.blur, family)
    words, phases = best_words(ones, pairs, family, expected)
    read = np.flatnonzero(words[:, 0] > 0)
    decoded = Words.none(count, angles)
    if not read.size:
        return decoded
    if read.size < count:
        evidence, of_bands, overhang = evidence.select(read), of_bands.select(read), overhang[read]
        ones, pairs, words, phases = ones[read], pairs[read], words[read], phases[read]
    bands = _Bands.of(evidence, of_bands, overhang, family)
    words, phases = _at_near_phases(words, phases)
    steps = bands.steps(words, phases)
    # Which word it is, borders of covers do not tell; that it is one, they may.
    scores = bands.scores(steps, ends=draft)
    ids = canonical(words, family)[1]
    likely = scores + prior(words, family, expected)
    best = likely.argmax(axis=1)
    # What is expected wins a draw, but an ID that is read clearly is no other one.
    read_as, known_as = (margins(ids, of, best) for of in (scores, likely))
    rows = np.arange(len(read))
    word, phase, shown = words[rows, best], phases[rows, best], steps[rows, best]
    score = scores[rows, best].astype(np.float64)
    hidden = bands.hidden(shown) | ((bands.some.paper == 0) & (bands.some.ink == 0))
    inked, mixed = 2 * shown > bands.last, (shown > 0) & (shown < bands.last)
    other, of_other, coded, beside = word, score, *np.zeros((2, len(read)))
    if not draft:
        other = _as_it_looks(ones, pairs, phase, family)
        ways = np.stack([shown, bands.steps(other[:, None], phase[:, None])[:, 0]], axis=1)
        score, of_other = bands.scores(ways).astype(np.float64).T
        border = _border(bands.some)
        of_arcs, borders = bands.arcs(border)
        price = _of_borders(inked, mixed, hidden, borders, border, family)
        stiff, moved = bands.under_long_covers(shown)
        coded, beside = stiff - of_arcs - price, np.maximum(moved - stiff, 0)
    found = Words(
        words=word,
        starts=2 * np.pi * phase / angles,
        margin=np.clip(known_as, read_as, read_as + _DRAW).astype(np.float64),
        marked=score - np.maximum(bands.some.paper.sum(axis=1), 0) + bands.some.dot,
        coded=coded,
        beside=beside,
        other=other,
        ahead=of_other - score,
        seen=score,
        typical=_typical(bands.some, inked, hidden),
        unlike=np.zeros(len(read)),
        outer=np.where(inked & ~hidden, evidence.ink[:, 1], 0).sum(axis=1, dtype=np.float64),
        hidden=hidden,
    )
    return decoded.replaced(read, found)


@dataclass(frozen=True, slots=True)
class _Bands:
    """Bands that are decoded, and the angles at which each is seen best, where its paths begin."""

    some: Evidence
    family: RingPrint
    ends: tuple[np.ndarray, np.ndarray]  # see `spread_ends`
    first: np.ndarray  # (k,)
    price: np.ndarray  # (k,), of the first reading of something that looks like paper, and...
    more: np.ndarray  # ... of each further one
    as_paper: np.ndarray  # (2, k, m), evidence for it, less that: on paper, and on a mark

    @classmethod
    def of(cls, raw: Evidence, some: Evidence, overhang: np.ndarray, family: RingPrint) -> _Bands:
        """Return bands, from their evidence with and `without_outliers`."""
        price, more = _like_paper(some)
        return cls(
            some=some,
            family=family,
            ends=spread_ends(overhang, some.blur, some.paper.shape[1] // family.bits),
            first=_clearest(some),
            price=price,
            more=more,
            as_paper=np.stack([some.paper, np.maximum(some.paper, _half_paper(raw))])
            - more[:, None],
        )

    @property
    def last(self) -> int:
        """The step of all ink."""
        return self.some.looks.shape[1] - 1

    @property
    def cost(self) -> np.ndarray:
        """The price of each reading that something covers, (k,)."""
        return np.float32(_COVERED) * self.some.weight

    def steps(self, words: np.ndarray, phases: np.ndarray) -> np.ndarray:
        """Return the shares of ink that words (k, w) show, in steps of `looks`, (k, w, m)."""
        sizes = {'n': self.family.bits, 'm': self.some.paper.shape[1]}
        return kernels.word_steps(words, phases, *self.ends, self.last, **sizes)

    def scores(self, steps: np.ndarray, *, long: bool = False, ends: bool = True) -> np.ndarray:
        """Return the evidence for words with their best covers, by their steps, (k, w).

        Covers may be as `long` as arcs. What the border of one makes of paper or ink looks like
        the end of an arc: without `ends`, shares of ink between say no more beside covers.
        """
        most = np.full(self.some.paper.shape, np.inf, np.float32)
        if not ends:
            most = np.maximum(np.maximum(self.some.paper, self.some.ink), 0)
        return kernels.covered_words(*self._paths(steps, long=long), most)

    def hidden(self, steps: np.ndarray) -> np.ndarray:
        """Return where the best path of one word of each band is covered, (k, m) as its steps."""
        return kernels.hidden_angles(*self._paths(steps))[0]

    def arcs(self, border: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the evidence for arcs of any length with their best covers, (k,).

        With it comes the number of their borders, each of which has its price, shape (k,).
        """
        some = self.some
        scores, borders = kernels.free_arcs(some.looks, self.first, border, COVER, self.cost)
        return scores.astype(np.float64), borders

    def under_long_covers(self, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the evidence for one word of each band where covers may be as long as arcs, (k,).

        The second is that of bands which may be moved beside their dots.
        """
        ways = np.stack([steps, self._moved(steps)], axis=1)
        stiff, moved = self.scores(ways, long=True).astype(np.float64).T
        return stiff, moved

    def _paths(self, steps: np.ndarray, *, long: bool = False) -> tuple[Any, ...]:
        """Return what paths along words meet."""
        some, as_paper = self.some, self.as_paper
        if long:
            as_paper = as_paper + np.float32(1 - _COVERED / _MORE) * self.more[:, None]
        return some.looks, steps, self.first, as_paper, COVER, self.cost, self.price

    def _moved(self, steps: np.ndarray) -> np.ndarray:
        """Return the steps of words whose bands are where they fit best beside their dots, (k, m).

        From where they are, (k, m).
        """
        here, before = _moves(steps.shape[1])
        best = kernels.best_moves(self.some.looks, steps, here, before)
        rows = np.arange(len(steps))[:, None]
        return (steps[rows, here[best]] + steps[rows, before[best]]) // 2


def _as_it_looks(
    ones: np.ndarray, pairs: np.ndarray, phase: np.ndarray, family: RingPrint
) -> np.ndarray:
    """Return the words that sectors look like at phases, shape (k,), of any family or of none.

    From the evidence for ones over zeros, and for pairs; see `best_words`.
    """
    per_sector = ones.shape[1]
    rows = np.arange(len(phase))
    bits, _ = likeliest_bits(*(of[rows, phase % per_sector] for of in (ones, pairs)))
    # The phases of words begin at any of the sectors.
    turn = phase[:, None] // per_sector + np.arange(family.bits)
    return np.take_along_axis(bits, turn % family.bits, 1) @ (1 << np.arange(family.bits))


def without_outliers(evidence: Evidence) -> Evidence:
    """Return the evidence of whole bands, (k, m), no reading of which counts too much.

    Light may do anything at any angle. The phase of sectors is known to about half an angle, which
    is some share of ink where arcs end, so that the evidence for such shares is the best one near.
    """
    error = _PHASE / np.sqrt(2 * np.pi) / np.hypot(evidence.blur, _PHASE)
    reach = np.rint(error * (evidence.looks.shape[2] - 1)).astype(np.int64)
    looks = _bounded(evidence.looks, evidence.weight, reach)
    return replace(evidence, looks=looks, typical=_bounded(evidence.typical, evidence.weight))


def _typical(evidence: Evidence, inked: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """Return the evidence that words have on average, from ink and covers (k, m), (k,)."""
    paper, ink = evidence.typical.transpose(1, 0, 2)
    of_angles = np.where(hidden, 0, np.where(inked, ink, paper))
    return np.asarray(of_angles.sum(axis=1, dtype=np.float64))


def _bounded(
    readings: np.ndarray, weight: np.ndarray, reach: np.ndarray | None = None
) -> np.ndarray:
    """Return the sums of halves (k, 2, n, m), none of which counts too much, (k, n, m).

    Within `reach` of shares between, (k,), the best ones.
    """
    reach = np.zeros(len(weight), np.int64) if reach is None else reach
    most = np.float32(_MAXIMUM_READING) * weight
    bounded: np.ndarray = kernels.bounded_readings(readings, most, reach)[0]
    return bounded


def _half_paper(evidence: Evidence) -> np.ndarray:
    """Return the evidence for marks of which something like paper covers one half, (k, m)."""
    (in_paper, out_paper), (in_ink, out_ink) = (
        of.transpose(1, 0, 2) for of in (evidence.paper, evidence.ink)
    )
    # A half that is covered explains what does not agree, but speaks for nothing.
    most = np.float32(_MORE) * evidence.weight[:, None]
    half = np.minimum(np.maximum(in_ink + out_paper, in_paper + out_ink), most)
    return _bounded(half[:, None, None], evidence.weight)[:, 0]


def _like_paper(of: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """Return the prices of something that looks like paper, of its first reading and of more.

    Where light has many edges, it explains what looks like paper on a mark. float32, shape (k,).
    """
    light = 1 + np.float32(_IN_LIGHT) * (of.lit - SURPRISES[0])
    return np.float32(_LIKE_PAPER) * light, np.float32(_MORE) * of.weight * light


def _of_sectors(
    ranked: np.ndarray, overhang: np.ndarray, blur: np.ndarray, family: RingPrint
) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence for ones over zeros, and for pairs, as `best_words` takes it.

    From the evidence for ink over paper at each angle, (k, m). Arcs spread beyond their sectors by
    `overhang` and `blur`, angles of shape (k,), and fill the sectors between.
    """
    per_sector = ranked.shape[1] // family.bits
    ends = spread_ends(overhang, blur, per_sector)
    return kernels.sector_evidence(ranked, *ends, n=family.bits)


def spread_ends(
    overhang: np.ndarray, blur: np.ndarray, reach: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the shares of ink that spread arcs have about their ends, more than those printed.

    At `reach` angles before and after where arcs begin, and where they end, (k, 2, reach).
    """
    away = np.arange(-reach, reach).reshape(2, reach) + 0.5
    over, wide = (of[:, None, None] for of in (overhang, np.hypot(blur, _PHASE)))
    rising = normal_integral((away + over) / wide) - (away > 0)
    falling = (away > 0) - normal_integral((away - over) / wide)
    return rising, falling


def bits_at(
    words: np.ndarray, phases: np.ndarray, per_sector: int, family: RingPrint
) -> np.ndarray:
    """Return whether words have a mark at each angle, by their phases, (...), bool, (..., m)."""
    count = family.bits * per_sector
    sector = (np.arange(count) - phases[..., None]) % count // per_sector
    return (words[..., None] >> sector & 1).astype(bool)


def _clearest(evidence: Evidence) -> np.ndarray:
    """Return the angle at which each band is seen best, shape (k,)."""
    best = np.maximum(evidence.paper, evidence.ink)
    return _about(best, np.arange(-_NEAR, _NEAR + 1)).sum(axis=2).argmax(axis=1)


def _at_near_phases(words: np.ndarray, phases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return words and phases (k, w), and the best words at both phases beside theirs."""
    best, phase = words[:, :_REFINED], phases[:, :_REFINED]
    return np.hstack([words, best, best]), np.hstack([phases, phase - 1, phase + 1])


@lru_cache(maxsize=32)
def _moves(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles that bands beside their dots show at each one, int, (n, count).

    They show what is between two, where they are moved by a half. The first one is not moved. A
    lens distorts targets by a square, which moves a band along itself by a sine of the angle about
    the dot, and what it does across a projective frame follows.
    """
    angles = 2 * np.pi / count * np.arange(count)
    sides = 2 * np.pi / _SIDES * np.arange(_SIDES)[:, None]
    moves = np.multiply.outer(np.concatenate([[0], _ASIDE]), np.sin(angles - sides))
    halves = np.unique(np.rint(moves.reshape(-1, count) * count / np.pi).astype(int), axis=0)
    here = np.arange(count) - halves // 2
    return here % count, (here - halves % 2) % count


def _borders(bits: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    """Return the number of borders of arcs of ink that are seen, of shape (k, m) each, (k,)."""
    border = (bits != np.roll(bits, 1, axis=1)) & ~(unknown & np.roll(unknown, 1, axis=1))
    return np.count_nonzero(border, axis=1)


def _of_borders(
    bits: np.ndarray,
    mixed: np.ndarray,
    hidden: np.ndarray,
    of_arcs: np.ndarray,
    price: np.ndarray,
    family: RingPrint,
) -> np.ndarray:
    """Return what the borders of words cost, from what is mixed and hidden, (k, m), shape (k,).

    As many as arcs of any length have, (k,), cost what they do there. Arcs do without those of
    sectors that blur mixes throughout, which are not worth the price of any place; such borders of
    a word only cost their share of its choice, unless a cover is beside them.
    """
    near = _any_of_next(hidden, 2 * _NEAR + 1, _NEAR)
    per_sector = bits.shape[1] // family.bits
    clear = ~_any_of_next(~_any_of_next(~mixed, per_sector), per_sector, per_sector - 1)
    every, seen = _borders(bits, hidden), _borders(bits, near)
    share = np.log(len(family.words) * family.bits) / np.maximum(every, 1)
    further = np.clip(seen - of_arcs, 0, _borders(bits, near | clear))
    return np.asarray(price * (every - further) + np.minimum(price, share) * further)


def _any_of_next(which: np.ndarray, count: int, before: int = 0) -> np.ndarray:
    """Return whether any of some angles is, from so many before each one on, both (k, m)."""
    return np.asarray(_about(which, np.arange(-before, count - before)).any(axis=2))


def _about(values: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return values (k, m) some steps (n,) along the band from each angle, shape (k, m, n)."""
    count = values.shape[1]
    return np.asarray(values[:, (np.arange(count)[:, None] + steps) % count])


def _border(evidence: Evidence) -> np.ndarray:
    """Return the prices of a border of an arc of any length, at one of all readings, (k,)."""
    return np.asarray(np.log(evidence.weight * evidence.paper.shape[1]))
