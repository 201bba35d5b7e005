"""Hypotheses on targets: how probable each is, and which of those that contradict each other.

The probability is a logistic regression, whose weights are in `fitted_weights.json`.
`benchmarks.confidence` fits them, and shows how far the result can be trusted.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ahf_ros.families.claims import Rivals, owners
from ahf_ros.families.gsi.evidence import Readings
from ahf_ros.families.gsi.grouping import Templates
from ahf_ros.families.gsi.refinement import Placement
from ahf_ros.prints.gsi import PointPrint
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.dots import Dots
from ahf_ros.vision.frame import mean_radii, project
from ahf_ros.vision.homography import reference_frames
from ahf_ros.vision.logistic import logistic, read_weights

WEIGHTS = Path(__file__).with_name('fitted_weights.json')
CERTAIN = 0.7  # confidence from which a target is reported
OBVIOUS = 0.95  # confidence from which a target is not weighed against others in its place
POSSIBLE = 0.1  # confidence from which a target is reported without its ID, where these are
SAME = 0.4  # distance of the reference points of the same target in its reach

_PERSPECTIVE = 0.08  # change of depth from the centre to the edge of a target, that counts as 1

_ALIKE = 0.7  # difference of ln of the radii of dots that are about as large
_OWN = 1.5  # radii of its dots, within which a dot is one of a target's
_PART = 64  # targets at a time, which bounds the memory

_PLAUSIBLE = 0.75  # support of a hypothesis that is followed up
_CLEAR = 0.95  # the same, where only obvious targets are looked for; these have 1
_MAXIMUM = 250  # hypotheses that are followed up, those with the most support
_MISFIT = 0.1  # support that a misfit of 1 of the template costs in the order of these
_APART = 0.8  # distance of the reference points of different targets, in their reach
_CLEARLY = 0.12  # support by which the better one of two groups that lie closer is better

(_OF_TARGET,) = read_weights(WEIGHTS, 'gsi_confidence', 'weights')


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
    growth : ndarray of float64, shape (k,)
        Growth of what is dark in light, px; NaN where it was not measured.
    words : ndarray of int64, shape (k,)
        Value of the code.
    features : ndarray of float64, shape (k, 7)
        See `confidence_features`.
    """

    homographies: np.ndarray
    covariance: np.ndarray
    polarity: np.ndarray
    scale: np.ndarray
    growth: np.ndarray
    words: np.ndarray
    features: np.ndarray

    @property
    def support(self) -> np.ndarray:
        """Support of the code, as in `Readings`, up to 1, shape (k,)."""
        return 1 - self.features[:, 0] ** 2

    @property
    def confidence(self) -> np.ndarray:
        """Probabilities that there is a target with this code, shape (k,)."""
        return probability(self.features)


NO_HYPOTHESES = Hypotheses(
    homographies=np.zeros((0, 3, 3)),
    covariance=np.zeros((0, 2, 2)),
    polarity=np.zeros(0, int),
    scale=np.zeros(0),
    growth=np.zeros(0),
    words=np.zeros(0, int),
    features=np.zeros((0, len(_OF_TARGET) - 1)),
)


def strays(
    dots: Dots, placement: Placement, places: np.ndarray, radii: np.ndarray, family: PointPrint
) -> np.ndarray:
    """Return how many dots of about their size targets have among them, of their own, shape (k,).

    Light draws some into a target, but a weave or a page has as many of them everywhere.

    Parameters
    ----------
    dots : Dots
        All of the polarity of k targets.
    placement : Placement
        Of these targets.
    places, radii : ndarray of float64, shape (k, n, 2) and (k, n)
        Of their own dots, in the plane of the printed design and of its size in the image.
    family : PointPrint
    """
    centres, size = dots.frames[:, :2, 2], np.log(mean_radii(dots.frames))
    count = np.zeros(len(radii))
    for start in range(0, len(radii), _PART):
        part = slice(start, start + _PART)
        frames, own = placement.homographies[part], radii[part]
        usual = np.log(mean_radii(reference_frames(frames, 1.0)) * own.mean(axis=1))
        seen = project(np.linalg.inv(frames), centres)
        within = (seen**2).sum(axis=2) < family.reach**2
        target, dot = np.nonzero(within & (np.abs(size - usual[:, None]) < _ALIKE))
        away = np.hypot(*(seen[target, dot, None] - places[part][target]).transpose(2, 0, 1))
        stray = (away > _OWN * own[target]).all(axis=1)
        count[part] = np.bincount(target[stray], minlength=len(own))
    return count / radii.shape[1]


def confidence_features(
    placement: Placement, readings: Readings, stray: np.ndarray, family: PointPrint
) -> np.ndarray:
    """Return what tells targets from chance arrangements, and right codes from wrong ones.

    The margin of the reading at the places of the placement; the roots of what its support lacks,
    of the misplacement, of the share of the dots of some size whose edges are not where they
    should be, and of the strays, as the first of these says most; the share of all dots whose
    edges are there, as nothing is misplaced where none was measured; and the perspective,
    shape (k, 7).
    """
    perspective = placement.homographies[:, 2, :2] * family.reach / _PERSPECTIVE
    return np.stack(
        [
            np.sqrt(np.maximum(1 - readings.support, 0)),
            readings.margin,
            np.sqrt(placement.misplacement),
            np.sqrt(placement.missing),
            placement.share,
            np.hypot(*perspective.T),
            np.sqrt(stray),
        ],
        axis=1,
    )


def probability(features: np.ndarray) -> np.ndarray:
    """Return the probabilities that hypotheses are right, shape (k,), by their features."""
    return logistic(features, _OF_TARGET)


def least_support(*, obvious: bool) -> float:
    """Return the support of groups from which they are followed up."""
    return _CLEAR if obvious else _PLAUSIBLE


def plausible(
    templates: Templates, readings: Readings, family: PointPrint, *, obvious: bool
) -> np.ndarray:
    """Return the indices of the groups that are followed up, of equal ones one.

    Of several groups that lie too close for all to be targets, those that are clearly worse are
    left out; all but the best one, if only obvious targets are looked for.
    """
    rank = readings.support - _MISFIT * templates.misfit
    order = np.argsort(-rank, kind='stable')
    order = order[readings.support[order] >= least_support(obvious=obvious)]
    own_dot = float(family.template_radii[family.reference])
    units = reference_frames(templates.homographies[order], own_dot)
    around = reference_frames(templates.homographies[order], family.reach * _APART)
    words, support, centres = readings.words[order], readings.support[order], units[:, :2, 2]
    alike, near = _within_each(centres, units), _within_each(centres, around)

    def rivals(of: np.ndarray) -> np.ndarray:
        worse = support < support[of, None] - (0.0 if obvious else _CLEARLY)
        return alike(of) & (words == words[of, None]) | near(of) & worse

    return order[owners(len(order), rivals)][:_MAXIMUM]


def resolve(hypotheses: Hypotheses, family: PointPrint, minimum: float = CERTAIN) -> np.ndarray:
    """Return the indices of hypotheses with a minimum of confidence, the best of each place."""
    confidence = hypotheses.confidence
    order = np.argsort(-confidence, kind='stable')
    order = order[confidence[order] >= minimum]
    units = reference_frames(hypotheses.homographies[order], family.reach * SAME)
    return order[owners(len(order), _within_each(units[:, :2, 2], units))]


def inside(points: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return which points, shape (n, 2), lie in at least one of some circles, by affine frames."""
    offset = points - frames[:, None, :2, 2]
    relative = offset @ np.linalg.inv(frames[:, :2, :2]).swapaxes(1, 2)
    return np.asarray(((relative**2).sum(axis=2) < 1).any(axis=0))


def _within_each(points: np.ndarray, frames: np.ndarray) -> Rivals:
    """Return which points, shape (n, 2), lie in each of some circles, by affine frames."""
    centres, inverse = frames[:, :2, 2], np.linalg.inv(frames[:, :2, :2]).swapaxes(1, 2)

    def within(of: np.ndarray) -> np.ndarray:
        relative = (points - centres[of, None]) @ inverse[of]
        return np.asarray((relative**2).sum(axis=2) < 1)

    return within
