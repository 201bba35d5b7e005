"""The probability that a target is what it was read as: a logistic regression.

The weights are in `fitted_weights.json`, which says what made them. `benchmarks.gsi_confidence`
fits them, and shows how far the result can be trusted.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ahf_ros.codes.gsi import PointFamily
from ahf_ros.detectors.gsi.reading import Readings
from ahf_ros.detectors.gsi.refinement import Placement
from ahf_ros.features.frame import ellipse_axes
from ahf_ros.features.homography import reference_frames
from ahf_ros.features.logistic import logistic, read_weights

WEIGHTS = Path(__file__).with_name('fitted_weights.json')
"""The data file."""

FEATURES = 7
"""What the probability depends on, see `confidence_features`."""

SUPPORT = 0
"""Which of these is the support."""

_UNEVEN = (0.005, 0.05)  # difference of radii that counts as 1, in ln: of any dot, and in px
_PERSPECTIVE = 0.08  # change of depth from the centre to the edge of a target, that counts as 1
_MOST = 6.0  # of both

(_OF_TARGET,) = read_weights(WEIGHTS, 'gsi_confidence', 'weights')


def confidence_features(
    placement: Placement, readings: Readings, family: PointFamily
) -> np.ndarray:
    """Return what tells targets from chance arrangements, and right codes from wrong ones.

    Parameters
    ----------
    placement : Placement
        Of k hypotheses.
    readings : Readings
        At the places where it puts them.
    family : PointFamily

    Returns
    -------
    ndarray of float64, shape (k, 7)
        Support, weakest dot and margin of the reading; the misplacement; the differences of the
        radii of dots, and the perspective, both up to a bound; and the share of the dots whose
        edges were found where they should be.
    """
    radius = float(family.template_radii[family.reference])
    minor = ellipse_axes(reference_frames(placement.homographies, radius))[1] * placement.scale
    always, of_pixel = _UNEVEN
    uneven = placement.unevenness / (always + of_pixel / np.maximum(minor, 0.1))
    perspective = placement.homographies[:, 2, :2] * family.reach / _PERSPECTIVE
    return np.stack(
        [
            readings.support,
            readings.weakest,
            readings.margin,
            placement.misplacement,
            np.minimum(uneven, _MOST),
            np.minimum(np.hypot(*perspective.T), _MOST),
            placement.share,
        ],
        axis=1,
    )


def probability(features: np.ndarray) -> np.ndarray:
    """Return the probabilities that hypotheses are right, shape (k,).

    Parameters
    ----------
    features : ndarray of float64, shape (k, 7)
        As `confidence_features` gives them.
    """
    return logistic(features, _OF_TARGET)
