"""What forms the pixels of one CCTag, fitted to them by robust least squares.

Print, lens and projector are the same for all targets of an image, so that some of them tell what
is usual before others are fitted. The variance of gray values grows with the light, as that of
photons does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from ahf_ros import kernels
from ahf_ros.families.cctag.alignment import usual_perspective
from ahf_ros.families.cctag.patch import (
    EDGES,
    OF_EDGE,
    OF_INTERPOLATION,
    OF_LIGHT,
    PRINT,
    Formed,
    Patch,
)
from ahf_ros.families.cctag.prior import Prior
from ahf_ros.vision import frame
from ahf_ros.vision.robust import NORMAL

_ENOUGH = 4  # targets, and edges of light, that tell what is usual
_SHOWN = 0.3  # ln of the height of an edge of light that tells
_MOST = 0.3  # change at once, of the frame and of all else
_NEAR = 0.3, 0.3, 0.4, 1.0, 0.3  # deviations of an edge of light from where it was
_PRIOR = Prior()
_VALUES = _PRIOR.shift, math.log(_PRIOR.blur), 0.0, 0.0, 0.0  # of `Usual`, as the next
_DEVIATIONS = *_PRIOR.deviations[:2], 10.0, 10.0, 10.0
_LEAST = 0.01, 0.01, 0.005, 0.002, 0.03
_HARDLY = 1e-6  # weight of what nothing tells of
_LEAST_SPREAD = 0.05  # of gray values
_GROUPS = 8  # of pixels of like gray values
_OF_MEDIAN = 0.4549  # median of the square of a normal error
_OUTLIERS = 16.0, *([6.0] * 11)  # deviations that quarter a weight, in rounds
_FREE = 10  # pixels more than parameters, at the least
_TRIALS = 4
_DAMPING = 1e-3, 1e-4  # at first, and at least
_CHANGING = 0.02  # move of a centre, px, and change of edges of light, for new derivatives
_STAYING, _BY_PLACE = 1e-3, 10.0  # move of a centre, px, and of edges by that
_OF_VARIANCE = 1.4  # of gray values, that their model adds
_DIFFERENT = 2.0  # deviations of a print that counts as one
_MOST_SQUARED = 16.0  # of errors, in their deviations
_LEAST_SPREAD_OF_MISFITS = 0.2  # of their logarithms


@dataclass(frozen=True, slots=True)
class Fit:
    """What forms the pixels of a target."""

    patch: Patch
    formed: Formed
    shown: np.ndarray  # gray values that are formed, of pixels that are known, (n,)
    covariance: np.ndarray  # of the parameters, (p, p)
    cost: float
    """What is taken from ln of the odds: half the squares of all errors; prints may differ."""

    @property
    def errors(self) -> np.ndarray:
        """Gray values less those that are formed, (n,)."""
        return self.patch.seen - self.shown

    @property
    def of_light(self) -> tuple[np.ndarray, np.ndarray]:
        """What is alike of all edges of light, and its variances, of edges that tell, (e, 2)."""
        values, scales = self.formed.of_light(self.patch.light_size)
        variances = np.diag(self.covariance)[EDGES:].reshape(-1, OF_EDGE)[:, OF_LIGHT] * scales**2
        telling = np.abs(self.formed.heights) > _SHOWN
        return values[telling], variances[telling]

    @property
    def of_centre(self) -> np.ndarray:
        """Covariance of the centre, px^2, (2, 2)."""
        in_plane = _OF_VARIANCE * self.covariance[None, :2, :2]
        return frame.centre_covariance(self.formed.frame[None], in_plane)[0]

    def misfit(self, usual: Usual) -> float:
        """Return the mean of squares of errors in their deviations, of which none counts much."""
        squares = self.errors**2 / usual.variances(self.shown)
        return float(np.minimum(squares, _MOST_SQUARED).mean())


@dataclass(frozen=True, slots=True)
class Usual:
    """What is known of the targets of an image before they are fitted.

    Values, (5,), are growth of ink, px, ln of the blur of rays, px, contrast of ink, and of edges
    of light the curvature towards where it is brighter, 1 / px, and ln of the width, px.
    """

    camera: Prior = _PRIOR
    values: np.ndarray = field(default_factory=lambda: np.array(_VALUES))
    deviations: np.ndarray = field(default_factory=lambda: np.array(_DEVIATIONS))
    noise: tuple[float, float] = (1.0, 0.0)  # variance of black, and its growth by gray values
    misfits: tuple[float, float] = (0.0, math.inf)  # of the logarithm: usual value, deviation

    @property
    def contrast(self) -> float:
        """Contrast of ink, 0 before targets tell it."""
        return float(self.values[2])

    def after(self, fits: list[Fit]) -> Usual:
        """Return what fits tell besides."""
        of_print = np.array([of.formed.of_print for of in fits])
        of_variances = np.array([np.diag(of.covariance)[PRINT] for of in fits])
        of_light = (np.concatenate(of) for of in zip(*(it.of_light for it in fits), strict=True))
        told = [
            *zip(of_print.T, of_variances.T, strict=True),
            *zip(*(of.T for of in of_light), strict=True),
        ]
        least = np.array(_LEAST)
        least[2] *= 1 + abs(float(np.median(of_print[:, 2])))
        values, deviations = self.values.copy(), self.deviations.copy()
        for index, (of_all, variances) in enumerate(told):
            if len(of_all) >= _ENOUGH:
                values[index] = np.median(of_all)
                square = (NORMAL * np.median(np.abs(of_all - values[index]))) ** 2
                own = square - np.median(variances)
                deviations[index] = math.sqrt(max(own, square / len(of_all), least[index] ** 2))
        usual = Usual(self.camera, values, deviations, _noise(fits))
        misfits = np.log([of.misfit(usual) for of in fits])
        median = float(np.median(misfits))
        spread = NORMAL * float(np.median(np.abs(misfits - median)))
        return replace(usual, misfits=(median, max(spread, _LEAST_SPREAD_OF_MISFITS)))

    def unusual(self, fit: Fit) -> float:
        """Return by how many deviations a fit is worse than usual."""
        usual, deviation = self.misfits
        return (math.log(max(fit.misfit(self), 1e-9)) - usual) / deviation

    def variances(self, shown: np.ndarray) -> np.ndarray:
        """Return the variances of gray values."""
        return self.noise[0] + self.noise[1] * np.maximum(shown, 0)


def fitted(patch: Patch, formed: Formed, usual: Usual, most: float = math.inf) -> Fit:
    """Return what forms the pixels of a target, from what nearly does, by the kernel.

    What costs far more than `most` after a round, or more after another, is not fitted to the end.
    """
    parameters = EDGES + formed.edges.size
    place, values, shown, covariance, cost, *_ = kernels.cctag_fit(
        *(patch.seen, *patch.formed(formed), *patch.bounds(len(formed.edges))),
        *(_MOST, _MOST, OF_INTERPOLATION, usual.values, usual.deviations, _NEAR),
        *(usual_perspective(formed.frame[None])[0], _HARDLY, usual.noise, _OUTLIERS),
        *(NORMAL, _LEAST_SPREAD, _FREE, _TRIALS, *_DAMPING, _STAYING, _BY_PLACE),
        *(_CHANGING, _CHANGING, _DIFFERENT, _MOST_SQUARED, most),
    )
    place = frame.translated(place[None], *patch.corner)[0]
    covariance = covariance[:parameters, :parameters]
    return Fit(patch, Formed(place, values), shown, covariance, float(cost[0]))


def _noise(fits: list[Fit]) -> tuple[float, float]:
    """Return the variance of black, and how it grows by gray values."""
    shown, squares = (
        np.concatenate(of) for of in ([it.shown for it in fits], [it.errors**2 for it in fits])
    )
    groups = np.array_split(np.argsort(shown, kind='stable'), _GROUPS)
    means = [float(shown[of].mean()) for of in groups]
    variances = [float(np.median(squares[of])) / _OF_MEDIAN for of in groups]
    slope, black = np.polyfit(means, variances, 1).tolist()
    return max(black, _LEAST_SPREAD**2), max(slope, 0.0)
