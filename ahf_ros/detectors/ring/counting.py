"""How many coded targets an image shows, where nobody knows it.

Dots are found as the detector `ring` finds them. Which of them are middles of targets is told by
what surrounds them under any light: a gap, a band whose two edges agree on where it is marked, and
a margin. No word has to be read: a target counts also where its band is half hidden or too dark.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.codes.ring import Family, family
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.decoding import (
    ACROSS,
    BAND_DEPTHS,
    FARTHEST_ACROSS,
    GAP_DEPTHS,
    NEAREST_ACROSS,
)
from ahf_ros.detectors.ring.detector import RingDetector
from ahf_ros.detectors.ring.evidence import (
    Marks,
    level_evidence,
    log_ratio,
    see_light,
    step_evidence,
)
from ahf_ros.detectors.ring.hypotheses import Hypotheses, settled_dots
from ahf_ros.features import frame
from ahf_ros.features.profiles import USUAL_BLUR
from ahf_ros.imaging.image import as_gray

_SAMPLES = 5  # angles a sector
_MARGIN = 0.45  # of a place in the margin from the band, dot radii
_FAINTEST = 0.9  # gray value of dark over bright
_LEAST_CONTRAST = 0.05
_CLEAR = 1.0  # evidence, in units of ln, that is more than noise
_WHOLE_STEP = 0.5  # of the usual step of the dot's edge
_LARGEST = 4.0  # scaled feature; more says no more
_MARKED = 7  # the feature that is the share of angles with a mark
_LEAST_MARKED = 1.0  # sectors of a band with a mark at both edges
_COUNTED = 0.75  # probability of being a target, from which a dot counts
# Of `target_probability`; a row of weights holds those of a factor with itself and all after it.
_MEANS = np.array([0.913, 0.977, -0.787, 1.98, 0.168, 3.638, 0.252, 0.039, 0.238, 6.623])
_SPREADS = np.array([0.14, 0.079, 0.279, 0.57, 0.133, 0.757, 0.745, 0.084, 0.1, 1.055])
# fmt: off
_WEIGHTS = np.array([
    -10.77, -0.48, -0.03, -1.15, 0.24, -0.0, -1.47, 3.76, 1.61, -1.67, -1.51,
    -0.38, 0.56, 0.23, -0.1, 0.11, 0.11, 0.39, 0.43, 0.22, -0.04,
    -0.01, -0.65, -0.37, 0.47, 0.03, 0.22, 0.62, -0.25, -0.26,
    -0.23, -0.85, 0.08, 0.28, -0.21, 0.19, 0.11, 0.51,
    -0.83, 0.16, 0.31, -0.08, 0.11, -0.28, -0.01,
    0.02, -0.21, -0.5, -0.1, -0.05, 0.42,
    -0.52, 0.56, -1.14, -0.07, 0.18,
    -0.23, 0.31, 0.31, -0.03,
    0.35, 0.1, 0.61,
    -0.08, -0.33,
    -0.24,
])
# fmt: on


def estimate_count(image: np.ndarray, settings: DetectorSettings | None = None) -> int:
    """Estimate how many coded targets an image shows.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
        As received.
    settings : DetectorSettings, optional
        Proportions, colour and sizes of the targets; the defaults where None.

    Returns
    -------
    int
        At least 0; the same for the same image.

    Raises
    ------
    ValueError
        If the image is not accepted.
    """
    wanted = settings or DetectorSettings()
    code = family(wanted.family)
    found = RingDetector(wanted).hypotheses(image)
    major, _, _ = frame.ellipse_axes(found.frames)
    found = found.chosen((major >= wanted.min_radius) & (major <= wanted.max_radius))
    features = target_features(as_gray(image).astype(np.float32, copy=False), found, code)
    probability = target_probability(features)
    # No regression knows all dots that have no band; every word has two marked sectors at least.
    banded = features[:, _MARKED] * code.bits >= _LEAST_MARKED
    best_first = np.argsort(-probability, kind='stable')
    targets = found.chosen(best_first[(banded & (probability >= _COUNTED))[best_first]])
    count = len(targets.words)
    distinct, _ = settled_dots(targets, np.zeros(count), np.ones(count, bool), code)
    return len(distinct)


def target_probability(features: np.ndarray) -> np.ndarray:
    """Return the probabilities that dots with given features are the middles of targets.

    The weights are those of a logistic regression on rendered scenes under all lights.
    benchmarks/counting.py fits them anew, and shows how far the counts can be trusted.

    Parameters
    ----------
    features : ndarray of float, shape (k, n)
        As `target_features` gives them.
    """
    return 1 / (1 + np.exp(-(terms(features, _MEANS, _SPREADS) @ _WEIGHTS)))


def terms(features: np.ndarray, means: np.ndarray, spreads: np.ndarray) -> np.ndarray:
    """Return what the regression weighs: one, scaled features, and their products two by two.

    Parameters
    ----------
    features : ndarray of float, shape (k, n)
    means, spreads : ndarray of float, shape (n,)
        Usual value and standard deviation of each.

    Returns
    -------
    ndarray of float64, shape (k, (n + 1) (n + 2) / 2)
        The ones come first.
    """
    scaled = np.clip((features - means) / spreads, -_LARGEST, _LARGEST)
    factors = np.column_stack([np.ones(len(scaled)), scaled])
    first, second = np.triu_indices(factors.shape[1])
    return factors[:, first] * factors[:, second]


def target_features(gray: np.ndarray, found: Hypotheses, code: Family) -> np.ndarray:
    """Return what tells middles of targets from other dots, whatever their words are.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    found : Hypotheses
        k dots.
    code : Family

    Returns
    -------
    ndarray of float64, shape (k, 10)
        Share of the edges in their place; share of the dot's edge with a whole step; ln of its
        contrast, of its size in px and of its aspect; evidence that gap and margin are free of
        marks; share of the angles at which both edges of the band are those of a mark, and at
        which they contradict each other; evidence that whole sectors are marked or are not.
    """
    angles = 2 * np.pi * np.arange(code.bits * _SAMPLES) / (code.bits * _SAMPLES)
    major, minor, _ = frame.ellipse_axes(found.frames)
    size = np.sqrt(major * minor)
    inner, outer = code.band_inner, code.band_outer
    across = np.clip(ACROSS / size, NEAREST_ACROSS, FARTHEST_ACROSS)[:, None]
    beside = np.array([1, 1, inner, inner, outer, outer]) + across * np.array([-1, 1] * 3)
    depths = np.concatenate(
        [
            1 + (inner - 1) * np.array(GAP_DEPTHS),
            inner + (outer - inner) * np.array(BAND_DEPTHS),
            [outer + _MARGIN],
        ]
    )
    radii = np.concatenate([beside, np.broadcast_to(depths, (len(size), len(depths)))], axis=1)
    values = frame.sample_circles(gray, found.frames, angles, radii)
    values = np.moveaxis(np.maximum(values, 0), 2, 0)
    dot, around, gap_in, band_in, band_out, outside = values[:6]
    of_gap, of_band, margin = values[6:8], values[8:11], values[11]

    step = log_ratio(around, dot)
    marks = _marks(dot, around, step)
    dark = (marks.signs > 0)[:, None]
    bright = np.where(dark, np.stack([*of_gap, gap_in, outside]), dot)
    light = see_light(np.moveaxis(bright, 0, 2), of_gap, marks)
    limit = frame.circle_points(angles, np.array([outer + FARTHEST_ACROSS]))[:, 0]
    visible = frame.within(frame.project(found.frames, limit), gray.shape)

    def mean(of_angles: np.ndarray) -> np.ndarray:
        return (of_angles * visible).sum(axis=1) / np.maximum(visible.sum(axis=1), 1)

    at_inner = step_evidence(gap_in, band_in, marks, light)
    at_outer = step_evidence(outside, band_out, marks, light)
    least, most = np.minimum(at_inner, at_outer), np.maximum(at_inner, at_outer)
    band = (at_inner + at_outer + level_evidence(of_band, light)) * visible
    usual = np.median(np.abs(step), axis=1)[:, None]
    return np.stack(
        [
            found.share,
            (step * marks.signs[:, None] > _WHOLE_STEP * usual).mean(axis=1),
            np.log(marks.contrast + _LEAST_CONTRAST),
            np.log(size),
            np.log(major / minor),
            -mean(level_evidence(np.stack([gap_in, *of_gap]), light)),
            -mean(level_evidence(np.stack([outside, margin]), light)),
            mean(least > _CLEAR),
            mean((least < -_CLEAR) & (most > _CLEAR)),
            _of_sectors(band) / np.maximum(visible.sum(axis=1), 1),
        ],
        axis=1,
    )


def _marks(dot: np.ndarray, around: np.ndarray, step: np.ndarray) -> Marks:
    """Return how marks look, from the gray values on both sides of the edge of dots."""
    signs = np.where(np.median(step, axis=1) > 0, 1, -1)
    dark_dot = (signs > 0)[:, None]
    dark, bright = np.where(dark_dot, dot, around), np.where(dark_dot, around, dot)
    contrast = np.median(dark / np.maximum(bright, 1), axis=1)
    usual = np.median(bright, axis=1)
    blur = np.full(len(signs), USUAL_BLUR)
    return Marks(signs, np.minimum(contrast, _FAINTEST), usual, blur)


def _of_sectors(evidence: np.ndarray) -> np.ndarray:
    """Return the sum over sectors of the size of their evidence, at the phase where it is largest.

    Parameters
    ----------
    evidence : ndarray of float, shape (k, sectors * _SAMPLES)
    """
    phases = [np.roll(evidence, phase, axis=1) for phase in range(_SAMPLES)]
    shape = (_SAMPLES, len(evidence), evidence.shape[1] // _SAMPLES, _SAMPLES)
    sectors = np.stack(phases).reshape(shape)
    return np.abs(sectors.sum(axis=3)).sum(axis=2).max(axis=0)
