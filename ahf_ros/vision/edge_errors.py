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

from ahf_ros.vision.logarithm import LOG_OFFSET
from ahf_ros.vision.profiles import CORRELATION, Edges
from ahf_ros.vision.robust import cauchy, median, spread

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
    dark, bright = np.maximum(edges.dark, 0), np.maximum(edges.bright, 0)
    step = np.log((bright + LOG_OFFSET) / (dark + LOG_OFFSET))
    usual = median(step, edges.visible)[:, None]
    seen = edges.visible & (step > _MINIMUM_CONTRAST * usual) & (step > 0)
    ratio = dark / np.maximum(bright, _MINIMUM_BRIGHT)
    contrast = median(ratio, seen)
    errors = np.abs(ratio - contrast[:, None])
    by_ratio = cauchy(1.0, errors / (_RATIO_DOUBT * spread(errors, seen, _MINIMUM_RATIO_ERROR)))
    usual = np.maximum(median(edges.residual, seen), _MINIMUM_RESIDUAL)[:, None]
    excess = np.maximum(edges.residual / usual - 1, 0)
    return EdgeWeights(seen, seen * cauchy(by_ratio, excess / _RESIDUAL_DOUBT), contrast)


@dataclass(frozen=True, slots=True)
class LightSlope:
    """The smoothed slope of the light at m points on the outlines of k targets, shape (k, m)."""

    slope: np.ndarray  # outwards, as a share of the light, 1/px
    errors: np.ndarray  # of the slopes of the single profiles, 1/px
    weights: np.ndarray  # of these
    totals: np.ndarray  # weight that each smoothed slope is made from
    window: np.ndarray  # (n, n), what each profile, by row, adds to each smoothed slope

    def influence(self, of_slopes: np.ndarray) -> np.ndarray:
        """Return what the errors do, given what the smoothed slopes do, shape (k, c, n) both."""
        of_profiles = (of_slopes / self.totals[:, None]).astype(self.window.dtype) @ self.window.T
        return of_profiles * (self.weights * self.errors)[:, None]


def unevenness(errors: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return how much the slopes of k outlines differ from their neighbours, 1/px, shape (k,).

    Where slopes differ from profile to profile, light is no slope within a profile, either. The
    errors of single slopes are 1/px, shape (k, n) as their weights.
    """
    squares = (weights * errors**2).sum(axis=1) / np.maximum(weights.sum(axis=1), NO_WEIGHT)
    return np.sqrt(squares)


def common_slope(slopes: np.ndarray, polarity: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the mean slope towards the bright side of edges, shape (k, 1), all others (k, m).

    It is not the light's: the blur is not the fitted step's, or edges were sharpened.
    """
    total = np.maximum(weights.sum(axis=1), NO_WEIGHT)
    return ((weights * polarity * slopes).sum(axis=1) / total)[:, None]


def smooth_slopes(
    slopes: np.ndarray,
    weights: np.ndarray,
    window: np.ndarray,
    prior: np.ndarray | float,
    rounds: int = 2,
) -> LightSlope:
    """Smooth the slopes of profiles, with weights, both of shape (k, m), along outlines.

    `window`, shape (n, n), says how much each of the n profiles of an outline, by row, tells of
    the light at each. The prior, a number or of shape (k, 1), is the weight that tells as much as
    the belief that there is no slope. In each round but the first, outliers among the profiles
    have lost weight.
    """
    shape = slopes.shape
    slopes, weights = (of.reshape(-1, len(window)) for of in (slopes, weights))
    seen = weights > 0
    middle = median(slopes, seen)[:, None]
    usual = np.maximum(median(np.abs(slopes - middle), seen), _MINIMUM_USUAL)[:, None]
    robust = weights
    for _ in range(rounds):
        totals = robust.astype(window.dtype) @ window + prior
        smooth = (robust * slopes).astype(window.dtype) @ window / totals
        errors = slopes - smooth
        used, robust = robust, cauchy(weights, errors / (_OUTLIER * usual))
    smooth, errors = smooth.reshape(shape), errors.reshape(shape)
    return LightSlope(smooth, errors, used.reshape(shape), totals.reshape(shape), window)


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
    total = np.maximum((errors**2).sum(axis=1), _NO_ERROR)
    growth = np.ones(len(errors))
    for steps in range(1, _DISTURBED + 1):
        same = (outline[steps:] == outline[:-steps]).astype(np.float64)
        products = (errors[:, steps:] * errors[:, :-steps]) @ same
        growth += 2 * (1 - steps / (_DISTURBED + 1)) * products / total
    return np.maximum(growth, 1.0)


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
    distance = np.maximum(spacing / CORRELATION, 1 / _SHARING)
    alike = np.ones_like(distance)
    for steps in range(1, _SHARING):
        alike += 2 * np.maximum(1 - steps * distance, 0)
    squares = (weights**2 * alike).sum(axis=1)
    count = weights.sum(axis=1) ** 2 / np.maximum(squares, NO_WEIGHT)
    shared = np.maximum(squares / np.maximum((weights**2).sum(axis=1), NO_WEIGHT), 1)
    free = count / np.maximum(count - unknowns, 1) * np.maximum(common / shared, 1)
    return free[:, None, None] * ((parts * alike[:, None]) @ parts.transpose(0, 2, 1))
