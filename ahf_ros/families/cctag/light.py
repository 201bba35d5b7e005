"""The light on a CCTag, found without its ID.

What is printed depends on the radius only: gray values that change along a circle show the light,
or that the circle is not in its place. The logarithm of the light is taken as a slope with a few
edges, each a part of a circle or of a straight line in the plane of the target. They are found one
after the other, each as the best of many, and fitted together with the place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from ahf_ros import kernels
from ahf_ros.families.cctag.rays import LIMITS, PROFILE, RAYS, WHITE, Seen, clipped, ray_angles
from ahf_ros.families.cctag.templates import less_lines
from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.sampling import sample_circles


def _directions(angles: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angles), np.sin(angles)])


_EVERY = 2  # one of so many angles and radii is looked at
_ANGLES, _RADII = ray_angles(RAYS)[::_EVERY], PROFILE[::_EVERY].astype(np.float32)
_STEP = float(_RADII[1] - _RADII[0])
_PLACES = (_directions(_ANGLES)[..., None] * _RADII).astype(np.float32)
_X, _Y = _PLACES
_MOVES = (0, 1, 3, 4)  # of a frame, that change what is on a circle
_AROUND = frame.displacement_basis(_ANGLES, np.ones(len(_ANGLES)))[:, _MOVES].T[..., None]
_AROUND = (_AROUND * np.stack([np.ones_like(_RADII)] * 2 + [_RADII] * 2)[:, None]).astype('f4')
_OTHERS = 6  # heights that are not of edges: slopes and moves
EDGES = 3
_WIDTH, _SHARPEST = 1.15, 0.05  # standard deviation of an edge, px, and in radii, for samples
_LENS = 0.88  # blur after light and ink have met, and of interpolation, px
_FEW = np.s_[..., ::2]  # radii, for a first look
_PAPER = 2 * int(np.searchsorted(_RADII[_FEW], 1.16))  # radii from there on show plain paper
_SIZES = 1.1  # ratio of radii that share the edges of a first look
_SHARPEST_FROM = math.ceil(math.log(_WIDTH / _SHARPEST) / math.log(_SIZES))  # step of radii
_OFFSETS = np.arange(-1.2, 1.21, 0.1)
_STRAIGHT, _CURVED, _CURVATURE = 16, 24, 0.7
_FIRST = 6  # edges that are tried with all others
_ROUNDS = 4
_DEVIATIONS = 0.3, 0.3, 0.4, 0.3  # of direction, offset, curvature and ln of width
_USUAL_MOVES = 1e-3  # weight of none
_MOST_CURVED, _MOST_MOVED = 1.2, 0.2  # the latter in a round
_HIGHEST, _MOST_LIGHT = 2.5, 4.0  # ln of an edge, and of light
_EVIDENCE = 40.0  # twice the ln of the likelihood, that an edge adds
_LEAST_VARIANCE = 0.003**2
_OF_CLIPPED = 0.1  # weight of gray values that are clipped
_MANY = 0.02  # share of gray values, from which it matters that they are clipped
_INTERPOLATED = 0.58  # distance of what linear interpolation mixes with a quarter each, px
_BRIGHTEST = 2.0  # gray value, of the mean, that has more weight than others


@dataclass(frozen=True, slots=True)
class Lights(ArrayRecord):
    """The light about k targets, in radii of frames."""

    frames: np.ndarray  # (k, 3, 3)
    heights: np.ndarray  # (k, 2 + e), of ln I: slopes, and edges, 0 for none
    edges: np.ndarray  # (k, e, 5): direction, rad, offset, curvature, height, ln of width
    slope: np.ndarray  # (k, n), of what is the same all around, by the radius
    moved: np.ndarray  # (k, 3, 3), frames in the middle of what is the same all around

    @property
    def counts(self) -> np.ndarray:
        """Return the numbers of edges, (k,)."""
        return np.count_nonzero(self.heights[:, 2:], axis=1)

    @staticmethod
    def about(gray: np.ndarray, frames: np.ndarray, most: int = EDGES) -> Lights:
        """Return the light about targets whose frames, (k, 3, 3), are known to about a tenth.

        It has so many edges at the most.
        """
        count, size = len(frames), frame.mean_radii(frames)
        edges, heights = np.zeros((count, EDGES, 5)), np.zeros((count, _OTHERS + EDGES))
        slope = np.zeros((count, len(_RADII)), np.float32)
        if count:
            scene = _Scene.of(gray, frames, size)
            fit = scene.fit(edges)
            slope[:], heights[:] = scene.slope, fit.heights
            tilt = np.einsum('ks,smn->kmn', fit.heights[:, :2], _PLACES)
            plain = _less_means(scene.values - tilt, scene.weight, _PAPER)
            rows = np.arange(count)
        for number in range(most if count else 0):
            if number < 2:
                first = _first_look(plain[rows], size[rows], number + 1)
                first = np.pad(first, ((0, 0), (0, EDGES - number - 1), (0, 0)))
            else:
                first = fit.edges.copy()
                first[:, number:] = _first_look(fit.rest, size[rows], 1)
            more = scene.fit(first, number + 1, _ROUNDS)
            better = scene.area * np.log(fit.variance / more.variance) > _EVIDENCE
            if not better.any():
                break
            rows, more = rows[better], more.select(better)
            scene = scene.select(better).in_light(more)
            fit = scene.fit(more.edges, number + 1)
            # Edges that are no light make up for a frame that is not in its place.
            likely = (np.abs(fit.heights[:, _OTHERS:]) <= _MOST_LIGHT).all(axis=1)
            rows, scene, fit = rows[likely], scene.select(likely), fit.select(likely)
            if not len(rows):
                break
            slope[rows], edges[rows], heights[rows] = scene.slope, fit.edges, fit.heights
        changes = np.zeros((count, 5))
        changes[:, _MOVES] = np.clip(heights[:, 2:_OTHERS], -_MOST_MOVED, _MOST_MOVED)
        of_light = np.delete(heights, np.s_[2:_OTHERS], axis=1)
        return Lights(frames, of_light, edges, slope, frame.moved(frames, changes))


def lit(
    gray: np.ndarray,
    frames: np.ndarray,
    lights: Lights,
    rays: int = RAYS,
    radii: np.ndarray = PROFILE,
) -> Seen:
    """Return the gray values of rays at radii, evenly spaced, without their light."""
    size = frame.mean_radii(lights.frames)
    found = kernels.cctag_lit(
        *(gray, frames, _directions(ray_angles(rays)), radii, lights.frames, lights.heights),
        *(lights.edges, usual_widths(size), (_LENS / size) ** 2, lights.slope, _RADII),
        *(_MOST_LIGHT, LIMITS, WHITE, _MANY, _INTERPOLATED),
    )
    return Seen(*found[:4])


def shares_alike(gray: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return the shares of what rays show that are the same on all, in light without edges, (k,).

    The frames, (k, 3, 3), are known to about a tenth, as for `Lights.about`.
    """
    if not len(frames):
        return np.zeros(0)
    scene = _Scene.of(gray, frames, frame.mean_radii(frames))
    slopes = scene.fit(np.zeros((len(frames), EDGES, 5))).heights[..., None, None].astype('f4')
    values = np.exp(scene.seen - slopes[:, 0] * _X - slopes[:, 1] * _Y)
    values /= values.mean(axis=2, keepdims=True)
    means, rays = less_lines(values.mean(axis=1), _EVERY), less_lines(values, _EVERY)
    return (means**2).sum(axis=1) / (rays**2).sum(axis=2).mean(axis=1)


@dataclass(frozen=True, slots=True)
class _Fit(ArrayRecord):
    """Light that is fitted to targets."""

    edges: np.ndarray  # (k, 3, 5)
    heights: np.ndarray  # (k, 9): slopes, moves of the frame, and edges
    rest: np.ndarray  # (k, m, n)
    variance: np.ndarray  # (k,)


@dataclass(frozen=True, slots=True)
class _Scene(ArrayRecord):
    """What light is fitted to; places are the m angles times the n radii."""

    seen: np.ndarray  # ln I, (k, m, n)
    values: np.ndarray  # the same, less what blur adds where light and ink change at once
    weight: np.ndarray  # of a sum of 1, the same shape
    slope: np.ndarray  # of what is the same all around, by the radius, (k, n)
    size: np.ndarray  # px, (k,)
    area: np.ndarray  # of what is not clipped, px, (k,)

    @staticmethod
    def of(gray: np.ndarray, frames: np.ndarray, size: np.ndarray) -> _Scene:
        values = sample_circles(gray, frames, _ANGLES, _RADII)
        known = np.where(clipped(values), np.float32(_OF_CLIPPED), np.float32(1))
        values = np.maximum(values, 1)
        bright = np.minimum(values / values.mean(axis=(1, 2), keepdims=True), _BRIGHTEST)
        weight = _RADII * bright**2  # noise is that of gray values
        weight *= known
        weight /= weight.sum(axis=(1, 2), keepdims=True)
        values = np.log(values)
        area = np.pi * (_RADII[-1] * size) ** 2 * known.mean(axis=(1, 2))
        slope = _slopes(values, weight)
        return _Scene(values, values, weight, slope, size, area)

    def in_light(self, fit: _Fit) -> _Scene:
        """Return what is seen in a light that is known."""
        of_light = np.delete(fit.heights, np.s_[2:_OTHERS], axis=1)
        known = of_light, fit.edges, usual_widths(self.size), (_LENS / self.size) ** 2 / _STEP
        light, change = kernels.cctag_light(_PLACES, *known, np.ones_like(self.slope))
        values = self.seen - change * _slopes(self.values - light, self.weight)[:, None]
        return replace(self, values=values, slope=_slopes(values - light, self.weight))

    def fit(self, edges: np.ndarray, count: int = 0, rounds: int = 0) -> _Fit:
        """Return the best heights of the first of edges (k, 3, 5), which settle in some rounds."""
        found = kernels.cctag_edges(
            *(self.values, self.weight, self.slope, usual_widths(self.size), self.area, edges),
            *(count, _PLACES, _AROUND, rounds, _USUAL_MOVES, _DEVIATIONS),
            *(_LEAST_VARIANCE, _MOST_MOVED, _MOST_CURVED, _HIGHEST),
        )
        return _Fit(*found[:4])


def _first_look(rest: np.ndarray, size: np.ndarray, count: int) -> np.ndarray:
    """Return the best one or two of some edges for what is left, shape (k, count, 5)."""
    best = np.empty((len(rest), count, 5))
    sizes = np.minimum(np.rint(np.log(size) / np.log(_SIZES)).astype(int), _SHARPEST_FROM)
    left = (rest[_FEW] * np.sqrt(_RADII[_FEW])).reshape(len(rest), -1)
    for step in np.unique(sizes).tolist():
        edges, steps = _first_edges(step)
        some = np.flatnonzero(sizes == step)
        gain = left[some] @ steps.T
        if count == 1:
            best[some, 0] = edges[np.abs(gain).argmax(axis=1)]
            continue
        first = np.argpartition(-np.abs(gain), _FIRST, axis=1)[:, :_FIRST]
        rows = np.arange(len(some))
        one, own = gain[rows[:, None], first][..., None], gain[:, None]
        of = steps[first] @ steps.T
        both = (one**2 + own**2 - 2 * of * one * own) / np.maximum(1 - of**2, 0.1)
        index, second = np.divmod(both.reshape(len(some), -1).argmax(axis=1), len(steps))
        best[some] = edges[np.array([first[rows, index], second]).T]
    return best


@lru_cache(maxsize=64)
def _first_edges(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return edges (t, 5), and what is left of their steps on circles, normalised (t, n)."""
    straight = product(np.pi * np.arange(_STRAIGHT) / _STRAIGHT, _OFFSETS, [0.0])
    curved = product(2 * np.pi * np.arange(_CURVED) / _CURVED, _OFFSETS, [_CURVATURE])
    edges = np.pad(np.array([*straight, *curved]), ((0, 0), (0, 2)))
    weight = np.sqrt(_RADII[_FEW])
    heights = np.zeros((len(edges), 2 + EDGES))
    heights[:, 2] = 1
    padded = np.pad(edges[:, None], ((0, 0), (0, EDGES - 1), (0, 0)))
    widths, flat = usual_widths(np.full(len(edges), _SIZES**size)), np.zeros(len(edges))
    unmixed = flat, np.zeros((len(edges), len(weight)))
    steps = kernels.cctag_light(_PLACES[_FEW], heights, padded, widths, *unmixed)[0]
    steps = _less_means(steps, np.broadcast_to(weight**2, steps.shape[1:]), _PAPER // 2) * weight
    steps = steps.reshape(len(edges), -1)
    plane, _ = np.linalg.qr((_PLACES[_FEW] * weight).reshape(2, -1).T)
    steps = steps - (steps @ plane) @ plane.T
    length = np.linalg.norm(steps, axis=1)
    return edges, (steps / length[:, None]).astype(np.float32)


def usual_widths(size: np.ndarray) -> np.ndarray:
    """Return the usual widths of edges, in radii, about targets of so many px."""
    return np.maximum(_WIDTH / size, _SHARPEST).astype(np.float32)


def _less_means(basis: np.ndarray, weight: np.ndarray, paper: int = len(_RADII)) -> np.ndarray:
    """Return a basis (..., m, n) less its mean on each circle, and that of all from `paper` on."""
    sums, total = (weight * basis).sum(axis=-2), weight.sum(axis=-2)
    if paper < basis.shape[-1]:
        sums[..., paper:] = sums[..., paper:].mean(axis=-1, keepdims=True)
        total[..., paper:] = total[..., paper:].mean(axis=-1, keepdims=True)
    return basis - (sums / total)[..., None, :]


def _slopes(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the slopes by the radius, (k, n), of the means of circles."""
    means = (weight * values).sum(axis=1) / weight.sum(axis=1)
    return np.gradient(means, _STEP, axis=1).astype(np.float32)
