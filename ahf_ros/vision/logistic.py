"""Logistic regressions, and the data files that their weights are kept in.

Each set of weights says which command fitted it, from which seeds and at which commit.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

_MAXIMUM_ODDS = 30.0  # log-odds, beyond which a probability changes no more


def logistic(features: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the probabilities of a logistic regression, shape (k,), from features (k, n).

    The weights, shape (n + 1,), are the intercept and those of the features.

    Examples
    --------
    >>> logistic(np.array([[2.0]]), np.array([-2.0, 1.0]))
    array([0.5])
    """
    odds = np.clip(weights[0] + features @ weights[1:], -_MAXIMUM_ODDS, _MAXIMUM_ODDS)
    return probability(odds)


def probability(odds: np.ndarray) -> np.ndarray:
    """Return the probabilities of logarithmic odds, of their shape.

    Examples
    --------
    >>> probability(np.array([0.0, log_odds(np.array(0.9))])).round(3)
    array([0.5, 0.9])
    """
    return np.asarray(1 / (1 + np.exp(-odds)))


def log_odds(shares: np.ndarray) -> np.ndarray:
    """Return the logarithmic odds of probabilities, those of 0 and 1 being -37 and 37."""
    shares = np.clip(shares, 1e-16, 1 - 1e-16)
    return np.asarray(np.log(shares) - np.log1p(-shares))


def read_weights(path: Path, purpose: str, *names: str) -> tuple[np.ndarray, ...]:
    """Return named arrays, float64 of shape (n,), of the set for a purpose in a JSON file."""
    weights = json.loads(path.read_text(encoding='utf-8'))[purpose]
    return tuple(np.array(weights[name], np.float64) for name in names)
