"""Logistic regression on features and their products."""

from __future__ import annotations

import numpy as np

_MAXIMUM = 4.0  # scaled feature; more says no more


def terms(features: np.ndarray, means: np.ndarray, deviations: np.ndarray) -> np.ndarray:
    """Return what a regression weighs: one, scaled features, and their products two by two.

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


def probability(
    features: np.ndarray, means: np.ndarray, deviations: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Return probabilities, ndarray of float64, shape (k,).

    Parameters
    ----------
    features, means, deviations
        As for `terms`.
    weights : ndarray of float, shape ((n + 1) (n + 2) / 2,)
        Of the terms.
    """
    return 1 / (1 + np.exp(-(terms(features, means, deviations) @ weights)))
