"""The probability that a reading is right.

There has to be a target, no pattern of light that resembles one, and its word has to be right.
Each is a logistic regression on rendered scenes under all lights, see `fitted_weights`.
`benchmarks.confidence` shows how far the result can be trusted.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.detectors.ring.decoding import Readings
from ahf_ros.detectors.ring.fitted_weights import fitted_weights
from ahf_ros.features.circle_fit import Fit

_MINIMUM_DEVIATION = 0.001  # of edges, below which it says no more, dot radii
_MINIMUM_CONTRAST = 0.25  # of prints; a smaller one speaks no more for a target
_OF_TARGET, _OF_WORD = fitted_weights('confidence', 'target', 'word')

OF_TARGET = len(_OF_TARGET) - 1
"""Number of the features that tell targets from patterns of light; the others tell words."""

FEATURES = OF_TARGET + len(_OF_WORD) - 1 + 4
"""Number of the features that `confidence` weighs."""


def confidence_features(readings: Readings, fit: Fit) -> np.ndarray:
    """Return what tells targets from patterns of light, and right readings from wrong ones.

    Parameters
    ----------
    readings : Readings
    fit : Fit
        Of the frames of the readings to the edges that these expect.

    Returns
    -------
    ndarray of float64, shape (k, FEATURES)
        Of the target: the smaller explained share of the steps onto marks, at the inner and the
        outer edge of the band; the share of the edges in their place; ln of their deviation in dot
        radii; ln of the contrast. Of the word: ln(1 + margin), the contradiction, and the
        explained share of all steps.
    """
    stretches = (readings.hidden & ~np.roll(readings.hidden, 1, axis=1)).sum(axis=1)
    return np.stack(
        [
            readings.explained[:, 2:].min(axis=1),
            fit.share,
            np.log(fit.deviation / fit.size + _MINIMUM_DEVIATION),
            np.log(np.maximum(fit.contrast, _MINIMUM_CONTRAST)),
            np.log1p(np.maximum(readings.margin, 0)),
            readings.contradiction,
            readings.explained.mean(axis=1),
            readings.unexplained,
            readings.hidden.mean(axis=1),
            stretches,
            np.sign(readings.support) * np.log1p(np.abs(readings.support)),
        ],
        axis=1,
    )


def confidence(features: np.ndarray) -> np.ndarray:
    """Return the probabilities that readings are right, shape (k,).

    Parameters
    ----------
    features : ndarray of float, shape (k, FEATURES)
        As `confidence_features` gives them.
    """
    target, word = np.split(features[:, :7], [OF_TARGET], axis=1)
    return _logistic(target, _OF_TARGET) * _logistic(word, _OF_WORD)


def _logistic(features: np.ndarray, weights: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-(weights[0] + features @ weights[1:])))
