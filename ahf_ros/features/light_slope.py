"""The slope of the light along outlines.

A slope of the light moves all edges that it crosses to the same side. A single profile hardly
determines it, but neighbours on an outline see the same light, so that their slopes are smoothed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.features.robust import cauchy, median

_NO_WEIGHT = 1e-9  # instead of a sum of no weights
_UNEVEN = 0.011  # usual error of slopes where light is no slope within a profile, 1/px
_MINIMUM_USUAL = 0.002  # of the errors of slopes, 1/px
_OUTLIER = 3.0  # times the usual error of a slope that halves its weight


@dataclass(frozen=True, slots=True)
class LightSlope:
    """The smoothed slope of the light at n points of outlines, arrays of shape (..., n).

    Attributes
    ----------
    slope : ndarray of float64
        Outwards, as a share of the light, 1/px.
    errors, weights : ndarray of float64
        Of the slopes of the single profiles, 1/px, and their weights.
    totals : ndarray of float64
        Weight that each smoothed slope is made from.
    window : ndarray of float64, shape (n, n)
        What each profile, by row, adds to each smoothed slope.
    """

    slope: np.ndarray
    errors: np.ndarray
    weights: np.ndarray
    totals: np.ndarray
    window: np.ndarray

    def influence(self, of_slopes: np.ndarray) -> np.ndarray:
        """Return what the errors do, given what the smoothed slopes do, shape (k, c, n) both."""
        of_profiles = (of_slopes / self.totals[:, None]).astype(self.window.dtype) @ self.window.T
        return of_profiles * (self.weights * self.errors)[:, None]


def unevenness(errors: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return how much the slopes of k outlines differ from their neighbours, 0 to 1, shape (k,).

    Where slopes differ from profile to profile, light is no slope within a profile, either.

    Parameters
    ----------
    errors, weights : ndarray of float64, shape (k, n)
        Of the slopes of single profiles, 1/px, and how much these count.
    """
    squares = (weights * errors**2).sum(axis=1) / np.maximum(weights.sum(axis=1), _NO_WEIGHT)
    uneven: np.ndarray = np.minimum(squares / _UNEVEN**2, 1)
    return uneven


def common_slope(slopes: np.ndarray, polarity: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the mean slope towards the bright side of edges, shape (k, 1), all others (k, m).

    It is not the light's: the blur is not the fitted step's, or edges were
    sharpened.
    """
    total = np.maximum(weights.sum(axis=1), _NO_WEIGHT)
    return ((weights * polarity * slopes).sum(axis=1) / total)[:, None]


def smooth_slopes(
    slopes: np.ndarray,
    weights: np.ndarray,
    window: np.ndarray,
    prior: np.ndarray | float,
    rounds: int = 2,
) -> LightSlope:
    """Smooth the slopes of profiles along outlines.

    Parameters
    ----------
    slopes, weights : ndarray of float, shape (k, n)
        Of the profiles of k outlines.
    window : ndarray of float, shape (n, n)
        How much each profile, by row, says of the light at each.
    prior : float or ndarray of float, shape (k, 1)
        Weight that says as much as the prior: that there is no slope.
    rounds : int
        In each but the first, outliers among the profiles have lost weight.
    """
    seen = weights > 0
    middle = median(slopes, seen)[:, None]
    usual = np.maximum(median(np.abs(slopes - middle), seen), _MINIMUM_USUAL)[:, None]
    robust = weights
    for _ in range(rounds):
        totals = robust.astype(window.dtype) @ window + prior
        smooth = (robust * slopes).astype(window.dtype) @ window / totals
        errors = slopes - smooth
        used, robust = robust, cauchy(weights, errors / (_OUTLIER * usual))
    return LightSlope(smooth, errors, used, totals, window)
