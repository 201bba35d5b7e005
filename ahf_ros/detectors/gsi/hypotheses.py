"""Hypotheses on targets: how probable each is, and which of those that contradict each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.gsi import PointFamily
from ahf_ros.detectors.gsi.grouping import Templates
from ahf_ros.detectors.gsi.reading import Readings
from ahf_ros.detectors.gsi.refinement import Placement
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.frame import ellipse_axes
from ahf_ros.features.homography import local_frames

CERTAIN = 0.99
"""Confidence from which a target is reported."""

_PLAUSIBLE = 0.75  # support of a hypothesis that is followed up
_MAXIMUM = 250  # hypotheses that are followed up, those with the most support
_MISFIT = 0.1  # support that a misfit of 1 of the template costs in the order of these
_EQUAL = 1.0  # distance of the reference points of equal hypotheses, dot radii
_SAME = 0.4  # distance of the reference points of the same target in its reach
_WEIGHTS = (-33.0, 30.0, 0.5, 0.8)  # of 1, support, weakest dot and margin, see benchmarks.gsi
_GROWTH = (0.03, 0.4, 0.15)  # that is usual: of any dot, of the minor axis in px, of its 4th power
_EXCESS = 0.02  # of growth, that costs 1
_SHARE, _UNSEEN = 0.8, 30.0  # of dots whose edges are found, and what less costs
_PERSPECTIVE = 0.08  # change of depth from the centre to the edge of a target, that costs 1
_MEASURABLE = 2.0  # semi-minor axis of dots whose edges can be found, px


@dataclass(frozen=True, slots=True)
class Hypotheses(ArrayRecord):
    """k groups of dots, and what they were read as.

    Attributes
    ----------
    homographies : ndarray of float64, shape (k, 3, 3)
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the reference point, px^2.
    polarity : ndarray of int, shape (k,)
    words : ndarray of int64, shape (k,)
        Value of the code.
    log_odds : ndarray of float64, shape (k,)
        ln of the probability that there is a target with this code over that there is not.
    """

    homographies: np.ndarray
    covariance: np.ndarray
    polarity: np.ndarray
    words: np.ndarray
    log_odds: np.ndarray

    @property
    def confidence(self) -> np.ndarray:
        """Probabilities that there is a target with this code, shape (k,)."""
        probability: np.ndarray = 1 / (1 + np.exp(-np.clip(self.log_odds, -30, 30)))
        return probability


def plausible(templates: Templates, readings: Readings, family: PointFamily) -> np.ndarray:
    """Return the indices of the groups that are followed up, of equal ones one.

    Parameters
    ----------
    templates : Templates
    readings : Readings
        Of the templates.
    family : PointFamily
    """
    rank = readings.support - _MISFIT * templates.misfit
    order = np.argsort(-rank, kind='stable')
    order = order[readings.support[order] >= _PLAUSIBLE]
    radius = family.template_radii[family.reference] * _EQUAL
    units = _reference_frames(templates.homographies[order], radius)
    free = np.ones(len(order), bool)
    words, kept = readings.words[order], []
    for position in range(len(order)):
        if free[position]:
            kept.append(position)
            near = _within(units, position) & (words == words[position])
            free &= ~near
            if len(kept) == _MAXIMUM:
                break
    return order[kept]


def judge(
    polarity: np.ndarray, placement: Placement, readings: Readings, family: PointFamily
) -> Hypotheses:
    """Return hypotheses with their log-odds.

    Parameters
    ----------
    polarity : ndarray of int, shape (k,)
    placement : Placement
    readings : Readings
        At the places where it puts them.
    family : PointFamily
    """
    features = [np.ones(len(polarity)), readings.support, readings.weakest, readings.margin]
    odds = np.stack(features, axis=1) @ _WEIGHTS
    radius = float(family.template_radii[family.reference])
    frames = _reference_frames(placement.homographies, radius)
    minor = np.maximum(ellipse_axes(frames)[1], 0.1)
    odds -= placement.misplacement
    always, linear, steep = _GROWTH
    usual = always + linear / minor + steep / minor**4
    odds -= (np.maximum(np.abs(placement.growth) - usual, 0) / _EXCESS) ** 2
    perspective = placement.homographies[:, 2, :2] * family.reach / _PERSPECTIVE
    odds -= (perspective**2).sum(axis=1)
    missing = np.maximum(_SHARE - placement.share, 0)
    odds -= np.where(minor >= _MEASURABLE, _UNSEEN * missing, 0.0)
    return Hypotheses(placement.homographies, placement.covariance, polarity, readings.words, odds)


def resolve(hypotheses: Hypotheses, family: PointFamily) -> np.ndarray:
    """Return the indices of the certain hypotheses, of each target and each code the best one.

    Parameters
    ----------
    hypotheses : Hypotheses
    family : PointFamily
    """
    order = np.argsort(-hypotheses.log_odds, kind='stable')
    order = order[hypotheses.confidence[order] >= CERTAIN]
    units = _reference_frames(hypotheses.homographies[order], family.reach * _SAME)
    words, kept = hypotheses.words[order], []
    free = np.ones(len(order), bool)
    for position in range(len(order)):
        if free[position]:
            kept.append(position)
            free &= ~_within(units, position) & (words != words[position])
    return order[kept]


def _reference_frames(homographies: np.ndarray, radius: float) -> np.ndarray:
    """Return the frames of circles about the reference points."""
    return local_frames(homographies, np.zeros((1, 2)), np.array([radius]))[:, 0]


def _within(units: np.ndarray, position: int) -> np.ndarray:
    """Return which circles have their centre within one of them, itself included."""
    offset = units[:, :2, 2] - units[position, :2, 2]
    inside: np.ndarray = (np.linalg.inv(units[position, :2, :2]) @ offset.T) ** 2
    return inside.sum(axis=0) < 1
