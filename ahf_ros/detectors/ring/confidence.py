"""The probability that a reading is right.

There has to be a target, no pattern of light that resembles one, no target of another family; and
its word has to be right, whatever hides a part of it. A logistic regression on rendered scenes
under all lights, with covers, glare, other families and clutter, weighs what tells so; see
`fitted_weights`. `benchmarks.confidence` shows how far the result can be trusted.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.detectors.ring.decoding import Readings
from ahf_ros.detectors.ring.fitted_weights import fitted_weights
from ahf_ros.detectors.ring.regression import probability
from ahf_ros.features.circle_fit import Fit

_MINIMUM_DEVIATION = 0.001  # of edges, below which it says no more, dot radii
_MANY = 3  # hidden stretches; more say no more
_MINIMUM_MARGIN = 1.0  # below which a word is no better than another one
_REGRESSION = fitted_weights('confidence', 'means', 'deviations', 'weights')

FEATURES = len(_REGRESSION[0])
"""Number of the features that `confidence` weighs."""

MARGIN = 0
"""The feature that is ln(1 + margin)."""


def confidence_features(readings: Readings, fit: Fit) -> np.ndarray:
    """Return what tells right readings from others.

    Parameters
    ----------
    readings : Readings
    fit : Fit
        Of the frames of the readings to the edges that these expect.

    Returns
    -------
    ndarray of float64, shape (k, FEATURES)
        ln(1 + margin); ln(1 + what is unexplained); the root of the hidden share of the band; the
        explained share of all steps; the share of the edges in their place; the smaller explained
        share of the steps onto marks, at the inner and the outer edge of the band; ln of the
        deviation of the edges in dot radii; ln(1 + contradiction); the support, signed, as
        ln(1 + its size); ln of the size in px; ln(1 + the price of covers); the number
        of hidden stretches.
    """
    stretches = (readings.hidden & ~np.roll(readings.hidden, 1, axis=1)).sum(axis=1)
    return np.stack(
        [
            np.log1p(np.maximum(readings.margin, 0)),
            np.log1p(np.maximum(readings.unexplained, 0)),
            np.sqrt(readings.hidden.mean(axis=1)),
            readings.explained.mean(axis=1),
            fit.share,
            readings.explained[:, 2:].min(axis=1),
            np.log(fit.deviation / fit.size + _MINIMUM_DEVIATION),
            np.log1p(readings.contradiction),
            np.sign(readings.support) * np.log1p(np.abs(readings.support)),
            np.log(fit.size),
            np.log1p(readings.price),
            np.minimum(stretches, _MANY),
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
    only = features[:, MARGIN] > np.log1p(_MINIMUM_MARGIN)
    return np.where(only, probability(features, *_REGRESSION), 0.0)
