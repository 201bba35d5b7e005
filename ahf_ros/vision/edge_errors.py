"""Errors of measured edges: edges that are not a target's, slopes of light, errors in common.

Edges of light that cross a target do not look like its own: the gray values beside them have
another ratio, or the profile is not a step. A slope of the light moves all edges that it crosses
to the same side. A single profile hardly determines it, but neighbours on an outline see the same
light, so that their slopes are smoothed. Neighbours have errors in common, too, which make the
covariance of a centre larger than that of as many independent edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros import kernels
from ahf_ros.vision.logarithm import LOG_OFFSET
from ahf_ros.vision.profiles import CORRELATION, Edges
from ahf_ros.vision.robust import NORMAL

NO_WEIGHT = 1e-9
"""Divisor instead of a sum of no weights."""

_MINIMUM_CONTRAST = 0.3  # of an edge, in steps of ln of the usual edge of the target
_RATIO_DOUBT = 1.5  # times the usual error of the ratio of the levels that halves the weight
_MINIMUM_RATIO_ERROR = 0.01  # that counts as usual
_RESIDUAL_DOUBT = 0.4  # times the usual residual, on top of it, that halves the weight
_MINIMUM_RESIDUAL = 0.3  # that counts as usual, gray values
_MINIMUM_BRIGHT = 1.0  # gray value that ratios are taken to
_MINIMUM_USUAL = 0.002  # of the errors of slopes, 1/px
_OUTLIER = 3.0  # times the usual error of a slope that halves its weight
_SHARING = 10  # of an edge that may share pixels with it, to either side
_DISTURBED = 6  # of an edge that light may disturb together with it, to either side
_NO_ERROR = 1e-12  # instead of a sum of squares that is zero


@dataclass(frozen=True, slots=True)
class EdgeWeights:
    """How much the edges of k targets at m points each look like edges of targets."""

    seen: np.ndarray  # bool, (k, m), whether there is an edge of about the usual height
    weights: np.ndarray  # (k, m), 0 to 1, by the ratio of its levels and by how much it is a step
    contrast: np.ndarray  # (k,), usual gray value of the dark side over that of the bright side


def weigh_edges(edges: Edges) -> EdgeWeights:
    """Separate edges of targets from edges of light, by the usual edge of each target."""
    of_ratio = NORMAL, _MINIMUM_CONTRAST, _RATIO_DOUBT, _MINIMUM_RATIO_ERROR
    of_residual = _RESIDUAL_DOUBT, _MINIMUM_RESIDUAL, _MINIMUM_BRIGHT
    measured = edges.dark, edges.bright, edges.residual, edges.visible
    return EdgeWeights(*kernels.edge_weights(*measured, LOG_OFFSET, *of_ratio, *of_residual)[:3])


@dataclass(frozen=True, slots=True)
class LightSlope:
    """The smoothed slope of the light at m points on the outlines of k targets, shape (k, m)."""

    errors: np.ndarray  # of the slopes of the single profiles, 1/px
    slope: np.ndarray  # outwards, as a share of the light, 1/px
    weights: np.ndarray  # of the single profiles
    totals: np.ndarray  # weight that each smoothed slope is made from


def unevenness(errors: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return how much the slopes of k outlines differ from their neighbours, 1/px, shape (k,).

    Where slopes differ from profile to profile, light is no slope within a profile, either. The
    errors of single slopes are 1/px, shape (k, n) as their weights.
    """
    squares = (weights * errors**2).sum(axis=1) / np.maximum(weights.sum(axis=1), NO_WEIGHT)
    return np.sqrt(squares)


def smooth_slopes(
    edges: Edges,
    polarity: np.ndarray,
    weights: np.ndarray,
    window: np.ndarray,
    prior: np.ndarray,
    sharpened: float,
    rounds: int,
) -> LightSlope:
    """Smooth slopes of profiles along outlines, by weights of shape (k, m) as the polarity.

    The mean slope towards the bright side is not the light's: the blur is not the fitted step's,
    or edges were sharpened. `window`, float32, shape (n, n), says how much each of the n profiles
    of an outline, by row, tells of the light at each. The prior, shape (k,), is the weight that
    tells as much as the belief that there is no slope, or four times as much where the mean one is
    `sharpened`, 1/px. In each round but the first, outliers among the profiles have lost weight.
    """
    count, points = shape = polarity.shape
    of_lines = count, points // len(window), len(window)
    lines = (of.reshape(of_lines) for of in (edges.slope, polarity, weights))
    numbers = sharpened, _MINIMUM_USUAL, _OUTLIER, rounds, NO_WEIGHT
    smooth = kernels.light_slopes(*lines, window, prior, *numbers)[:4]
    return LightSlope(*[of.reshape(shape) for of in smooth])


def grouped_covariance(normals: np.ndarray, sums: np.ndarray) -> np.ndarray:
    """Return the covariances of the first two unknowns, from errors that come in groups.

    Normal matrices have the shape (k, m, m). What the weighted errors of each group add to the
    right sides has the shape (k, m, n), 0 for a group that is not seen. Within a group, errors
    may have anything in common [1]_.

    References
    ----------
    .. [1] Liang & Zeger, Longitudinal data analysis using generalized linear models, Biometrika
       73(1), 1986, 13-22.
    """
    some = np.linalg.inv(normals)[:, :2] @ sums
    count = (sums != 0).any(axis=1).sum(axis=1)
    freedom = (count / np.maximum(count - normals.shape[1], 1)) ** 2
    return np.asarray(freedom[:, None, None] * (some @ np.swapaxes(some, 1, 2)))


def common_errors(errors: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Return by how much the variance of a centre grows as neighbours have errors in common.

    Edges of light disturb several neighbours at once. The autocorrelation of the errors along
    their outline tells how far, with the weights of Newey and West (Econometrica 55, 1987). The
    errors, shape (k, m), are weighted; `outline`, shape (m,), is equal for neighbours on the same
    one. The growth, shape (k,), is at least 1.

    Examples
    --------
    >>> outline = np.zeros(100)
    >>> alternating, pairs = np.resize([1.0, -1], 100), np.resize([1.0, 1, -1, -1], 100)
    >>> common_errors(np.stack([alternating, pairs, np.ones(100)]), outline).round(1)
    array([1. , 1. , 6.8])
    """
    growth: np.ndarray = kernels.errors_in_common(errors, outline, _DISTURBED, _NO_ERROR)
    return growth


def edge_covariance(
    parts: np.ndarray,
    weights: np.ndarray,
    spacing: np.ndarray,
    unknowns: int,
    common: np.ndarray,
) -> np.ndarray:
    """Return the covariance of centres, shape (k, 2, 2), from what the error of each edge does.

    `parts`, shape (k, 2, m), is what each error does to the centre; the edges have weights and
    distances to the next along the outline, px, both of shape (k, m). Neighbours closer than
    `CORRELATION` share pixels, so that their errors are alike. Their products are not taken as
    they are: a fit of some unknowns leaves little of what they have in common. The growth by
    `common_errors`, shape (k,), counts where it is more than shared pixels explain.
    """
    of_errors = parts, weights, spacing, unknowns, common
    covariance: np.ndarray = kernels.edge_covariances(*of_errors, CORRELATION, _SHARING, NO_WEIGHT)
    return covariance
