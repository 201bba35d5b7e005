"""Decoding of bands: one circular dynamic program over word and cover.

Every valid word competes at all rotations and phases. A band is seen at each angle, as paper or as
ink, or something covers it, which explains anything at a price. The path with the most evidence
(Viterbi 1967) gives the word, its margin over the next ID, the angles that are covered and the log
odds against everything that is no target: bare paper, and arcs of ink of any length.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

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
_NEVER = np.float32(-np.inf)

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
            hidden=np.zeros((count, angles), bool),
        )


def decode(
    evidence: Evidence,
    overhang: np.ndarray,
    family: RingPrint,
    expected: frozenset[int] = frozenset(),
    *,
    arcs: bool = True,
    looks: bool = True,
) -> Words:
    """Return the words with the most evidence, of k bands at m angles in the order of sectors.

    `overhang`, shape (k,), is by how many angles ink is longer at either end than its sectors;
    `expected` are IDs that are likely to be there. Empty: all IDs are equally likely. Without
    `arcs` nothing else explains the marks, so that `coded` is 0, and without `looks` words stand
    for the sectors as they look as well.
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
    bands = _Bands.of(evidence.select(read), of_bands.select(read), overhang[read], family)
    words, phases = _at_near_phases(words[read], phases[read])
    every = bands.explained(words, phases)
    ids = canonical(words, family)[1]
    likely = every.scores + prior(words, family, expected)
    best = likely.argmax(axis=1)
    # What is expected wins a draw, but an ID that is read clearly is no other one.
    read_as, known_as = (margins(ids, of, best) for of in (every.scores, likely))
    rows, of_best = np.arange(len(read)), every.of(best)
    word, phase = words[rows, best], phases[rows, best]
    score = of_best.scores.astype(np.float64)
    turned_hidden = _hidden(of_best.seen, of_best.as_paper, of_best.scores, bands.turned)
    hidden = bands.in_order(turned_hidden) | ((bands.some.paper == 0) & (bands.some.ink == 0))
    shown, last = bands.in_order(of_best.steps), bands.last
    inked, mixed = 2 * shown > last, (shown > 0) & (shown < last)
    other, of_other = word, score
    if looks:
        other = _as_it_looks(ones[read], pairs[read], phase, family)
    if (other != word).any():
        of_other = bands.explained(other[:, None], phase[:, None]).scores[:, 0]
    coded = beside = np.zeros(len(read))
    if arcs:
        of_arcs, borders = _free_paths(bands.turned)
        price = _of_borders(inked, mixed, hidden, borders, _border(bands.turned), family)
        # A first look, which tells whether there is a doubt, knows no lens.
        stiff, moved = bands.under_long_covers(of_best, moved=looks)
        coded, beside = stiff - of_arcs - price, np.maximum(moved - stiff, 0)
    found = Words(
        words=word,
        starts=2 * np.pi * phase / angles,
        margin=np.clip(known_as, read_as, read_as + _DRAW).astype(np.float64),
        marked=score - np.maximum(bands.turned.paper.sum(axis=1), 0) + bands.some.dot,
        coded=coded,
        beside=beside,
        other=other,
        ahead=of_other - score,
        seen=score,
        typical=_typical(bands.some, inked, hidden),
        unlike=np.zeros(len(read)),
        hidden=hidden,
    )
    return decoded.replaced(read, found)


@dataclass(frozen=True, slots=True)
class _Explained:
    """How w words explain k bands, whose angles begin where each band is seen best."""

    steps: np.ndarray  # uint8, (k, w, m), see `_steps`
    seen: np.ndarray  # (m, k, w), evidence for them along the bands
    as_paper: np.ndarray  # (m, k, w), where something like paper covers them, less its price
    scores: np.ndarray  # (k, w), the evidence in all, with the best covers

    def of(self, which: np.ndarray) -> _Explained:
        """Return one word of each band, by its index, shape (k,), without the axis of words."""
        rows = np.arange(len(which))
        return _Explained(
            self.steps[rows, which],
            self.seen[:, rows, which],
            self.as_paper[:, rows, which],
            self.scores[rows, which],
        )


@dataclass(frozen=True, slots=True)
class _Bands:
    """Bands that are decoded, and the same from those angles on at which they are seen best."""

    some: Evidence
    family: RingPrint
    ends: tuple[np.ndarray, np.ndarray]  # see `spread_ends`
    order: np.ndarray  # (k, m), angles of the band at those of `turned`
    turned: Evidence
    more: np.ndarray  # (k,), price of each further reading of something that looks like paper
    under_paper: np.ndarray  # (k, m), evidence for it, less that: on paper, and...
    on_mark: np.ndarray  # ... on a mark

    @classmethod
    def of(cls, raw: Evidence, some: Evidence, overhang: np.ndarray, family: RingPrint) -> _Bands:
        """Return bands, from their evidence with and `without_outliers`."""
        order = _clearest(some)

        def turned(of: np.ndarray) -> np.ndarray:
            return np.take_along_axis(of, order, axis=1)

        paper = turned(some.paper)
        between = np.take_along_axis(some.between, order[:, None], 2)
        _, more = _like_paper(some)
        return cls(
            some=some,
            family=family,
            ends=spread_ends(overhang, some.blur, some.paper.shape[1] // family.bits),
            order=order,
            turned=replace(some, paper=paper, ink=turned(some.ink), between=between),
            more=more,
            under_paper=paper - more[:, None],
            on_mark=turned(np.maximum(some.paper, _half_paper(raw))) - more[:, None],
        )

    @property
    def last(self) -> int:
        """The step of all ink; see `_steps`."""
        return self.some.between.shape[1] + 1

    def explained(self, words: np.ndarray, phases: np.ndarray) -> _Explained:
        """Return how words (k, w) explain the bands at their phases."""
        steps = _steps(words, phases - self.order[:, :1], self.ends, self.some, self.family)
        seen = _along_words(self.turned, steps)
        marked = (2 * steps > self.last).transpose(2, 0, 1)
        as_paper = np.where(marked, self.on_mark.T[..., None], self.under_paper.T[..., None])
        return _Explained(steps, seen, as_paper, _covered_paths(seen, as_paper, self.turned))

    def in_order(self, turned: np.ndarray) -> np.ndarray:
        """Return what is at the angles of `turned`, (k, m), at those of the bands."""
        found = np.empty(turned.shape, turned.dtype)
        np.put_along_axis(found, self.order, turned, axis=1)
        return found

    def under_long_covers(self, of: _Explained, *, moved: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return the evidence for one word of each band where covers may be as long as arcs, (k,).

        The second is that of bands which may be `moved` beside their dots.
        """
        ways = [of.seen, *([_moved(of.steps, self.turned)] if moved else ())]
        long = of.as_paper + np.float32(1 - _COVERED / _MORE) * self.more
        paths = _covered_paths(np.stack(ways, axis=2), long[..., None], self.turned)
        stiff, beside = paths.T.astype(np.float64)[[0, -1]]
        return stiff, beside


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

    Light may do anything at any angle.
    """
    paper, ink, between = (
        _bounded(of.sum(axis=1), evidence)
        for of in (evidence.paper, evidence.ink, evidence.between)
    )
    between = _unsure(np.concatenate([paper[:, None], between, ink[:, None]], axis=1), evidence)
    typical = _bounded(evidence.typical.sum(axis=1), evidence)
    return replace(evidence, paper=paper, ink=ink, between=between, typical=typical)


def _typical(evidence: Evidence, inked: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """Return the evidence that words have on average, from ink and covers (k, m), (k,)."""
    if not evidence.typical.shape[1]:
        return np.zeros(len(inked))
    paper, ink = evidence.typical.transpose(1, 0, 2)
    of_angles = np.where(hidden, 0, np.where(inked, ink, paper))
    return np.asarray(of_angles.sum(axis=1, dtype=np.float64))


def _unsure(every: np.ndarray, evidence: Evidence) -> np.ndarray:
    """Return the evidence for shares between, from that for all, (k, s, m): the best one near.

    The phase of sectors is known to about half an angle, which is some share where arcs end.
    """
    steps = every.shape[1] - 1
    error = _PHASE / np.sqrt(2 * np.pi) / np.hypot(evidence.blur, _PHASE)
    reach = np.rint(error * steps)[:, None, None]
    between = every[:, 1:-1]
    for away in range(1, steps):
        for low in (1 - away, 1 + away):
            which = np.clip(np.arange(low, low + steps - 1), 0, steps)
            between = np.where(reach >= away, np.maximum(between, every[:, which]), between)
    return between


def _bounded(values: np.ndarray, of: Evidence) -> np.ndarray:
    most = np.float32(_MAXIMUM_READING) * of.weight.reshape(-1, *(1,) * (values.ndim - 1))
    return most * np.tanh(values / most)


def _half_paper(evidence: Evidence) -> np.ndarray:
    """Return the evidence for marks of which something like paper covers one half, (k, m)."""
    (in_paper, out_paper), (in_ink, out_ink) = (
        of.transpose(1, 0, 2) for of in (evidence.paper, evidence.ink)
    )
    # A half that is covered explains what does not agree, but speaks for nothing.
    most = np.float32(_MORE) * evidence.weight[:, None]
    half = np.minimum(np.maximum(in_ink + out_paper, in_paper + out_ink), most)
    return _bounded(half, evidence)


def _like_paper(of: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """Return the prices of something that looks like paper, of its first reading and of more.

    Where light has many edges, it explains what looks like paper on a mark. float32, shape (k,).
    """
    light = 1 + np.float32(_IN_LIGHT) * (of.lit - SURPRISES[0])
    return np.float32(_LIKE_PAPER) * light, np.float32(_MORE) * of.weight * light


def _prices(of: Evidence) -> np.ndarray:
    """Return the prices of covers, and of those that look like paper, float32, shape (2, k)."""
    return np.stack([np.full_like(of.weight, COVER), _like_paper(of)[0]])


def _of_sectors(
    ranked: np.ndarray, overhang: np.ndarray, blur: np.ndarray, family: RingPrint
) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence for ones over zeros, and for pairs, as `best_words` takes it.

    From the evidence for ink over paper at each angle, (k, m). Arcs spread beyond their sectors by
    `overhang` and `blur`, angles of shape (k,), and fill the sectors between.
    """
    count = ranked.shape[1]
    per_sector = count // family.bits
    about = _about(ranked, np.arange(-per_sector, per_sector))
    rising, falling = spread_ends(overhang, blur, per_sector)
    begins, ends = ((about * of[:, None]).sum(axis=2) for of in (rising, falling))
    sums = about[..., per_sector:].sum(axis=2)
    ones, pairs = sums + begins + np.roll(ends, -per_sector, axis=1), -(begins + ends)
    first = np.arange(per_sector)[:, None] + np.arange(0, count, per_sector)
    return ones[:, first], pairs[:, first]


def spread_ends(
    overhang: np.ndarray, blur: np.ndarray, reach: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the shares of ink that spread arcs have about their ends, more than those printed.

    At `reach` angles on either side of where arcs begin, and of where they end, (k, 2 reach).
    """
    away = np.arange(-reach, reach) + 0.5
    over, wide = overhang[:, None], np.hypot(blur, _PHASE)[:, None]
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


def lengthened(bits: np.ndarray, overhang: np.ndarray) -> np.ndarray:
    """Return bits (k, ..., m) whose arcs of ink are longer at either end by angles, shape (k,)."""
    longer = np.rint(overhang).astype(int).reshape(-1, *(1,) * (bits.ndim - 1))
    for step in range(1, int(np.abs(longer).max(initial=0)) + 1):
        before, after = np.roll(bits, 1, axis=-1), np.roll(bits, -1, axis=-1)
        bits = np.where(longer >= step, bits | before | after, bits)
        bits = np.where(longer <= -step, bits & before & after, bits)
    return bits


def _clearest(evidence: Evidence) -> np.ndarray:
    """Return the angles of each band from that on at which it is seen best, shape (k, m)."""
    best = np.maximum(evidence.paper, evidence.ink)
    window = _about(best, np.arange(-_NEAR, _NEAR + 1)).sum(axis=2)
    return (window.argmax(axis=1)[:, None] + np.arange(best.shape[1])) % best.shape[1]


def _at_near_phases(words: np.ndarray, phases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return words and phases (k, w), and the best words at both phases beside theirs."""
    best, phase = words[:, :_REFINED], phases[:, :_REFINED]
    return np.hstack([words, best, best]), np.hstack([phases, phase - 1, phase + 1])


def _steps(
    words: np.ndarray,
    phases: np.ndarray,
    ends: tuple[np.ndarray, np.ndarray],
    of: Evidence,
    family: RingPrint,
) -> np.ndarray:
    """Return the shares of ink that words show at each angle, in steps of `Evidence.between`.

    Of words (k, w) by their phases, from the spread of ends of arcs, see `spread_ends`; uint8,
    shape (k, w, m).
    """
    bits = (words[..., None] >> np.arange(family.bits) & 1).astype(np.float32)
    before = np.roll(bits, 1, axis=2)
    begins, finishes = bits * (1 - before), before * (1 - bits)
    here = [bits, begins, finishes, np.roll(begins, -1, axis=2), np.roll(finishes, -1, axis=2)]
    per_sector = ends[0].shape[1] // 2
    (early_rise, rise), (early_fall, fall) = (np.split(end, 2, axis=1) for end in ends)
    spread = np.stack([np.ones_like(rise), rise, fall, early_rise, early_fall], axis=1)
    of_sectors = np.stack(here, axis=-1).reshape(len(words), -1, len(here))
    shares = np.clip(of_sectors @ spread.astype(np.float32), 0, 1)
    steps = np.rint(shares * np.float32(of.between.shape[1] + 1)).astype(np.uint8)
    count = family.bits * per_sector
    twice = np.tile(steps.reshape(*words.shape, count), 2)
    turns = np.lib.stride_tricks.sliding_window_view(twice, count, axis=2)
    bands, number = np.ogrid[: len(words), : words.shape[1]]
    return np.asarray(turns[bands, number, -phases % count])


def _along_words(evidence: Evidence, steps: np.ndarray) -> np.ndarray:
    """Return the evidence for words at each angle, from their `_steps`, shape (m, k, w)."""
    paper, ink = evidence.paper[:, None], evidence.ink[:, None]
    every = np.concatenate([paper, evidence.between, ink], axis=1).transpose(2, 0, 1)
    count, bands, kinds = every.shape
    first = (np.arange(count * bands, dtype=np.int32) * kinds).reshape(count, bands, 1)
    return np.take(np.ascontiguousarray(every), first + steps.transpose(2, 0, 1))


def _moved(steps: np.ndarray, of: Evidence) -> np.ndarray:
    """Return the evidence for words whose bands are where they fit best beside their dots, (m, k).

    From their `_steps`, (k, m).
    """
    here, before = _moves(steps.shape[1])
    evidence = _along_words(of, (steps[:, here] + steps[:, before]) // 2)
    best = evidence.sum(axis=0).argmax(axis=1)
    return np.asarray(evidence[:, np.arange(len(steps)), best])


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


def _covered_paths(seen: np.ndarray, as_paper: np.ndarray, of: Evidence) -> np.ndarray:
    """Return the evidence for words with their best covers, (k, w).

    From the evidence where they are seen, and where something like paper covers them, less its
    price, (m, k, w).
    """
    price, cost = _prices(of)[..., None], np.float32(_COVERED) * of.weight[:, None]
    clear = seen[0].copy()
    hidden = np.full((2, *clear.shape), _NEVER)
    (covered, like_paper), begun = hidden, np.empty_like(hidden)
    for of_angle, of_paper in zip(seen[1:], as_paper[1:], strict=True):
        np.subtract(clear, price, out=begun)
        np.maximum(clear, covered, out=clear)
        np.maximum(clear, like_paper, out=clear)
        clear += of_angle
        np.maximum(hidden, begun, out=hidden)
        covered -= cost
        like_paper += of_paper
    return np.maximum(np.maximum(clear, covered), like_paper)


def _hidden(
    seen: np.ndarray, as_paper: np.ndarray, scores: np.ndarray, of: Evidence
) -> np.ndarray:
    """Return where the best paths of one word of each band are covered, shape (k, m).

    From the evidence of the word at each angle, (m, k) each, and that of its best path, (k,).
    """
    hidden = np.zeros(seen.T.shape, bool)
    rounding = np.finfo(seen.dtype).eps * np.abs(seen).sum(axis=0)
    some = np.flatnonzero(scores > seen.sum(axis=0) + len(seen) * rounding)
    if some.size:
        hidden[some] = _backtracked(seen[:, some], as_paper[:, some], of.select(some))
    return hidden


def _backtracked(seen: np.ndarray, as_paper: np.ndarray, of: Evidence) -> np.ndarray:
    """Return the same for bands of which a part is covered.

    Of the best path to each angle and the best one from there, by what the band is there: seen,
    covered, or covered by something like paper.
    """
    count, bands = seen.shape
    cost = np.broadcast_to(np.float32(_COVERED) * of.weight, seen.shape)
    gains = np.stack([seen, -cost, as_paper], axis=1)
    until, after = np.full((2, count, 3, bands), _NEVER)
    until[0, 0], after[-1] = seen[0], 0
    price = _prices(of)
    for before, here, gain in zip(until, until[1:], gains[1:], strict=False):
        np.maximum(np.maximum(before[0], before[1]), before[2], out=here[0])
        np.maximum(before[1:], before[0] - price, out=here[1:])
        here += gain
    for later, here, gain in zip(after[::-1], after[-2::-1], gains[::-1], strict=False):
        gained = later + gain
        np.maximum(gained[0], gained[1:], out=here[1:])
        begun = gained[1:] - price
        np.maximum(gained[0], np.maximum(begun[0], begun[1]), out=here[0])
    whole = (until + after).transpose(1, 2, 0)
    return np.asarray(np.maximum(whole[1], whole[2]) > whole[0])


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


def _free_paths(evidence: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence for arcs of ink of any length, with their best covers, shape (k,).

    With it comes the number of borders of these arcs, each of which has its price.
    """
    cost, cover = np.float32(_COVERED) * evidence.weight, np.float32(COVER)
    looks = np.stack([evidence.paper, evidence.ink]).transpose(2, 0, 1)
    between = evidence.between.max(axis=1, initial=0).T
    mixed = np.maximum(np.maximum(looks[:, 0], looks[:, 1]), between) - _border(evidence)
    paths = np.full((len(looks), 3, len(cost)), _NEVER)  # that end on paper, on ink or covered
    paths[0, :2] = looks[0]
    band, covers = paths[:, :2], paths[:, 2]
    seen, covered = band[0], covers[0]
    for here, border, of_seen, of_covered in zip(
        looks[1:], mixed[1:], band[1:], covers[1:], strict=True
    ):
        begun = np.maximum(seen[0], seen[1]) - cover
        stayed = np.maximum(seen, covered) + here
        np.maximum(stayed, seen[::-1] + border, out=of_seen)
        np.subtract(np.maximum(covered, begun), cost, out=of_covered)
        seen, covered = of_seen, of_covered
    # Where the paths come from is compared as above, for all angles at once.
    seen, covered = band[:-1], covers[:-1, None]
    paper, ink = seen.swapaxes(0, 1)
    stayed = np.maximum(seen, covered) + looks[1:]
    origin = np.empty((len(looks) - 1, 3, len(cost)), np.intp)
    origin[:, :2] = np.where(covered > seen, 2, [[0], [1]])
    turned = np.zeros(origin.shape, bool)
    turned[:, :2] = seen[:, ::-1] + mixed[1:, None] > stayed
    np.copyto(origin[:, :2], [[1], [0]], where=turned[:, :2])
    origin[:, 2] = np.where(np.maximum(paper, ink) - cover > covers[:-1], ink > paper, 2)
    origin *= len(cost)
    origin += np.arange(len(cost))
    place, places = paths[-1].argmax(axis=0) * len(cost) + np.arange(len(cost)), []
    for of_angle in origin.reshape(len(origin), -1)[::-1]:
        places.append(place)
        place = of_angle[place]
    ends = turned.reshape(len(origin), -1)[::-1]
    borders = np.take_along_axis(ends, np.reshape(places, (len(ends), -1)), axis=1).sum(axis=0)
    return paths[-1].max(axis=0), borders
