"""Reading the band of ring targets by likelihood, under light that is nowhere even.

Three kinds of evidence that light cannot easily fake together are added:

- arcs: the step across the inner and the outer edge of the band, against the step that a mark
  makes at the gray value found beside it;
- levels: the gray value itself, against those of bright places of the same target, as they are and
  as a mark would turn them;
- borders: the step along the band where two sectors meet, and its absence within them.

All valid words compete at all rotations and phases.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ahf_ros.codes.ring import Family, smallest_rotation
from ahf_ros.detectors.ring.codewords import best_words
from ahf_ros.detectors.ring.evidence import (
    Marks,
    border_evidence,
    level_evidence,
    log_ratio,
    see_light,
    step_evidence,
)
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit

SAMPLES_PER_SECTOR = 10
"""Usual number of angles at which a sector is read."""

ACROSS = 2.6
"""Distance of a reading from an edge, px."""

NEAREST_ACROSS, FARTHEST_ACROSS = 0.13, 0.36
"""Bounds of that distance, dot radii."""

BAND_DEPTHS = (0.3, 0.5, 0.7)
"""Shares of the width of the band, where its level is read."""

GAP_DEPTHS = (0.35, 0.65)
"""Shares of the width of the gap, where its level is read."""

_SOFT, _ACROSS_SOFT = 1.0, 3.0  # blur of an edge, px, from which that distance grows, and how fast
_DOT_DEPTHS = (0.35, 0.7)  # of the dot
_AGREEMENT = 0.35  # of ln, or of the step of a mark, between a step and what a word wants
_CORRELATION = 2.5  # px between independent readings
_LEAST_DEVIATION = 0.001  # dot radii
_LEAST_CONTRAST = 0.25  # of prints; more speaks no more for a target
# Intercepts and weights of `confidence`
_OF_TARGET = np.array([-28.85, 12.31, 16.04, -1.19, -6.95])
_OF_WORD = np.array([-8.64, 2.39, -0.1, 6.31])

OF_TARGET = len(_OF_TARGET) - 1
"""Number of the features that tell targets from patterns of light; the others tell words."""

FEATURES = OF_TARGET + len(_OF_WORD) - 1
"""Number of the features that `confidence` weighs."""


@dataclass(frozen=True, slots=True)
class Readings:
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
        Evidence for a mark in the steps of one unmarked sector that speak for one, in units of
        ln; of the sector where it is largest. A spot of light can make a mark as gray as the
        ground about it, but hardly up to its very edges.
    explained : ndarray of float64, shape (k, 4)
        Share of the steps that are as the word wants them: onto unmarked sectors at the inner and
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
        arcs = self.explained.min(axis=1)
        return (self.margin > 3) & (self.weakest > -60) & (arcs > 0.25)

    def chosen(self, which: np.ndarray) -> Readings:
        """Return some of the readings."""
        return Readings(*(getattr(self, of.name)[which] for of in fields(self)))


def read_bands(
    gray: np.ndarray,
    frames: np.ndarray,
    marks: Marks,
    family: Family,
    samples: int = SAMPLES_PER_SECTOR,
) -> Readings:
    """Read the bands of targets.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, 3, 3)
    marks : Marks
    family : Family
    samples : int
        Angles at which a sector is read.

    Returns
    -------
    Readings
    """
    count = family.bits * samples
    angles = -2 * np.pi * (np.arange(count) + 0.5) / count  # counter-clockwise as seen
    size = frame.mean_radii(frames)
    inner, outer = family.band_inner, family.band_outer
    across = ACROSS + _ACROSS_SOFT * np.maximum(marks.blur - _SOFT, 0)
    across = np.clip(across / size, NEAREST_ACROSS, FARTHEST_ACROSS)[:, None]
    fixed = np.concatenate(
        [
            inner + (outer - inner) * np.array(BAND_DEPTHS),
            1 + (inner - 1) * np.array(GAP_DEPTHS),
            np.array(_DOT_DEPTHS),
        ]
    )
    edges = np.array([inner, inner, outer, outer]) + across * np.array([-1, 1, -1, 1])
    radii = np.concatenate([edges, np.broadcast_to(fixed, (len(frames), len(fixed)))], axis=1)
    values = frame.sample_circles(gray, frames, angles, radii)
    values = np.moveaxis(np.maximum(values, 0), 2, 0)
    gap_in, band_in, band_out, outside = values[:4]
    of_band, of_gap, of_dot = values[4:7], values[7:9], values[9:11]

    arcs = [(gap_in, band_in), (outside, band_out)]
    surround = np.concatenate([of_gap, [gap_in, outside]])
    bright = np.where((marks.signs > 0)[:, None], surround, np.concatenate([of_dot, of_dot]))
    light = see_light(np.moveaxis(bright, 0, 2), of_gap, marks)
    limit = frame.circle_points(angles, np.array([outer + FARTHEST_ACROSS]))[:, 0]
    visible = frame.within(frame.project(frames, limit), gray.shape)
    weight = np.clip(2 * np.pi * inner * size / count / _CORRELATION, 0.08, 1)[:, None] * visible
    steps = [weight * step_evidence(surround, inside, marks, light) for surround, inside in arcs]
    evidence = sum(steps) + weight * level_evidence(of_band, light)
    depth = np.clip((outer - inner) * size / len(of_band) / _CORRELATION, 0.1, 1)[:, None]
    rises, falls = (
        depth * visible * borders for borders in border_evidence(of_band, marks, light)
    )
    words, phases, margin, weakest = best_words(
        *_by_phase(evidence, rises, falls, samples), family
    )

    sector = (np.arange(count) - phases[:, None]) % count // samples
    bits = (words[:, None] >> sector & 1).astype(bool)
    explained = _explained(arcs, marks, bits & visible, ~bits & visible)
    against = np.where(bits, 0, sum(np.maximum(step, 0) for step in steps))
    contradiction = _of_sectors(against, sector, family.bits).max(axis=1)
    start = 2 * np.pi * phases / count
    return Readings(words, start, margin, weakest, contradiction, explained)


def _by_phase(
    marked: np.ndarray, rises: np.ndarray, falls: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the evidence of sectors and of borders for every phase, each (k, phases, bits)."""
    angles = marked.shape[1]
    first = np.arange(count)[:, None] + np.arange(0, angles, count)
    samples = (first[..., None] + np.arange(count)) % angles
    last = samples[..., -1]
    return marked[:, samples].sum(axis=3), rises[:, last], falls[:, last]


def _of_sectors(values: np.ndarray, sector: np.ndarray, bits: int) -> np.ndarray:
    """Return the sums of values (k, angles) over the sectors that they are of, shape (k, bits)."""
    keys = sector + bits * np.arange(len(sector))[:, None]
    sums = np.bincount(keys.ravel(), values.ravel(), bits * len(sector))
    return sums.reshape(len(sector), bits)


def _explained(
    arcs: list[tuple[np.ndarray, np.ndarray]],
    marks: Marks,
    marked: np.ndarray,
    unmarked: np.ndarray,
) -> np.ndarray:
    """Return the shares of steps that are as a word wants them, shape (k, 4)."""
    agree = []
    for surround, values in arcs:
        step = log_ratio(values, surround)
        mark = marks.step(np.maximum(values, surround))
        # Where a mark would make no step, nothing tells it from the surround.
        allowed = _AGREEMENT * np.maximum(np.abs(mark), 1)
        as_mark = (np.abs(step - mark) < allowed) & (np.abs(mark) > _AGREEMENT)
        agree.append(np.where(marked, as_mark, np.abs(step) < _AGREEMENT))
    shares = [
        (of_arc & which).sum(axis=1) / np.maximum(which.sum(axis=1), 1)
        for which in (unmarked, marked)
        for of_arc in agree
    ]
    return np.stack(shares, axis=1)


def confidence_features(readings: Readings, fit: Fit) -> np.ndarray:
    """Return what tells targets from patterns of light, and right readings from wrong ones.

    Parameters
    ----------
    readings : Readings
    fit : Fit
        Of the frames of the readings to the edges that these expect.

    Returns
    -------
    ndarray of float64, shape (k, FEATURES)
        Of the target: the smaller explained share of the steps onto marks, at the inner and the
        outer edge of the band; the share of the edges in their place; ln of their deviation in dot
        radii; ln of the contrast. Of the word: ln(1 + margin), the contradiction, and the
        explained share of all steps.
    """
    deviation = fit.deviation / frame.mean_radii(fit.frames)
    return np.stack(
        [
            readings.explained[:, 2:].min(axis=1),
            fit.share,
            np.log(deviation + _LEAST_DEVIATION),
            np.log(np.maximum(fit.contrast, _LEAST_CONTRAST)),
            np.log1p(np.maximum(readings.margin, 0)),
            readings.contradiction,
            readings.explained.mean(axis=1),
        ],
        axis=1,
    )


def confidence(features: np.ndarray) -> np.ndarray:
    """Return the probabilities that readings with given features are right.

    There has to be a target, no pattern of light that resembles one, and its word has to be right.
    The weights are those of two logistic regressions on rendered scenes under all lights.
    benchmarks/confidence.py fits them anew, and shows how far those in force can be trusted.

    Parameters
    ----------
    features : ndarray of float, shape (k, FEATURES)
        As `confidence_features` gives them.
    """
    target, word = np.split(features, [OF_TARGET], axis=1)
    return _logistic(target, _OF_TARGET) * _logistic(word, _OF_WORD)


def _logistic(features: np.ndarray, weights: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-(weights[0] + features @ weights[1:])))


def canonical(words: np.ndarray, family: Family) -> tuple[np.ndarray, np.ndarray]:
    """Return the code words and IDs of words in any rotation, all of the family."""
    codes = smallest_rotation(words, family.bits)
    return codes, np.searchsorted(family.words, codes) + 1
