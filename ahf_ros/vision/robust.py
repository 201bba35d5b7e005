"""Robust statistics: medians, and weights that outliers lose.

Cauchy's weight is 1 / (1 + r^2), Geman and McClure's [1]_ is 1 / (1 + r^2)^2, which
leaves less to outliers.

References
----------
.. [1] Geman & McClure, Statistical methods for tomographic image reconstruction, Bull. Int. Stat.
   Inst. LII-4, 1987, 5-21.
"""

from __future__ import annotations

import numpy as np

from ahf_ros import kernels

NORMAL = 1.4826  # standard deviation of normal errors over the median of their sizes
_RIDGE = 1e-3  # added to normal matrices, in weights, so that they can be inverted


def median(values: np.ndarray, selected: np.ndarray, empty: float = 1.0) -> np.ndarray:
    """Return the lower medians, shape (k,), of the selected values of each row, shape (k, m).

    They are `empty` where nothing is selected.
    """
    found: np.ndarray = kernels.selected_medians(values, selected, empty)[0]
    return found


def medians(values: np.ndarray) -> np.ndarray:
    """Return the medians of many short rows, shape (k, m), none of them NaN, shape (k,).

    They are those of `np.median`, which takes far longer to select than vector units to sort.
    """
    ordered, count = np.sort(values, axis=1), values.shape[1]
    return np.asarray((ordered[:, (count - 1) // 2] + ordered[:, count // 2]) / 2)


def quantiles(values: np.ndarray, share: float) -> np.ndarray:
    """Return the quantiles of short rows, shape (k, m), none of them NaN, shape (k,).

    They are those of `np.quantile`, which does far more around it.
    """
    ordered, place = np.sort(values, axis=1), share * (values.shape[1] - 1)
    low, high = ordered[:, int(place)], ordered[:, min(int(place) + 1, values.shape[1] - 1)]
    return np.asarray(low + (place - int(place)) * (high - low))


def spread(sizes: np.ndarray, selected: np.ndarray, minimum: float) -> np.ndarray:
    """Return robust standard deviations, shape (k, 1), from the medians of absolute errors (k, m).

    They are no less than the minimum.
    """
    return np.maximum(NORMAL * median(sizes, selected), minimum)[:, None]


def geman_mcclure_gain(weights: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Return the derivative of an error times Geman and McClure's weight, by the error."""
    squares = errors**2
    return weights * (1 - 3 * squares) / (1 + squares) ** 3


def fit_linear(
    values: np.ndarray, weights: np.ndarray, basis: np.ndarray, scale: float, rounds: int = 4
) -> tuple[np.ndarray, np.ndarray]:
    """Fit linear models to k sets of values, shape (k, m), by iterated reweighting.

    With a basis of shape (m, n), the parameters have the shape (k, n), and their residuals (k, m).
    A value with a residual of `scale` keeps a quarter of its weight, after Geman and McClure.
    """
    prior = np.full(basis.shape[1], _RIDGE)
    parameters, residuals, *_ = kernels.linear_fits(values, weights, basis, prior, scale, rounds)
    return parameters, residuals
