"""What forms the pixels of one CCTag, fitted to them by robust least squares.

Print, lens and projector are the same for all targets of an image, so that some of them tell what
is usual before others are fitted. The variance of gray values grows with the light, as that of
photons does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from ahf_ros.families.cctag.alignment import usual_perspective
from ahf_ros.families.cctag.patch import (
    BLUR,
    EDGES,
    OF_EDGE,
    OF_LIGHT,
    PERSPECTIVE,
    PRINT,
    SHIFT,
    Formed,
    Patch,
)
from ahf_ros.families.cctag.prior import Prior
from ahf_ros.vision import frame
from ahf_ros.vision.robust import NORMAL, geman_mcclure, medians

_ENOUGH = 4  # targets, and edges of light, that tell what is usual
_SHOWN = 0.3  # ln of the height of an edge of light that tells
_NEAR = 0.3, 0.3, 0.4, 1.0, 0.3  # deviations of an edge of light from where it was
_PRIOR = Prior()
_VALUES = _PRIOR.shift, math.log(_PRIOR.blur), 0.0, 0.0, 0.0  # of `Usual`, as the next
_DEVIATIONS = *_PRIOR.deviations[:2], 10.0, 10.0, 10.0
_LEAST = 0.01, 0.01, 0.005, 0.002, 0.03
_HARDLY = 1e-6  # weight of what nothing tells of
_LEAST_VARIANCE, _LEAST_SPREAD = 0.003, 0.05  # of gray values
_GROUPS = 8  # of pixels of like gray values
_OF_MEDIAN = 0.4549  # median of the square of a normal error
_OUTLIERS = 16.0, *([6.0] * 11)  # deviations that quarter a weight, in rounds
_FREE = 10  # pixels more than parameters, at the least
_TRIALS = 4
_DAMPING = 1e-3, 1e-4  # at first, and at least
_CHANGING, _CHANGING_LIGHT = 0.02, 0.05  # the same, and of edges of light, px and radii
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

    def cost(self, usual: Usual) -> float:
        """Return what is taken from ln of the odds: half the squares of all errors.

        Those of the print count less, as prints may differ.
        """
        away = (usual.values[:3] - self.formed.of_print) / (_DIFFERENT * usual.deviations[:3])
        return (len(self.shown) * self.misfit(usual) + float(away @ away)) / 2


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

    def prior(
        self, patch: Patch, formed: Formed, perspective: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the normal matrix (p, p) and the right side (p,) of what is known.

        That of perspective, (2, 2), is known of the target.
        """
        weight, right = np.zeros((2, EDGES + formed.edges.size))
        weight[:] = _HARDLY
        weight[PRINT] = self.deviations[:3] ** -2
        right[PRINT] = (self.values[:3] - formed.of_print) * weight[PRINT]
        values, scales = formed.of_light(patch.light_size)
        known = (scales / self.deviations[3:]) ** 2
        of_edges, to_usual = (of[EDGES:].reshape(-1, OF_EDGE) for of in (weight, right))
        of_edges[:] = np.array(_NEAR) ** -2
        of_edges[:, OF_LIGHT] += known
        to_usual[:, OF_LIGHT] = (self.values[3:] - values) / scales * known
        normal = np.diag(weight)
        normal[PERSPECTIVE, PERSPECTIVE] += perspective
        right[PERSPECTIVE] -= perspective @ formed.frame[2, :2]
        return normal, right


def fitted(patch: Patch, formed: Formed, usual: Usual, most: float = math.inf) -> Fit:
    """Return what forms the pixels of a target, from what nearly does.

    What costs far more than `most` after a round, or more after another, is not fitted to the end.
    """
    seen, damping = patch.seen, _DAMPING[0]
    weights = 1 / usual.variances(seen)
    plain, changes = patch.shown(formed), patch.changes(formed)
    perspective = usual_perspective(formed.frame[None])[0]
    for number, outlier in enumerate(_OUTLIERS):
        paper = _paper(weights, plain, seen)
        errors = seen - paper * plain
        variances = usual.variances(paper * plain)
        relative = errors / np.sqrt(variances)
        spread = max(NORMAL * float(medians(np.abs(relative)[None])[0]), _LEAST_SPREAD)
        weights = geman_mcclure(1 / variances, relative / (outlier * spread))
        free = max(float(weights @ variances) - len(changes), _FREE)
        best = float(weights @ errors**2)
        each = free / max(best, 1e-9)
        columns = np.concatenate([paper * changes, plain[None]])
        normal = each * (columns * weights) @ columns.T
        right = each * columns @ (weights * errors)
        known, towards = usual.prior(patch, formed, perspective)
        normal[:-1, :-1] += known
        right[:-1] += towards
        before = formed, plain
        for _ in range(_TRIALS):
            change = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), right)[:-1]
            formed = before[0].changed(change, patch.most_shift)
            plain = patch.shown(formed)
            errors = seen - _paper(weights, plain, seen) * plain
            if float(weights @ errors**2) <= best * (1 + _DAMPING[1]):
                damping = max(damping / 5, _DAMPING[1])
                break
            damping = max(10 * damping, _DAMPING[0])
        else:
            formed, plain = before
            break
        moved = np.hypot(*(formed.frame - before[0].frame)[:2, 2])
        moved = max(moved, *np.abs(change[[SHIFT, BLUR]]) / _BY_PLACE)
        if moved < _STAYING:
            break
        if most < math.inf:
            shown = _paper(weights, plain, seen) * plain
            if Fit(patch, formed, shown, normal).cost(usual) > (most if number else 2 * most):
                break
        # The derivatives hardly change where the place does not.
        if moved > _CHANGING or np.abs(change[EDGES:]).max(initial=0.0) > _CHANGING_LIGHT:
            changes = patch.changes(formed)
    shown = _paper(weights, plain, seen) * plain
    return Fit(patch, formed, shown, np.linalg.inv(normal)[:-1, :-1])


def _paper(weights: np.ndarray, plain: np.ndarray, seen: np.ndarray) -> float:
    """Return the gray value of paper in full light."""
    return float(weights * plain @ seen) / max(float(weights * plain @ plain), 1e-9)


def _noise(fits: list[Fit]) -> tuple[float, float]:
    """Return the variance of black, and how it grows by gray values."""
    shown, squares = (
        np.concatenate(of) for of in ([it.shown for it in fits], [it.errors**2 for it in fits])
    )
    groups = np.array_split(np.argsort(shown, kind='stable'), _GROUPS)
    means = [float(shown[of].mean()) for of in groups]
    variances = [float(np.median(squares[of])) / _OF_MEDIAN for of in groups]
    slope, black = np.polyfit(means, variances, 1).tolist()
    return max(black, _LEAST_VARIANCE), max(slope, 0.0)
