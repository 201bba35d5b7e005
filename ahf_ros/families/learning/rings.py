"""Families of ring targets, learnt from photographs of targets that nobody described.

A dot with a concentric band of sectors is a ring target of some family. All targets of a family
share bits, radii and rules, so that a few borders of each are enough.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ahf_ros.families.ring.bands import (
    GROWTH,
    MINIMUM_TARGETS,
    UNUSUAL,
    Bands,
    arc_borders,
    grid_odds,
    grid_phases,
    lengths_along,
    printed_band,
)
from ahf_ros.prints import RING_NAMES
from ahf_ros.prints.cyclic import smallest_rotation
from ahf_ros.prints.ring import BITS, RingPrint, conforming, family

Rules = dict[str, Any]
"""Arguments of `conforming`."""

_PINHOLE = 0.025  # radius of a hole that is seen, dot radii
_ALIKE = 0.15  # difference of the radii of bands of one family, dot radii
_PROVEN = 10.0  # log odds of a grid against any places, from which there is a family
_OTHER = 6.0  # log odds of another number of bits, from which a target is of another family
_UNCLEAR = 0.25  # mean difference of sectors from paper and ink
_MISREAD = 0.02  # share of words
_SAME_RADII = 0.08  # difference of radii that are the same, dot radii
_OFTEN = 3  # targets with a word, which then is not misread
_SAMPLED = 50_000  # words that tell how common a rule is
_COUNTED = 15  # bits, up to which all words are counted
_PARITIES = {'': 0.45, 'even': 0.5, 'odd': 0.05}  # probabilities before words are seen
_PAIRS, _PAIRS_ALONE = 0.4, 0.05  # of opposite pairs in words of even parity, and in others
_CHANGES = 0.1  # of a limit of changes
_POSSIBLE = 0.05  # probability from which rules may hold


@dataclass(frozen=True, slots=True)
class LearntFamily:
    """A family of ring targets as photographs show it."""

    bits: int
    band: tuple[float, float]  # as printed, dot radii
    growth: float  # of ink, on all edges, px
    words: np.ndarray  # (k,), canonical words of the targets
    bands: Bands  # the targets
    odds: float  # log odds of the grid against any places of borders
    lead: float  # the same of the number of bits against the next one
    rules: Rules  # the most probable ones of `likely`
    likely: list[tuple[Rules, float]]  # rules that words may follow, and their probabilities

    @property
    def polarity(self) -> str:
        """Colour of dot and marks, 'dark' or 'bright'."""
        return 'dark' if self.bands.polarity[0] > 0 else 'bright'

    @property
    def pinhole(self) -> float:
        """Radius of the hole in the dot as printed, dot radii, 0 where none is seen."""
        of = self.bands
        printed = np.median((of.pinhole * of.size + self.growth) / (of.size - self.growth))
        seen = np.median(of.pinhole) > _PINHOLE
        return max(float(printed), _PINHOLE) if seen else 0.0

    def known(self, more: Sequence[RingPrint] = ()) -> list[str]:
        """Return the families of this package, and more, of these words and radii, sorted."""
        codes = sorted([*map(family, RING_NAMES), *more], key=lambda code: len(code.words))
        return [
            code.name
            for code in codes
            if code.bits == self.bits
            and np.abs(np.subtract(code.band, self.band)).max() < _SAME_RADII
            and (code.ids(self.words) > 0).all()
        ]


def learn_families(bands: Bands) -> list[LearntFamily]:
    """Return the families of bands, those with the most targets first."""
    left, learnt = np.arange(len(bands.size)), []
    while left.size >= MINIMUM_TARGETS:
        some = bands.select(left)
        apart = [np.abs(of[:, None] - of) for of in (some.inner, some.outer)]
        near = (np.maximum(*apart) < _ALIKE) & (some.polarity[:, None] == some.polarity)
        group = np.flatnonzero(near[near.sum(axis=1).argmax()])
        if group.size < MINIMUM_TARGETS:
            break
        members, found = _learn(some.select(group))
        if len(found.words) >= MINIMUM_TARGETS and found.odds > _PROVEN:
            learnt.append(found)
        left = np.delete(left, group[members])
    return sorted(learnt, key=lambda it: -len(it.words))


def _learn(bands: Bands) -> tuple[np.ndarray, LearntFamily]:
    """Return the indices of bands of one family, and this."""
    counts, arcs = range(BITS[0], BITS[1] + 1), arc_borders(bands)
    scores = np.stack([grid_odds(bands, *arcs, bits) for bits in counts])  # bits, growth, target
    own = np.ones(len(bands.size), bool)
    for _ in range(3):
        total = scores[:, :, own].sum(axis=2) - UNUSUAL
        best, at = np.unravel_index(total.argmax(), total.shape)
        # Targets that another number of bits explains far better are of another family.
        own = scores[best, at] > scores[:, at].max(axis=0) - _OTHER
    bits, growth = counts[int(best)], _peak(GROWTH, scores[best][:, own].sum(axis=1))
    some = bands.select(own)
    words, clear = _words(some, bits, growth)
    different, count = np.unique(words[clear], return_counts=True)
    likely = likely_rules(different, count >= _OFTEN, bits)
    rules = likely[0][0]
    clear &= conforming(words, bits, **rules)
    found = LearntFamily(
        bits=bits,
        band=printed_band(some, growth),
        growth=growth,
        words=words[clear],
        bands=some.select(clear),
        odds=float(total.max()),
        lead=float(total.max() - np.delete(total.max(axis=1), best).max()),
        rules=rules,
        likely=likely,
    )
    return np.flatnonzero(own), found


def _peak(at: np.ndarray, values: np.ndarray) -> float:
    """Return where evenly spaced values, (n,), have their maximum, by the parabola through it."""
    best = int(np.clip(values.argmax(), 1, len(at) - 2))
    before, there, after = values[best - 1 : best + 2]
    bend = max(2 * there - before - after, 1e-9)
    aside = np.clip((after - before) / (2 * bend), -0.5, 0.5)
    return float(at[best] + aside * (at[1] - at[0]))


def _words(bands: Bands, bits: int, growth: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the canonical words of bands, and whether these are clear."""
    row, angle, begins = arc_borders(bands)
    count, angles = bands.ink.shape
    phase = grid_phases(angle + begins * growth / lengths_along(bands)[row], row, count, bits)
    inside = np.arange(bits)[:, None] + np.linspace(0.25, 0.75, 9)
    places = inside * (2 * np.pi / bits) + phase[:, None, None]
    at = np.rint(places * (angles / (2 * np.pi)) - 0.5).astype(int) % angles
    levels = np.clip(bands.ink[np.arange(count)[:, None, None], at], 0, 1).mean(axis=2)
    marked = levels > 0.5
    words = (marked << np.arange(bits)).sum(axis=1)
    return smallest_rotation(words, bits), np.abs(levels - marked).mean(axis=1) < _UNCLEAR


def likely_rules(words: np.ndarray, sure: np.ndarray, bits: int) -> list[tuple[Rules, float]]:
    """Return the rules that different words may follow, the most probable ones first.

    The words are drawn from those of a family up to the largest one seen, since some print the
    first words only. Each of n words has the probability 1 / n, so that the rules which leave the
    fewest words are the likeliest that all follow. Sure words follow them; a few others may be
    misread.
    """
    if bits <= _COUNTED:
        every = np.arange(1, 1 << bits)
        every, weight = every[every == smallest_rotation(every, bits)], 1.0
    else:
        drawn = np.random.default_rng(0).integers(1, (1 << bits) - 1, _SAMPLED)
        every, weight = smallest_rotation(drawn, bits), (1 << bits) / bits / _SAMPLED
    every = every[every <= words.max(initial=1)]
    misread = np.log(_MISREAD / max(weight * len(every), 1))
    rules, odds = [], []
    for rule, before in _possible_rules(bits):
        good = conforming(words, bits, **rule)
        if not good[sure].all():
            continue
        count, left = good.sum(), max(weight * conforming(every, bits, **rule).sum(), 1)
        drawn = np.log(np.maximum(left - np.arange(count), 1)).sum()  # none of them twice
        rules.append(rule)
        odds.append(np.log(before) - drawn + (~good).sum() * misread)
    share = np.exp(np.array(odds) - np.max(odds))
    share /= share.sum()
    order = np.argsort(-share, kind='stable').tolist()
    return [
        (rules[at], float(share[at])) for at in order if at == order[0] or share[at] > _POSSIBLE
    ]


def _possible_rules(bits: int) -> Iterator[tuple[Rules, float]]:
    """Yield the rules of words, with their probabilities before any word is seen."""
    limits = range(2, bits - bits % 2, 2)
    for parity, of_parity in _PARITIES.items():
        of_pairs = _PAIRS if parity == 'even' else _PAIRS_ALONE
        pairs = {0: 1 - of_pairs, 1: of_pairs} if bits % 2 == 0 else {0: 1.0}
        for least, of_least in pairs.items():
            rule: Rules = {'parity': parity} if parity else {}
            rule |= {'opposite_pairs': least} if least else {}
            yield rule, of_parity * of_least * (1 - _CHANGES)
            for limit in limits:
                yield rule | {'changes': limit}, of_parity * of_least * _CHANGES / len(limits)
