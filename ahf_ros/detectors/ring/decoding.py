"""Decoding of bands: the code word, phase and rotation with the most evidence.

All valid words compete at all rotations and phases.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.band_evidence import BandEvidence
from ahf_ros.detectors.ring.band_samples import BandSamples
from ahf_ros.detectors.ring.codewords import best_words
from ahf_ros.detectors.ring.evidence import MarkAppearance, log_ratio
from ahf_ros.features.array_record import ArrayRecord

_AGREEMENT = 0.35  # of ln, or of the step of a mark, between a step and what a word expects
_MINIMUM_MARGIN = 3.0  # of a plausible word
_MINIMUM_WEAKEST = -60.0  # evidence of a sector, against its bit in a plausible word
_MINIMUM_EXPLAINED = 0.25  # share of the steps that a plausible word explains


@dataclass(frozen=True, slots=True)
class Readings(ArrayRecord):
    """The words read from k bands.

    Attributes
    ----------
    words : ndarray of int64, shape (k,)
        The best valid word, in the rotation read from `start`; 0 where there is none.
    start : ndarray of float64, shape (k,)
        Where in the frame the sector of the lowest bit starts, rad counter-clockwise from +x.
    margin : ndarray of float64, shape (k,)
        Evidence for the best word over the best one of another ID, in units of ln.
    weakest : ndarray of float64, shape (k,)
        Evidence of the least certain sector for its own bit, in units of ln.
    contradiction : ndarray of float64, shape (k,)
        Evidence of the steps at an unmarked sector for a mark, in units of ln, at the sector
        where it is largest. A spot of light can make a mark as gray as the ground, but hardly up
        to its very edges.
    explained : ndarray of float64, shape (k, 4)
        Share of the steps that are as the word expects: onto unmarked sectors at the inner and
        the outer edge of the band, and onto marked ones at both.
    """

    words: np.ndarray
    start: np.ndarray
    margin: np.ndarray
    weakest: np.ndarray
    contradiction: np.ndarray
    explained: np.ndarray

    @property
    def plausible(self) -> np.ndarray:
        """Whether it is worth a closer look, ndarray of bool, shape (k,)."""
        explained = self.explained.min(axis=1) > _MINIMUM_EXPLAINED
        return (self.margin > _MINIMUM_MARGIN) & (self.weakest > _MINIMUM_WEAKEST) & explained


def sector_angles(family: Family, samples_per_sector: int) -> np.ndarray:
    """Return the angles at which bands are sampled to be decoded, in the order of the sectors.

    Returns
    -------
    ndarray of float64, shape (family.bits * samples_per_sector,)
        rad from +x towards +y, descending: counter-clockwise as seen.
    """
    count = family.bits * samples_per_sector
    return -2 * np.pi * (np.arange(count) + 0.5) / count


def decode(
    samples: BandSamples, evidence: BandEvidence, marks: MarkAppearance, family: Family
) -> Readings:
    """Return the words with the most evidence.

    Parameters
    ----------
    samples : BandSamples
        Of k targets, at the angles of `sector_angles`.
    evidence : BandEvidence
        Of these samples.
    marks : MarkAppearance
    family : Family
    """
    count = evidence.marked.shape[1]
    per_sector = count // family.bits
    words, phases, margin, weakest = best_words(*_by_phase(evidence, per_sector), family)
    sector = (np.arange(count) - phases[:, None]) % count // per_sector
    bits = (words[:, None] >> sector & 1).astype(bool)
    explained = _explained(samples, marks, bits)
    against = np.where(bits, 0, np.maximum(evidence.steps, 0).sum(axis=0))
    contradiction = _of_sectors(against, sector, family.bits).max(axis=1)
    start = 2 * np.pi * phases / count
    return Readings(words, start, margin, weakest, contradiction, explained)


def _by_phase(
    evidence: BandEvidence, per_sector: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the evidence of sectors and of borders for every phase, each (k, phases, bits)."""
    count = evidence.marked.shape[1]
    first = np.arange(per_sector)[:, None] + np.arange(0, count, per_sector)
    angles = (first[..., None] + np.arange(per_sector)) % count
    last = angles[..., -1]
    return evidence.marked[:, angles].sum(axis=3), evidence.onto[:, last], evidence.off[:, last]


def _of_sectors(values: np.ndarray, sector: np.ndarray, bits: int) -> np.ndarray:
    """Return the sums of values (k, angles) over the sectors that they are of, shape (k, bits)."""
    keys = sector + bits * np.arange(len(sector))[:, None]
    sums = np.bincount(keys.ravel(), values.ravel(), bits * len(sector))
    return sums.reshape(len(sector), bits)


def _explained(samples: BandSamples, marks: MarkAppearance, bits: np.ndarray) -> np.ndarray:
    """Return the shares of steps that are as words expect them, shape (k, 4)."""
    agree = []
    for ground, band in samples.edges:
        step = log_ratio(band, ground)
        mark = marks.step(np.maximum(band, ground))
        # Where a mark would make no step, nothing tells it from the ground.
        allowed = _AGREEMENT * np.maximum(np.abs(mark), 1)
        as_mark = (np.abs(step - mark) < allowed) & (np.abs(mark) > _AGREEMENT)
        agree.append(np.where(bits, as_mark, np.abs(step) < _AGREEMENT))
    shares = [
        (of_edge & which).sum(axis=1) / np.maximum(which.sum(axis=1), 1)
        for which in (~bits & samples.visible, bits & samples.visible)
        for of_edge in agree
    ]
    return np.stack(shares, axis=1)
