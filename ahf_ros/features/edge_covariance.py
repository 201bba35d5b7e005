"""Covariances of centres that are fitted to edges, whose errors neighbours have in common."""

from __future__ import annotations

import numpy as np

from ahf_ros.features.profiles import CORRELATION

_SHARING = 10  # of an edge that may share pixels with it, to either side
_DISTURBED = 6  # of an edge that light may disturb together with it, to either side
_NO_WEIGHT = 1e-9  # instead of a sum of no weights
_NO_ERROR = 1e-12  # instead of a sum of squares that is zero


def common_errors(errors: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Return by how much the variance of a centre grows as neighbours have errors in common.

    Edges of light disturb several neighbours at once. The autocorrelation of the errors along
    their outline tells how far, with the weights of Newey and West (Econometrica 55, 1987).

    Parameters
    ----------
    errors : ndarray of float64, shape (k, m)
        Weighted; 0 where there is none.
    outline : ndarray of float64, shape (m,)
        Equal for neighbours on the same outline.

    Returns
    -------
    ndarray of float64, shape (k,)
        At least 1.

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
    """Return the covariance of centres from what the error of each edge does to them.

    Neighbours closer than `CORRELATION` share pixels, so that their errors are alike. Their
    products are not taken as they are: a fit leaves little of what they have in common.

    Parameters
    ----------
    parts : ndarray of float64, shape (k, 2, m)
        What the error of each edge does to the centre.
    weights, spacing : ndarray of float64, shape (k, m)
        Of the edges, and the distance from one to the next along the outline, px.
    unknowns : int
        Number of unknowns of the fit.
    common : ndarray of float64, shape (k,)
        As `common_errors` gives it; it counts where it is more than shared pixels explain.

    Returns
    -------
    ndarray of float64, shape (k, 2, 2)
        In the squared unit of `parts`.
    """
    distance = np.maximum(spacing / CORRELATION, 1 / _SHARING)
    alike = np.ones_like(distance)
    for steps in range(1, _SHARING):
        alike += 2 * np.maximum(1 - steps * distance, 0)
    squares = (weights**2 * alike).sum(axis=1)
    count = weights.sum(axis=1) ** 2 / np.maximum(squares, _NO_WEIGHT)
    shared = np.maximum(squares / np.maximum((weights**2).sum(axis=1), _NO_WEIGHT), 1)
    free = count / np.maximum(count - unknowns, 1) * np.maximum(common / shared, 1)
    return free[:, None, None] * ((parts * alike[:, None]) @ parts.transpose(0, 2, 1))
