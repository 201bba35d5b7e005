"""The probability that a reading is right.

There has to be a target, no pattern of light that resembles one, and its word has to be right.
Each is a logistic regression on rendered scenes, whose weights are in `fitted_weights.json`.
`benchmarks.dots_confidence` fits them, and shows how far the result can be trusted.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ahf_ros.detectors.dots.reading import Readings
from ahf_ros.features.circle_fit import Fit
from ahf_ros.features.logistic import logistic, read_weights

WEIGHTS = Path(__file__).with_name('fitted_weights.json')
"""The data file of the weights."""

MAXIMUM_SHARE = 0.85
"""Of the steps at disc and border, and of their edges, for a target in good light."""

_MAXIMUM_HEIGHT = 0.5  # beyond which it says no more, of a dot, in the one that the blur leaves it
_MINIMUM_DOUBT = -6.0  # below which it says no more, ln of the odds that a place misleads
_OF_TARGET, _OF_WORD = read_weights(WEIGHTS, 'dots_confidence', 'target', 'word')


def target_features(readings: Readings, fit: Fit) -> np.ndarray:
    """Return what separates targets from other things.

    Parameters
    ----------
    readings : Readings
    fit : Fit
        Of disc and border.

    Returns
    -------
    ndarray of float64, shape (k, 3)
        The share of the steps of ln I at disc and border; the share of the edges in their place;
        the step of the dot that is seen best, in the one that the blur leaves it. All limited.
    """
    return np.stack(
        [
            np.minimum(readings.seen, MAXIMUM_SHARE),
            np.minimum(fit.share, MAXIMUM_SHARE),
            np.clip(readings.height, 0, _MAXIMUM_HEIGHT),
        ],
        axis=1,
    )


def word_features(readings: Readings, fit: Fit) -> np.ndarray:
    """Return what separates right words from wrong ones.

    Parameters
    ----------
    readings : Readings
    fit : Fit

    Returns
    -------
    ndarray of float64, shape (k, 4)
        ln of the odds that the evidence at any one place misleads, limited; then
        `target_features`.
    """
    doubt = np.log(np.exp(-np.abs(readings.evidence)).sum(axis=1))
    return np.column_stack([np.maximum(doubt, _MINIMUM_DOUBT), target_features(readings, fit)])


def target_probability(features: np.ndarray) -> np.ndarray:
    """Return the probabilities that there are targets, shape (k,)."""
    return logistic(features, _OF_TARGET)


def word_probability(features: np.ndarray) -> np.ndarray:
    """Return the probabilities that the words of targets are right, shape (k,).

    They are at most those that no place misleads. The regression alone makes good edges outweigh
    a place that shows little, which they do not: half of the wrong IDs came from that.
    """
    not_misled = 1 / (1 + np.exp(features[:, 0]))
    return np.minimum(logistic(features, _OF_WORD), not_misled)
