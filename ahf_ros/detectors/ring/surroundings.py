"""What the surroundings of dots tell, whatever their words are.

A target has a gap, a band whose two edges agree on where it is marked, and a margin. They tell
middles of targets from other dots also where the band is partly hidden or too dark to be decoded.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.band_samples import sample_bands
from ahf_ros.detectors.ring.evidence import (
    MarkAppearance,
    level_evidence,
    light_levels,
    log_ratio,
    step_evidence,
)
from ahf_ros.detectors.ring.fitted_weights import fitted_weights
from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit
from ahf_ros.features.profiles import USUAL_BLUR
from ahf_ros.features.sampling import sample_circles

MARKED = 7
"""Index of the feature that is the share of angles with a mark."""

_SAMPLES = 5  # angles a sector, unless fewer are enough
_MARGIN = 0.45  # distance from the band at which its margin is read, dot radii
_FAINTEST = 0.9  # gray value of dark over bright
_MINIMUM_CONTRAST = 0.05
_WHOLE_STEP = 0.5  # of the usual step of the dot's edge
_CLEAR = 1.0  # evidence, in units of ln, that is more than noise
_MINIMUM_MARKED = 1.0  # sectors of a band with a mark at both edges
_MAXIMUM = 4.0  # scaled feature; more says no more
_PART = 256  # dots looked at together, which bounds the memory
_MEANS, _DEVIATIONS, _WEIGHTS = fitted_weights('counting', 'means', 'deviations', 'weights')


def designs(families: Sequence[Family]) -> list[Family]:
    """Return the first of the families of each print, whose bands have the same radii."""
    first: dict[tuple[float, float], Family] = {}
    for code in families:
        first.setdefault(code.band, code)
    return list(first.values())


def likely_targets(
    gray: np.ndarray,
    dots: Hypotheses | Fit,
    code: Family,
    blur: float = USUAL_BLUR,
    per_sector: int = _SAMPLES,
) -> np.ndarray:
    """Return the probabilities that dots are the middles of targets of a print, shape (k,).

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    dots : Hypotheses or Fit
        k dots.
    code : Family
        Has the radii of the band.
    blur : float
        Of their edges, px; readings keep away from it.
    per_sector : int
        Angles a sector.
    """
    parts = [np.zeros(0)]
    for start in range(0, len(dots.frames), _PART):
        part = dots.select(slice(start, start + _PART))
        features = target_features(gray, part, code, blur, per_sector)
        # The regression has not seen every kind of dot; a word has at least two marked sectors.
        banded = features[:, MARKED] * code.bits >= _MINIMUM_MARKED
        parts.append(np.where(banded, target_probability(features), 0.0))
    return np.concatenate(parts)


def target_probability(features: np.ndarray) -> np.ndarray:
    """Return the probabilities that dots with given features are the middles of targets.

    The weights are those of a logistic regression on rendered scenes under all lights, see
    `fitted_weights`. `benchmarks.counting` shows how far the counts can be trusted.

    Parameters
    ----------
    features : ndarray of float, shape (k, n)
        As `target_features` gives them.
    """
    return 1 / (1 + np.exp(-(terms(features, _MEANS, _DEVIATIONS) @ _WEIGHTS)))


def terms(features: np.ndarray, means: np.ndarray, deviations: np.ndarray) -> np.ndarray:
    """Return what the regression weighs: one, scaled features, and their products two by two.

    Parameters
    ----------
    features : ndarray of float, shape (k, n)
    means, deviations : ndarray of float, shape (n,)
        Usual value and standard deviation of each.

    Returns
    -------
    ndarray of float64, shape (k, (n + 1) (n + 2) / 2)
        The ones come first.
    """
    scaled = np.clip((features - means) / deviations, -_MAXIMUM, _MAXIMUM)
    factors = np.column_stack([np.ones(len(scaled)), scaled])
    first, second = np.triu_indices(factors.shape[1])
    return factors[:, first] * factors[:, second]


def target_features(
    gray: np.ndarray,
    dots: Hypotheses | Fit,
    code: Family,
    blur: float = USUAL_BLUR,
    per_sector: int = _SAMPLES,
) -> np.ndarray:
    """Return what tells middles of targets from other dots, whatever their words are.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    dots : Hypotheses or Fit
        k dots.
    code : Family
    blur : float
        Of their edges, px; readings keep away from it.
    per_sector : int
        Angles a sector.

    Returns
    -------
    ndarray of float64, shape (k, 10)
        Share of the edges in their place; share of the dot's edge with a whole step; ln of its
        contrast, of its size in px and of its aspect; evidence that gap and margin are free of
        marks; share of the angles at which both edges of the band are those of a mark, and at
        which they contradict each other; evidence that whole sectors are marked or are not.
    """
    angles = 2 * np.pi * np.arange(code.bits * per_sector) / (code.bits * per_sector)
    major, minor, _ = frame.ellipse_axes(dots.frames)
    samples = sample_bands(gray, dots.frames, blur, angles, code)
    margin = np.full_like(samples.beside, code.band_outer + _MARGIN)
    radii = np.concatenate([1 - samples.beside, 1 + samples.beside, margin], axis=1)
    values = sample_circles(gray, dots.frames, angles, radii)
    inside, outside, margin = np.moveaxis(np.maximum(values, 0), 2, 0)

    step = log_ratio(outside, inside)
    marks = seen_marks(inside, outside, step)
    bright = np.where((marks.polarity > 0)[:, None], samples.ground, inside)
    light = light_levels(np.moveaxis(bright, 0, 2), samples.gap, marks)
    visible = samples.visible.all(axis=0)
    seen = np.maximum(visible.sum(axis=1), 1)

    def mean(of_angles: np.ndarray) -> np.ndarray:
        return (of_angles * visible).sum(axis=1) / seen

    def free(*ground: np.ndarray) -> np.ndarray:
        return -mean(level_evidence(np.stack(ground), light))

    at_inner, at_outer = (step_evidence(*edge, marks, light) for edge in samples.edges)
    lower, higher = np.minimum(at_inner, at_outer), np.maximum(at_inner, at_outer)
    band = (at_inner + at_outer + level_evidence(samples.band, light)) * visible
    usual = np.median(np.abs(step), axis=1)[:, None]
    return np.stack(
        [
            dots.share,
            (step * marks.polarity[:, None] > _WHOLE_STEP * usual).mean(axis=1),
            np.log(marks.contrast + _MINIMUM_CONTRAST),
            np.log(np.sqrt(major * minor)),
            np.log(major / minor),
            free(samples.inner_ground, *samples.gap),
            free(samples.outer_ground, margin),
            mean(lower > _CLEAR),
            mean((lower < -_CLEAR) & (higher > _CLEAR)),
            _of_sectors(band, per_sector) / seen,
        ],
        axis=1,
    )


def seen_marks(inside: np.ndarray, outside: np.ndarray, step: np.ndarray) -> MarkAppearance:
    """Return how marks look, from what lies on both sides of the edge of dots.

    Parameters
    ----------
    inside, outside : ndarray of float, shape (k, m)
        Gray values.
    step : ndarray of float, shape (k, m)
        From the inside to the outside, of ln.
    """
    polarity = np.where(_median(step) > 0, 1, -1)
    is_dark = (polarity > 0)[:, None]
    dark, bright = np.where(is_dark, inside, outside), np.where(is_dark, outside, inside)
    contrast = _median(dark / np.maximum(bright, 1))
    blur = np.full(len(polarity), USUAL_BLUR)
    contrast = np.minimum(contrast, _FAINTEST)
    return MarkAppearance(polarity, contrast, _median(bright), blur)


def _median(values: np.ndarray) -> np.ndarray:
    """Return the upper median of each row, which takes less time than the mean of both."""
    middle = values.shape[1] // 2
    medians: np.ndarray = np.partition(values, middle, axis=1)[:, middle]
    return medians


def _of_sectors(evidence: np.ndarray, per_sector: int) -> np.ndarray:
    """Return the sum over sectors of the size of their evidence, at the phase where it is largest.

    Parameters
    ----------
    evidence : ndarray of float, shape (k, sectors * per_sector)
    """
    phases = [np.roll(evidence, phase, axis=1) for phase in range(per_sector)]
    shape = (per_sector, len(evidence), -1, per_sector)
    sectors = np.stack(phases).reshape(shape)
    return np.abs(sectors.sum(axis=3)).sum(axis=2).max(axis=0)
