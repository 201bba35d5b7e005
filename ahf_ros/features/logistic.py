"""Logistic regressions, and the data files that their weights are kept in.

Each set of weights says which command fitted it, from which seeds and at which commit.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

_MAXIMUM_ODDS = 30.0  # log-odds, beyond which a probability changes no more


def logistic(features: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the probabilities of a logistic regression, shape (k,).

    Parameters
    ----------
    features : ndarray of float, shape (k, n)
    weights : ndarray of float, shape (n + 1,)
        The intercept, and the weights of the features.

    Examples
    --------
    >>> logistic(np.array([[2.0]]), np.array([-2.0, 1.0]))
    array([0.5])
    """
    odds = np.clip(weights[0] + features @ weights[1:], -_MAXIMUM_ODDS, _MAXIMUM_ODDS)
    probabilities: np.ndarray = 1 / (1 + np.exp(-odds))
    return probabilities


def read_weights(path: Path, purpose: str, *names: str) -> tuple[np.ndarray, ...]:
    """Return arrays of one set of a data file, each ndarray of float64, shape (n,).

    Parameters
    ----------
    path : Path
        JSON.
    purpose : str
        Name of the set.
    *names : str
        Names of the arrays.
    """
    weights = json.loads(path.read_text(encoding='utf-8'))[purpose]
    return tuple(np.array(weights[name], np.float64) for name in names)
