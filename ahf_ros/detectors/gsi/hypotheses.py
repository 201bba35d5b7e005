"""Hypotheses on targets: how probable each is, and which of those that contradict each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.gsi import PointFamily
from ahf_ros.detectors.claims import owners
from ahf_ros.detectors.gsi.confidence import FEATURES, SUPPORT, probability
from ahf_ros.detectors.gsi.grouping import Templates
from ahf_ros.detectors.gsi.reading import Readings
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.homography import reference_frames

CERTAIN = 0.95
"""Confidence from which a target is reported."""

OBVIOUS = 0.99
"""Confidence from which a target is not weighed against others in its place."""

_PLAUSIBLE = 0.75  # support of a hypothesis that is followed up
_CLEAR = 0.95  # the same, where only obvious targets are looked for; these have 1
_MAXIMUM = 250  # hypotheses that are followed up, those with the most support
_MISFIT = 0.1  # support that a misfit of 1 of the template costs in the order of these
_EQUAL = 1.0  # distance of the reference points of equal hypotheses, dot radii
_APART = 0.8  # distance of the reference points of different targets, in their reach
_CLEARLY = 0.12  # support by which the better one of two groups that lie closer is better
_SAME = 0.4  # distance of the reference points of the same target in its reach


@dataclass(frozen=True, slots=True)
class Hypotheses(ArrayRecord):
    """k groups of dots, and what they were read as.

    Attributes
    ----------
    homographies : ndarray of float64, shape (k, 3, 3)
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the reference point, px^2.
    polarity : ndarray of int, shape (k,)
    scale : ndarray of float64, shape (k,)
        Radius of the dots in that of the printed design.
    words : ndarray of int64, shape (k,)
        Value of the code.
    features : ndarray of float64, shape (k, 7)
        See `confidence_features`.
    """

    homographies: np.ndarray
    covariance: np.ndarray
    polarity: np.ndarray
    scale: np.ndarray
    words: np.ndarray
    features: np.ndarray

    @property
    def support(self) -> np.ndarray:
        """Support of the code, as in `Readings`, shape (k,)."""
        return self.features[:, SUPPORT]

    @property
    def confidence(self) -> np.ndarray:
        """Probabilities that there is a target with this code, shape (k,)."""
        return probability(self.features)


def no_hypotheses() -> Hypotheses:
    """Return the record of none."""
    nobody = np.zeros(0, int)
    nowhere, unmeasured = np.zeros((0, 3, 3)), np.zeros((0, 2, 2))
    return Hypotheses(
        homographies=nowhere,
        covariance=unmeasured,
        polarity=nobody,
        scale=np.zeros(0),
        words=nobody,
        features=np.zeros((0, FEATURES)),
    )


def plausible(
    templates: Templates, readings: Readings, family: PointFamily, *, obvious: bool
) -> np.ndarray:
    """Return the indices of the groups that are followed up, of equal ones one.

    Parameters
    ----------
    templates : Templates
    readings : Readings
        Of the templates.
    family : PointFamily
    obvious : bool
        Whether only groups that may be obvious targets are followed up. Otherwise so are several
        groups that lie too close for all to be targets.
    """
    rank = readings.support - _MISFIT * templates.misfit
    order = np.argsort(-rank, kind='stable')
    order = order[readings.support[order] >= (_CLEAR if obvious else _PLAUSIBLE)]
    equal = family.template_radii[family.reference] * _EQUAL
    units = reference_frames(templates.homographies[order], float(equal))
    around = reference_frames(templates.homographies[order], family.reach * _APART)
    words, support, centres = readings.words[order], readings.support[order], units[:, :2, 2]

    def rivals(index: int) -> np.ndarray:
        worse = support < support[index] - (0.0 if obvious else _CLEARLY)
        equal = inside(centres, units[[index]]) & (words == words[index])
        return equal | inside(centres, around[[index]]) & worse

    return order[owners(len(order), rivals)][:_MAXIMUM]


def resolve(hypotheses: Hypotheses, family: PointFamily, minimum: float = CERTAIN) -> np.ndarray:
    """Return the indices of the certain hypotheses, of each target and each code the best one.

    Parameters
    ----------
    hypotheses : Hypotheses
    family : PointFamily
    minimum : float
        Of their confidence.
    """
    confidence = hypotheses.confidence
    order = np.argsort(-confidence, kind='stable')
    order = order[confidence[order] >= minimum]
    units = reference_frames(hypotheses.homographies[order], family.reach * _SAME)
    words, at = hypotheses.words[order], units[:, :2, 2]
    return order[owners(len(order), lambda it: inside(at, units[[it]]) | (words == words[it]))]


def inside(points: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return which points lie in at least one of some circles.

    Parameters
    ----------
    points : ndarray of float64, shape (n, 2)
        px.
    frames : ndarray of float64, shape (k, 3, 3)
        Affine, of the circles.
    """
    offset = points - frames[:, None, :2, 2]
    relative = offset @ np.linalg.inv(frames[:, :2, :2]).swapaxes(1, 2)
    return np.asarray(((relative**2).sum(axis=2) < 1).any(axis=0))
