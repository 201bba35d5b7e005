"""Decoding of bands: the code word, phase and rotation with the most evidence.

All valid words compete at all rotations and phases.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.band_evidence import BandEvidence
from ahf_ros.detectors.ring.band_samples import BandSamples
from ahf_ros.detectors.ring.codewords import best_word
from ahf_ros.detectors.ring.evidence import MarkAppearance, log_ratio
from ahf_ros.features.array_record import ArrayRecord

_AGREEMENT = 0.35  # of ln, or of the step of a mark, between a step and what a word expects
_MINIMUM_MARGIN = 3.0  # of a plausible word where light has edges; elsewhere anything else
_FEW_EDGES = 0.05  # probability of an edge of light between neighbours
_MINIMUM_WEAKEST = -60.0  # evidence of a sector, against its bit in a plausible word

MINIMUM_EXPLAINED = 0.25
"""Share of the steps that a plausible word explains."""


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
    support : ndarray of float64, shape (k,)
        The same, of the steps and levels that light and print explain, if nothing is hidden;
        negative where they speak for another ID, by as much as for that one over the next.
    contradiction : ndarray of float64, shape (k,)
        Evidence of the steps at an unmarked sector for a mark, in units of ln, at the sector
        where it is largest. A spot of light can make a mark as gray as the ground, but hardly up
        to its very edges.
    explained : ndarray of float64, shape (k, 4)
        Share of the steps that are as the word expects: onto unmarked sectors at the inner and
        the outer edge of the band, and onto marked ones at both.
    unexplained : ndarray of float64, shape (k,)
        Evidence for arcs of any length over that for the word, in units of ln.
    hidden : ndarray of bool, shape (k, m)
        Whether something hides the band at each angle.
    price : ndarray of float64, shape (k,)
        Evidence that it takes to believe so, beyond the usual, because the light has edges.
    plausible : ndarray of bool, shape (k,)
        Whether it is worth a closer look.
    """

    words: np.ndarray
    start: np.ndarray
    margin: np.ndarray
    support: np.ndarray
    contradiction: np.ndarray
    explained: np.ndarray
    unexplained: np.ndarray
    hidden: np.ndarray
    price: np.ndarray
    plausible: np.ndarray


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
    per_sector = evidence.marked.shape[1] // family.bits
    angles = sectors_by_phase(per_sector, family)
    last, marked = angles[..., -1], evidence.marked[:, angles].sum(axis=3)
    words, phases, margin = best_word(
        marked, evidence.onto[:, last], evidence.off[:, last], family
    )
    bits = bits_at(words, phases, per_sector, family)
    own = sums_of_sectors(np.where(bits, 1, -1) * evidence.marked, phases, family.bits)
    minimum = np.where(evidence.edges < _FEW_EDGES, 0, _MINIMUM_MARGIN)
    explained, contradiction = explanation(
        samples, evidence, marks, words, phases, np.zeros(bits.shape, bool), family
    )
    plausible = (margin > minimum) & (own.min(axis=1) > _MINIMUM_WEAKEST)
    return Readings(
        words,
        2 * np.pi * phases / bits.shape[1],
        margin,
        margin,
        contradiction,
        explained,
        np.zeros(len(words)),
        np.zeros(bits.shape, bool),
        np.zeros(len(words)),
        plausible & (explained.min(axis=1) > MINIMUM_EXPLAINED),
    )


def explanation(
    samples: BandSamples,
    evidence: BandEvidence,
    marks: MarkAppearance,
    words: np.ndarray,
    phases: np.ndarray,
    hidden: np.ndarray,
    family: Family,
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far the steps are as words expect them, where the band is not hidden.

    Parameters
    ----------
    samples, evidence, marks, family
        As for `decode`.
    words, phases : ndarray of int, shape (k,)
    hidden : ndarray of bool, shape (k, m)

    Returns
    -------
    explained : ndarray of float64, shape (k, 4)
    contradiction : ndarray of float64, shape (k,)
        As in `Readings`.
    """
    bits = bits_at(words, phases, hidden.shape[1] // family.bits, family)
    against = np.where(bits | hidden, 0, np.maximum(evidence.steps, 0).sum(axis=0))
    contradiction = sums_of_sectors(against, phases, family.bits).max(axis=1)
    return _explained(samples, marks, bits, ~hidden), contradiction


def sectors_by_phase(per_sector: int, family: Family) -> np.ndarray:
    """Return the indices of the angles of every sector at each phase.

    Returns
    -------
    ndarray of int, shape (per_sector, family.bits, per_sector)
    """
    count = family.bits * per_sector
    first = np.arange(per_sector)[:, None] + np.arange(0, count, per_sector)
    return (first[..., None] + np.arange(per_sector)) % count


def bits_at(words: np.ndarray, phases: np.ndarray, per_sector: int, family: Family) -> np.ndarray:
    """Return whether words have a mark at each angle.

    Parameters
    ----------
    words, phases : ndarray of int, shape (...)
    per_sector : int
        Number of angles of a sector.
    family : Family

    Returns
    -------
    ndarray of bool, shape (..., family.bits * per_sector)
    """
    count = family.bits * per_sector
    sector = (np.arange(count) - phases[..., None]) % count // per_sector
    return (words[..., None] >> sector & 1).astype(bool)


def sums_of_sectors(values: np.ndarray, phases: np.ndarray, bits: int) -> np.ndarray:
    """Return the sums of values (k, angles) over sectors, at phases (k,), shape (k, bits)."""
    count = values.shape[1]
    sector = (np.arange(count) - phases[:, None]) % count // (count // bits)
    keys = sector + bits * np.arange(len(sector))[:, None]
    sums = np.bincount(keys.ravel(), values.ravel(), bits * len(sector))
    return sums.reshape(len(sector), bits)


def _explained(
    samples: BandSamples, marks: MarkAppearance, bits: np.ndarray, seen: np.ndarray
) -> np.ndarray:
    """Return the shares of the steps seen that are as words expect them, shape (k, 4)."""
    agree = []
    for ground, band in samples.edges:
        step = log_ratio(band, ground)
        mark = marks.step(np.maximum(band, ground))
        # Where a mark would make no step, nothing tells it from the ground.
        allowed = _AGREEMENT * np.maximum(np.abs(mark), 1)
        as_mark = (np.abs(step - mark) < allowed) & (np.abs(mark) > _AGREEMENT)
        agree.append(np.where(bits, as_mark, np.abs(step) < _AGREEMENT))
    shares = []
    for which in (~bits & seen, bits & seen):
        for of_edge, visible in zip(agree, samples.visible, strict=True):
            counted = which & visible
            of_all = counted.sum(axis=1)
            share = (of_edge & counted).sum(axis=1) / np.maximum(of_all, 1)
            shares.append(np.where(of_all > 0, share, 1.0))
    return np.stack(shares, axis=1)
