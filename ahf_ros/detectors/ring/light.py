"""The light on targets: the gray values that ground and marks have under it.

An edge of light and an edge of an object before a target look alike. Light is what both sides of
one of the target's own edges have in common, so only the ground beside the dot and beside marks
says under which light a target lies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.detectors.ring.band_samples import BandSamples
from ahf_ros.detectors.ring.evidence import (
    LEVEL_BIN,
    LEVELS,
    MarkAppearance,
    level_bins,
    log_ratio,
    normal_density,
)
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.imaging.logarithm import LOG_OFFSET

_AGREEMENT = 0.35  # of the step of a mark, between it and a step that confirms the light
_MINIMUM_STEP = 0.5  # of ln, that this is a share of
_UNUSUAL, _MINIMUM_UNUSUAL = 4.0, 0.08  # times the usual deviation of steps, and of ln
_SPREADS = np.array([0.05, 0.065, 0.08, 0.1, 0.12, 0.16, 0.22, 0.3, 0.42])  # of levels of ln I
_MINIMUM_MARK_SPREAD = 0.1  # of marks
_MAXIMUM_SPREAD = 0.12  # of the ground, but for noise
_DEVIATIONS = 2.0  # usual deviations of the ground, that make up a spread
_STEP_SPREAD = 1.33  # spreads of levels, that make up that of a step
_STEP_SPREADS = (0.08, 0.16)
_DISTANCES = np.arange(len(LEVELS))[:, None] - np.arange(len(LEVELS))
_KERNELS = [normal_density(_DISTANCES * LEVEL_BIN, spread) for spread in _SPREADS]


@dataclass(frozen=True, slots=True)
class Light(ArrayRecord):
    """The light on k targets.

    Attributes
    ----------
    ground, marks : ndarray of float64, shape (k, n)
        Densities of n levels of ln I, of the ground and of marks.
    spread : ndarray of float64, shape (k,)
        Standard deviation of steps of ln I on the ground, where there is no edge.
    edges : ndarray of float64, shape (k,)
        Probability that an edge of light lies between two neighbouring readings.
    uneven : ndarray of float64, shape (k,)
        Usual deviation of the ground, of ln.
    """

    ground: np.ndarray
    marks: np.ndarray
    spread: np.ndarray
    edges: np.ndarray
    uneven: np.ndarray


def seen_light(
    samples: BandSamples, marks: MarkAppearance, edges: np.ndarray, noise: np.ndarray
) -> Light:
    """Return the light on targets.

    Parameters
    ----------
    samples : BandSamples
        Of k targets.
    marks : MarkAppearance
    edges : ndarray of float64, shape (k,)
        Probability of an edge of light between two neighbouring readings.
    noise : ndarray of float64, shape (k,)
        Of gray values.
    """
    dark = (marks.polarity > 0)[:, None]
    sides = [(samples.gap[0], samples.dot[1]), *samples.edges]
    agree = [_agrees(ground, inked, marks) for ground, inked in sides]
    agree[0] &= _of_one_light(*sides[0])
    agree[1:] = [agree[1] & agree[2]] * 2
    bright = np.concatenate([np.where(dark, *side) for side in sides], axis=1)
    weights = np.concatenate(agree, axis=1).astype(np.float64)
    levels = np.log(bright + LOG_OFFSET)
    middle = _weighted_median(levels, weights)
    deviation = 1.4826 * _weighted_median(np.abs(levels - middle), weights)[:, 0]
    spread = np.clip(_DEVIATIONS * deviation, _SPREADS[0], _MAXIMUM_SPREAD)
    gray = np.exp(middle[:, 0])
    dark_gray = np.maximum(gray - LOG_OFFSET, 0) * marks.contrast + LOG_OFFSET
    high_spread = np.maximum(spread, noise / gray)
    low_spread = np.maximum(np.maximum(spread, _MINIMUM_MARK_SPREAD), noise / dark_gray)

    seen = level_bins(bright)
    grays = np.broadcast_to(np.exp(LEVELS) - LOG_OFFSET, (len(seen), len(LEVELS)))
    inked = LEVELS - np.abs(marks.step(grays)) - LEVELS[0]
    inked = np.clip(np.rint(inked / LEVEL_BIN).astype(np.intp), 0, len(LEVELS) - 1)
    high = _density(seen, weights, high_spread)
    low = _density(np.take_along_axis(inked, seen, axis=1), weights, low_spread)
    return Light(
        np.where(dark, high, low),
        np.where(dark, low, high),
        np.clip(_STEP_SPREAD * spread, *_STEP_SPREADS),
        edges,
        deviation,
    )


def _agrees(ground: np.ndarray, inked: np.ndarray, marks: MarkAppearance) -> np.ndarray:
    """Return whether the steps from ground to ink are those of marks."""
    expected = marks.step(np.maximum(ground, inked))
    allowed = _AGREEMENT * np.maximum(np.abs(expected), _MINIMUM_STEP)
    return np.abs(log_ratio(inked, ground) - expected) < allowed


def _of_one_light(ground: np.ndarray, inked: np.ndarray) -> np.ndarray:
    """Return whether steps from ground to ink are as usual, so that nothing covers the ground."""
    step = log_ratio(inked, ground)
    off = np.abs(step - np.median(step, axis=1, keepdims=True))
    usual = 1.4826 * np.median(off, axis=1, keepdims=True)
    return off < np.maximum(_UNUSUAL * usual, _MINIMUM_UNUSUAL)


def _weighted_median(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the medians of the values whose weight is not 0, shape (k, 1)."""
    order = np.argsort(np.where(weights > 0, values, np.inf), axis=1)
    count = np.count_nonzero(weights, axis=1)[:, None]
    middle = np.take_along_axis(order, np.maximum(count - 1, 0) // 2, axis=1)
    return np.take_along_axis(values, middle, axis=1)


def _density(seen: np.ndarray, weights: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Return the densities of k sets of bins with a spread each, shape (k, number of levels)."""
    size = len(LEVELS)
    keys = (seen + size * np.arange(len(seen))[:, None]).ravel()
    counts = np.bincount(keys, weights.ravel(), size * len(seen)).reshape(len(seen), size)
    counts = counts / np.maximum(weights.sum(axis=1), 1e-9)[:, None]
    nearest = np.abs(_SPREADS - spread[:, None]).argmin(axis=1)
    density = np.empty_like(counts)
    for index, kernel in enumerate(_KERNELS):
        density[nearest == index] = counts[nearest == index] @ kernel
    return density
