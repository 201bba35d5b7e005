"""Confidences as probabilities: how often rings of dots are right that the detector is as sure of.

The detector decides by how sure it is, and states a probability, whose logarithmic odds are fitted
at the `KNOTS` to pictures of three makers where readings begin to fail (Platt [1]_ fits one line).
They are straight between them and rise, so that no decision changes, and are never
higher than the detector is sure, as rendered pictures flatter. Beyond the last knot hardly any
reading is wrong, and the detector is taken at its word, as it is below the first one.
`benchmarks.confidence` fits them, and shows how far they can be trusted.

References
----------
.. [1] Platt, Probabilistic outputs for support vector machines and comparisons to regularized
   likelihood methods, Advances in Large Margin Classifiers, MIT Press, 1999, 61-74.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ahf_ros.base.target import Target, UndecodedTarget
from ahf_ros.vision.logistic import log_odds, probability, read_weights

KNOTS = np.array([0.02, 0.5, 0.95, 0.99])
"""How sure a detector is where its probabilities are fitted, all but the last one."""

WEIGHTS = Path(__file__).with_name('calibration.json')
"""The data file, which says what made it."""

(_VALUES,) = read_weights(WEIGHTS, 'calibration', 'values')
_CURVE = log_odds(np.append(_VALUES, KNOTS[-1]))
_ODDS = log_odds(KNOTS)


def stated(targets: Iterable[Target]) -> list[Target]:
    """Return targets with the probability that their ID, or their likely one, is right.

    Parameters
    ----------
    targets : iterable of Target
        Their confidence is how sure the detector is of the ID, from 0 to 1.
    """
    every = list(targets)
    sure = np.array([it.confidence for it in every])
    probable = _between(sure, _ODDS, _CURVE).tolist()
    return [
        it
        if value == it.confidence or (isinstance(it, UndecodedTarget) and it.reason == 'unread')
        else replace(it, confidence=value)
        for it, value in zip(every, probable, strict=True)
    ]


def sure_of(probable: np.ndarray) -> np.ndarray:
    """Return how sure the detector is of what it states, shape (k,)."""
    return _between(probable, _CURVE, _ODDS)


def _between(shares: np.ndarray, of: np.ndarray, to: np.ndarray) -> np.ndarray:
    odds = log_odds(shares)
    within = (odds > of[0]) & (odds < of[-1])
    return np.where(within, probability(np.interp(odds, of, to)), shares)
