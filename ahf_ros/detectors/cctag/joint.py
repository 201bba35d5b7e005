"""The rings of CCTags and the light on them, fitted to pixels together.

Rays know the light before the rings, and divide by it what the lens has mixed, which costs half of
the precision where targets are small. Here the frame, the edges of the print and those of light
are fitted to the pixels at once, by robust least squares (Levenberg and Marquardt). Print, lens
and projector are the same for all targets of an image, so that some of them tell what is usual
before all are fitted. The variance of gray values grows with the light, as that of photons does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from operator import itemgetter

import numpy as np

from ahf_ros.codes.cctag import CircleFamily
from ahf_ros.detectors.cctag.light import Lights
from ahf_ros.detectors.cctag.patch import (
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
from ahf_ros.detectors.cctag.rays import clipped
from ahf_ros.detectors.cctag.rings import GAMMA, Aligned, Prior, align, as_light, usual_perspective
from ahf_ros.detectors.cctag.templates import MAXIMUM_SHIFT, signed_circles
from ahf_ros.features import frame
from ahf_ros.features.robust import NORMAL, geman_mcclure

_LARGEST = 32.0  # px: rays place the rings of larger targets as well, and much faster
_TELLING = 16  # targets that tell what is usual
_ENOUGH = 4  # of them, and of edges of light
_SHOWN = 0.3  # ln of the height of an edge of light that tells
_NEAR = 0.3, 0.3, 0.4, 1.0, 0.3  # deviations of an edge of light from where it was
_PRIOR = Prior()
_VALUES = _PRIOR.shift, math.log(_PRIOR.blur), 0.0, 0.0, 0.0  # of `_Usual`, as the next
_DEVIATIONS = *_PRIOR.deviations[:2], 10.0, 10.0, 10.0
_LEAST = 0.01, 0.01, 0.005, 0.002, 0.03
_HARDLY = 1e-6  # weight of what nothing tells of
_LEAST_VARIANCE, _LEAST_SPREAD = 0.003, 0.05  # of gray values
_GROUPS = 8  # of pixels of like gray values
_OF_MEDIAN = 0.4549  # median of the square of a normal error
_OUTLIERS = 16.0, 8.0, *([4.0] * 10)  # deviations that quarter a weight, in rounds
_LARGER = 0.9  # quantile of errors that tell which model is right
_FEWEST = 60  # pixels that are fitted
_FREE = 10  # of them, that are not needed for a fit: at least
_TRIALS = 4
_DAMPING = 1e-3, 1e-4  # at first, and at least
_STAYING, _BY_PLACE = 1e-3, 10.0  # move of a centre, px, and of edges by that
_MOST_MOVED = 0.25, 5.0  # px, and deviations of the place that rays give
_OF_VARIANCE = 1.4  # of gray values, that their model adds
_SYSTEMATIC = 0.003  # standard deviation of what the model does to a centre, px


def jointly(gray: np.ndarray, rings: Aligned, family: CircleFamily) -> Aligned:
    """Return rings (k,) that are in place to a part of a px, with places that pixels give.

    Large ones, those that clipping hides, and those that would move farther than they can be wrong
    stay as they are.
    """
    small = np.flatnonzero(frame.ellipse_axes(rings.frames)[0] <= _LARGEST)
    likeliest = small[np.argsort(-rings.plain[small], kind='stable')[:_TELLING]]
    known = ~clipped(gray)
    tried = [
        (image, *_told(image, known, rings.select(likeliest), family, gamma))
        for image, gamma in ((gray, 1.0), (as_light(gray), GAMMA))
    ]
    image, usual, _ = min(tried, key=itemgetter(2))
    fits = _fits(image, known, rings.select(small), family, usual)
    if not fits:
        return rings
    rows = small[list(fits)]
    placed = Aligned.joined(
        [fit.placed(rings.select(small[row : row + 1])) for row, fit in fits.items()]
    )
    moved = placed.frames[:, :2, 2] - rings.frames[rows, :2, 2]
    deviations = np.sqrt(
        np.einsum('ki,kij,kj->k', moved, np.linalg.inv(rings.covariance[rows]), moved)
    )
    near = (np.hypot(*moved.T) <= _MOST_MOVED[0]) | (deviations <= _MOST_MOVED[1])
    return rings.replaced(rows[near], placed.select(near))


def _told(
    gray: np.ndarray, known: np.ndarray, rings: Aligned, family: CircleFamily, gamma: float
) -> tuple[_Usual, float]:
    """Return what targets tell of others, and the usual error of gray values.

    The error is that of the image as it was taken, which has a gamma that this one has not.
    """
    usual = _Usual(camera=Prior.of_camera(_aligned(gray, rings, family, _PRIOR)[0]))
    fits = list(_fits(gray, known, rings, family, usual).values())
    if not fits:
        return usual, math.inf
    errors = [
        np.abs(of.errors) / (gamma * (of.patch.seen / 255).clip(255**-gamma) ** (1 - 1 / gamma))
        for of in fits
    ]
    return usual.after(fits), float(np.quantile(np.concatenate(errors), _LARGER))


def _fits(
    gray: np.ndarray, known: np.ndarray, rings: Aligned, family: CircleFamily, usual: _Usual
) -> dict[int, _Fit]:
    """Return what forms the pixels of targets, by their rows, where enough of these are known."""
    fits = {}
    rings, lights = _aligned(gray, rings, family, usual.camera)
    for index, circles in enumerate(signed_circles(family, rings.ids)):
        own, light = rings.select(slice(index, index + 1)), lights.select(slice(index, index + 1))
        patch = Patch.about(gray, known, own, circles, light, MAXIMUM_SHIFT * family.narrow)
        if len(patch.seen) > _FEWEST:
            fits[index] = _fit(patch, usual.first(patch.first(own, light)), usual)
    return fits


def _aligned(
    gray: np.ndarray, rings: Aligned, family: CircleFamily, camera: Prior
) -> tuple[Aligned, Lights]:
    """Return rings that are brought onto an image, and the lights about them."""
    lights = Lights.about(gray, rings.frames)
    of = align(gray, rings.frames, rings.ids, rings.edges, family, camera, lights)
    return of, lights


@dataclass(frozen=True, slots=True)
class _Fit:
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

    def placed(self, rings: Aligned) -> Aligned:
        """Return the rings of this target, (1,), where the fit is."""
        formed = self.formed
        affine = frame.local_affine(formed.frame[None])[0]
        covariance = _OF_VARIANCE * affine @ self.covariance[:2, :2] @ affine.T
        return replace(
            rings,
            frames=formed.frame[None],
            covariance=(covariance + _SYSTEMATIC**2 * np.eye(2))[None],
            shift=np.array([formed.shift]),
            blur=np.array([formed.blur_of_rays]),
        )


@dataclass(frozen=True, slots=True)
class _Usual:
    """What is known of the targets of an image before they are fitted.

    Values, (5,), are growth of ink, px, ln of the blur of rays, px, contrast of ink, and of edges
    of light the curvature towards where it is brighter, 1 / px, and ln of the width, px.
    """

    camera: Prior = _PRIOR
    values: np.ndarray = field(default_factory=lambda: np.array(_VALUES))
    deviations: np.ndarray = field(default_factory=lambda: np.array(_DEVIATIONS))
    noise: tuple[float, float] = (1.0, 0.0)  # variance of black, and its growth by gray values

    def after(self, fits: list[_Fit]) -> _Usual:
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
        return _Usual(self.camera, values, deviations, _noise(fits))

    def first(self, formed: Formed) -> Formed:
        """Return what forms pixels, with the contrast that is usual if that is known."""
        known = self.deviations[2] < _DEVIATIONS[2]
        return replace(formed, contrast=float(self.values[2])) if known else formed

    def variances(self, shown: np.ndarray) -> np.ndarray:
        """Return the variances of gray values."""
        variances: np.ndarray = self.noise[0] + self.noise[1] * np.maximum(shown, 0)
        return variances

    def prior(self, patch: Patch, formed: Formed) -> tuple[np.ndarray, np.ndarray]:
        """Return the normal matrix (p, p) and the right side (p,) of what is known."""
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
        perspective = usual_perspective(formed.frame[None])[0]
        normal[PERSPECTIVE, PERSPECTIVE] += perspective
        right[PERSPECTIVE] -= perspective @ formed.frame[2, :2]
        return normal, right


def _fit(patch: Patch, formed: Formed, usual: _Usual) -> _Fit:
    """Return what forms the pixels of a target, from what nearly does."""
    seen, damping = patch.seen, _DAMPING[0]
    weights = 1 / usual.variances(seen)
    for outlier in _OUTLIERS:
        plain, changes = patch.derivatives(formed)
        paper = _paper(weights, plain, seen)
        shown = paper * plain
        variances = usual.variances(shown)
        errors = seen - shown
        relative = errors / np.sqrt(variances)
        spread = max(NORMAL * float(np.median(np.abs(relative))), _LEAST_SPREAD)
        weights = geman_mcclure(1 / variances, relative / (outlier * spread))
        free = max(float(weights @ variances) - len(changes), _FREE)
        each = free / max(float(weights @ errors**2), 1e-9)
        columns = np.concatenate([paper * changes, plain[None]])
        normal = each * (columns * weights) @ columns.T
        right = each * columns @ (weights * errors)
        known, towards = usual.prior(patch, formed)
        normal[:-1, :-1] += known
        right[:-1] += towards
        before, best = formed, float(weights @ errors**2)
        for _ in range(_TRIALS):
            change = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), right)[:-1]
            formed = before.changed(change, patch.most_shift)
            plain = patch.shown(formed)
            shown = _paper(weights, plain, seen) * plain
            if float(weights @ (seen - shown) ** 2) <= best * (1 + _DAMPING[1]):
                damping = max(damping / 5, _DAMPING[1])
                break
            damping = max(10 * damping, _DAMPING[0])
        else:
            formed = before
            break
        moved = np.hypot(*(formed.frame - before.frame)[:2, 2])
        if max(moved, *np.abs(change[[SHIFT, BLUR]]) / _BY_PLACE) < _STAYING:
            break
    plain = patch.shown(formed)
    shown = _paper(weights, plain, seen) * plain
    return _Fit(patch, formed, shown, np.linalg.inv(normal)[:-1, :-1])


def _paper(weights: np.ndarray, plain: np.ndarray, seen: np.ndarray) -> float:
    """Return the gray value of paper in full light."""
    return float(weights * plain @ seen) / max(float(weights * plain @ plain), 1e-9)


def _noise(fits: list[_Fit]) -> tuple[float, float]:
    """Return the variance of black, and how it grows by gray values."""
    shown, squares = (
        np.concatenate(of) for of in ([it.shown for it in fits], [it.errors**2 for it in fits])
    )
    groups = np.array_split(np.argsort(shown, kind='stable'), _GROUPS)
    means = [float(shown[of].mean()) for of in groups]
    variances = [float(np.median(squares[of])) / _OF_MEDIAN for of in groups]
    slope, black = np.polyfit(means, variances, 1).tolist()
    return max(black, _LEAST_VARIANCE), max(slope, 0.0)
