"""Decoding of bands that something may hide in part.

An edge of a shadow and that of a hand look alike. `decode` takes everything for light. Here what
light and print do not explain may be hidden, for every word alike, and the word has to be the only
one without it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.codes.ring import Family, canonical
from ahf_ros.detectors.ring.band_evidence import BandEvidence
from ahf_ros.detectors.ring.band_samples import BandSamples
from ahf_ros.detectors.ring.codewords import best_words, margins, prior
from ahf_ros.detectors.ring.decoding import (
    MINIMUM_EXPLAINED,
    Readings,
    bits_at,
    explanation,
    sectors_by_phase,
)
from ahf_ros.detectors.ring.evidence import MarkAppearance
from ahf_ros.detectors.ring.explanations import best_explanations, explained_words
from ahf_ros.detectors.ring.impossible import are_impossible
from ahf_ros.detectors.ring.occlusion import (
    EVEN,
    HiddenEvidence,
    clearest,
    hidden_evidence,
    nothing_better,
    sector_evidence,
    turned,
)
from ahf_ros.detectors.ring.print_evidence import print_evidence
from ahf_ros.features.array_record import ArrayRecord

_MAXIMUM_MARGIN = 13.0  # what looks like the ground over two sectors makes any word another one
_CLEAR_MARGIN = 30.0  # where nothing is hidden, of words that no hypothesis can defeat
_SETTLED_MARGIN, _SETTLED = 40.0, 10.0  # the same, and of words that one only can defeat
_ONE_HIDDEN = 10.0  # evidence over that one: something like the ground lies over a sector
_DRAW = 5.0  # lead of a word that is not expected, which is as good as none
_MOST_HIDDEN = 0.85  # share of a band that light hides, of which some marks are made up
_CLEAR = 2.0  # evidence for any states over the word's own, of words that are clear


@dataclass(frozen=True, slots=True)
class _Words(ArrayRecord):
    """Words, their phases and margins, and what explains them best."""

    words: np.ndarray
    phases: np.ndarray
    margin: np.ndarray
    unexplained: np.ndarray
    hidden: np.ndarray


def decode_occluded(
    samples: BandSamples,
    evidence: BandEvidence,
    readings: Readings,
    marks: MarkAppearance,
    frames: np.ndarray,
    family: Family,
    expected: frozenset[int] = frozenset(),
) -> Readings:
    """Return the words with the most evidence, whatever hides a part of the band.

    Parameters
    ----------
    samples, evidence, marks, family
        As for `decode`.
    readings : Readings
        What `decode` read.
    frames : ndarray of float64, shape (k, 3, 3)
        Right to a tenth of a dot radius at the band.
    expected : frozenset of int
        IDs that are likely to be there; all are alike where it is empty.
    """
    of = hidden_evidence(print_evidence(samples, evidence, marks, frames, family))
    count = of.onto.shape[1]
    phases = np.rint(readings.start * count / (2 * np.pi)).astype(np.intp)
    bits = bits_at(readings.words, phases, count // family.bits, family)
    better = nothing_better(of, bits)
    plain = _Words(
        readings.words,
        phases,
        np.minimum(readings.margin, _MAXIMUM_MARGIN),
        better,
        np.zeros(bits.shape, bool),
    )
    likely = (readings.words > 0) & (prior(readings.words, family, expected) == 0)
    clear = likely & (readings.margin > _CLEAR_MARGIN) & (better < _CLEAR)
    settled = likely & (readings.margin > _SETTLED_MARGIN) & (better < _SETTLED) & ~clear
    some = np.flatnonzero(settled)
    best = plain.replaced(some, _explained(of.select(some), plain.select(some), bits[some]))
    others = np.flatnonzero(~clear & ~(settled & ~best.hidden.any(axis=1)))
    best = best.replaced(
        others, _competing(of.select(others), plain.select(others), family, expected)
    )
    (_, before), (_, after) = (canonical(of.words, family) for of in (readings, best))
    same = (readings.words > 0) & (before == after)
    explained, contradiction = explanation(
        samples, evidence, marks, best.words, best.phases, best.hidden, family
    )
    even = of.price <= EVEN
    seen = (best.hidden.mean(axis=1) < _MOST_HIDDEN) | even
    possible = even | ~are_impossible(
        samples, best.words, best.phases, best.hidden, marks, frames, family
    )
    return Readings(
        best.words,
        2 * np.pi * best.phases / count,
        best.margin,
        np.where(same, readings.margin, -readings.margin),
        contradiction,
        explained,
        best.unexplained,
        best.hidden,
        of.price,
        (best.words > 0) & seen & possible & (explained.min(axis=1) > MINIMUM_EXPLAINED),
    )


def _explained(of: HiddenEvidence, plain: _Words, bits: np.ndarray) -> _Words:
    """Return words that only something like the ground can defeat, and what explains them best."""
    margin = np.minimum(_ONE_HIDDEN + of.price, _MAXIMUM_MARGIN)
    order = clearest(of)
    hidden, unexplained = _best_explanations(of, bits, order)
    return replace(plain, margin=margin, unexplained=unexplained, hidden=hidden)


def _best_explanations(
    of: HiddenEvidence, bits: np.ndarray, order: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return `best_explanations` with the angles in their own order, not in that of the search."""
    turned_bits = np.take_along_axis(bits, order, axis=1)
    turned_hidden, unexplained = best_explanations(turned(of, order), turned_bits)
    hidden = np.empty_like(turned_hidden)
    np.put_along_axis(hidden, order, turned_hidden, axis=1)
    return hidden, unexplained


def _competing(
    of: HiddenEvidence, plain: _Words, family: Family, expected: frozenset[int]
) -> _Words:
    """Return the words that all hypotheses of what is hidden leave, the plain ones among them."""
    per_sector = of.onto.shape[1] // family.bits
    angles = sectors_by_phase(per_sector, family)
    ground, mark = np.moveaxis(sector_evidence(of, angles), 1, 0)
    last = angles[..., -1]
    words, phases, _ = best_words(
        mark - ground, of.onto[:, last], of.off[:, last], family, expected
    )
    read = plain.words > 0
    words = np.column_stack([words, np.where(read, plain.words, words[:, 0])])
    phases = np.column_stack([phases, np.where(read, plain.phases, phases[:, 0])])
    order = clearest(of)
    bits = bits_at(words, phases, per_sector, family)
    turned_bits = np.take_along_axis(bits, order[:, None], axis=2)
    evidence = explained_words(turned(of, order), turned_bits)
    scores = evidence + prior(words, family, expected)
    best, rows = scores.argmax(axis=1), np.arange(len(words))
    hidden, unexplained = _best_explanations(of, bits[rows, best], order)
    # What is expected wins a draw, but an ID that is read clearly is no other one.
    margin = np.minimum(
        margins(words, scores, best, family), margins(words, evidence, best, family) + _DRAW
    )
    margin = np.minimum(margin, _MAXIMUM_MARGIN)
    return _Words(words[rows, best], phases[rows, best], margin, unexplained, hidden)
