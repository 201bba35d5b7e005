"""The probability that a reading is right.

There has to be a target, no pattern of light that resembles one, no target of another family; and
its word has to be right, whatever hides a part of it. Rendered scenes under all lights, with
covers, glare, other families and clutter, say how much each feature of a reading tells of that: a
logistic regression on piecewise linear functions, each of which only rises with what speaks for a
reading, so that it holds where no scene was rendered as well. What the features say is one thing
where the light is even and another where it has many edges, so that there are two regressions.
Their probability is multiplied by that of the margin, which is a log likelihood ratio.
`benchmarks.confidence` fits them and shows how far they can be trusted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ahf_ros.detectors.ring.decoding import Readings
from ahf_ros.detectors.ring.fitted_weights import fitted_weights
from ahf_ros.detectors.ring.occlusion import EVEN
from ahf_ros.features.circle_fit import Fit

_MINIMUM_DEVIATION = 0.001  # of edges, below which it says no more, dot radii
_MANY_EDGES = 3.0  # the same, from which it has many edges
_CLEAR_SUPPORT = np.log1p(12.0)  # of a word, if nothing but light lies on it
_ARCS = 2.6  # ln(1 + unexplained), from which arcs of any length are likelier
_MOSTLY_HIDDEN = 0.5  # root of the hidden share, from which little is left to be arcs
_SMALL = 0.35  # difference of both that tells small dots, of which blur makes arcs
_CERTAIN = 0.9  # confidence from which words are reported
_CERTAIN_IN_LIGHT, _CERTAIN_OF_ARCS = 0.7, 0.96  # the same, in light with many edges, and of arcs
_BARELY, _CERTAIN_IF_BARELY = 6.0, 0.99  # support less contradiction, and the same below it
_USUAL_PRICE = 4.0  # of covers, beyond the usual, that halves what is unexplained
_FULL_SIZE = 12.0  # radius of a dot from which evidence grows no more, px


class _Feature(NamedTuple):
    """What a feature is, whether it speaks for a reading or against it, and where it bends."""

    about: str
    sign: int
    knots: tuple[float, ...]


_FEATURES = (
    _Feature('ln(1 + margin)', 1, (0.8, 1.3, 1.8, 2.2, 2.64)),
    _Feature('ln(1 + unexplained)', -1, (0.0, 1.0, 1.8, 2.4, 2.8, 3.2)),
    _Feature('the same, less where light has edges', -1, (0.0, 1.0, 1.8, 2.4, 2.8)),
    _Feature('the same, more where dots are small', -1, (0.0, 1.0, 1.8, 2.4, 2.8, 3.4)),
    _Feature('root of the hidden share of the band', -1, (0.0, 0.2, 0.3, 0.4, 0.5)),
    _Feature('number of hidden stretches', -1, (0.0, 1.0, 2.0)),
    _Feature('explained share of all steps', 1, (0.6, 0.75, 0.85, 0.92, 0.97)),
    _Feature('share of the edges in their place', 1, (0.6, 0.7, 0.8, 0.9, 0.96)),
    _Feature('explained share of the steps onto marks', 1, (0.4, 0.6, 0.75, 0.85, 0.93)),
    _Feature('ln of the deviation of the edges', -1, (-6.0, -5.5, -5.0, -4.5, -4.0)),
    _Feature('ln(1 + contradiction)', -1, (0.0, 0.5, 1.0, 1.5, 2.2)),
    _Feature('ln(1 + support), signed', 1, (-5.0, -2.0, 0.0, 2.0, 3.0, 4.0, 5.0)),
)

FEATURES = len(_FEATURES) + 1
"""Number of the features that `confidence` takes: those it weighs, and the price of covers."""

MARGIN, UNEXPLAINED, IN_LIGHT, IN_SIZE, HIDDEN = range(5)
CONTRADICTION, SUPPORT = 10, 11
"""Places of some of them."""

_INTERCEPTS, *_WEIGHTS = fitted_weights('confidence', 'intercepts', 'even', 'edges')


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
        As `_FEATURES` names them; deviations in dot radii, the share of the steps onto marks the
        smaller one of those at the inner and the outer edge of the band. The last one is the price
        of covers beyond the usual, which is large where the light has many edges.
    """
    unexplained = np.maximum(readings.unexplained, 0)
    in_light = unexplained / (1 + readings.price / _USUAL_PRICE)
    in_size = in_light * np.maximum(_FULL_SIZE / fit.size, 1)
    starts = readings.hidden & ~np.roll(readings.hidden, 1, axis=1)
    return np.stack(
        [
            np.log1p(np.maximum(readings.margin, 0)),
            np.log1p(unexplained),
            np.log1p(in_light),
            np.log1p(in_size),
            np.sqrt(readings.hidden.mean(axis=1)),
            starts.sum(axis=1),
            readings.explained.mean(axis=1),
            fit.share,
            readings.explained[:, 2:].min(axis=1),
            np.log(fit.deviation / fit.size + _MINIMUM_DEVIATION),
            np.log1p(readings.contradiction),
            np.sign(readings.support) * np.log1p(np.abs(readings.support)),
            readings.price,
        ],
        axis=1,
    )


def even(features: np.ndarray) -> np.ndarray:
    """Return whether the light on targets is even, ndarray of bool, shape (k,)."""
    is_even: np.ndarray = features[:, -1] <= EVEN
    return is_even


def minimum_confidence(features: np.ndarray) -> np.ndarray:
    """Return the confidences from which words are reported, ndarray of float64, shape (k,).

    Where light has many edges, and a word is clear if these are all there is, hardly anything else
    looks like that. A word that they support little more than they contradict it is mostly one
    that light made: it has to be more certain. Where a word needs something that hides a part of
    the band, and arcs of any length explain what is left far better, it may as well be no target.

    Parameters
    ----------
    features : ndarray of float, shape (k, FEATURES)
        As `confidence_features` gives them.
    """
    price, hidden = features[:, -1], features[:, HIDDEN]
    many_edges = price > _MANY_EDGES
    in_light = (features[:, SUPPORT] > _CLEAR_SUPPORT) & many_edges
    support = np.sign(features[:, SUPPORT]) * np.expm1(np.abs(features[:, SUPPORT]))
    barely = (support - np.expm1(features[:, CONTRADICTION]) < _BARELY) & many_edges
    like_arcs = even(features) & (features[:, UNEXPLAINED] > _ARCS)
    like_arcs &= (hidden > 0) & (hidden < _MOSTLY_HIDDEN)
    like_arcs &= features[:, IN_SIZE] - features[:, IN_LIGHT] < _SMALL
    minimum = [_CERTAIN_IF_BARELY, _CERTAIN_IN_LIGHT, _CERTAIN_OF_ARCS]
    return np.select([barely, in_light, like_arcs], minimum, _CERTAIN)


def terms(features: np.ndarray) -> np.ndarray:
    """Return what the regressions weigh, each of which speaks for a reading.

    A feature that speaks for it counts up to each knot, one that speaks against it from each on.

    Parameters
    ----------
    features : ndarray of float, shape (k, FEATURES)
        As `confidence_features` gives them.

    Returns
    -------
    ndarray of float64, shape (k, n)
    """
    columns = [
        np.minimum(values, knot) if feature.sign > 0 else -np.maximum(values - knot, 0)
        for feature, values in zip(_FEATURES, features.T[:-1], strict=True)
        for knot in feature.knots
    ]
    return np.stack(columns, axis=1)


def confidence(features: np.ndarray) -> np.ndarray:
    """Return the probabilities that readings are right, shape (k,).

    Parameters
    ----------
    features : ndarray of float, shape (k, FEATURES)
        As `confidence_features` gives them.
    """
    weighed = _INTERCEPTS + terms(features) @ np.stack(_WEIGHTS, axis=1)
    margin = np.expm1(features[:, MARGIN])
    return _logistic(np.where(even(features), *weighed.T)) * _logistic(margin)


def _logistic(evidence: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-evidence))
