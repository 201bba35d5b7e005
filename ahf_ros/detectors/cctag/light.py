"""The light on a CCTag, found without its ID.

What is printed depends on the radius only: gray values that change along a circle show the light.
Its logarithm is taken as smooth but for a few edges, each a part of a circle or a straight line,
in the plane of the target. The edges are found one by one, each as the best of many, and fitted
together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from ahf_ros.detectors.cctag.rays import ANGLES, PROFILE, normal_share
from ahf_ros.features import frame
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.sampling import sample_circles

_ANGLES, _RADII = ANGLES[::2], PROFILE[::2].astype(np.float32)
_X, _Y = (np.outer(of, _RADII).astype(np.float32) for of in (np.cos(_ANGLES), np.sin(_ANGLES)))
_AROUND = np.stack([np.cos(_ANGLES)[:,None]+0*_RADII, np.sin(_ANGLES)[:,None]+0*_RADII, np.outer(np.cos(2*_ANGLES),_RADII), np.outer(np.sin(2*_ANGLES),_RADII)]).astype(np.float32)
_OTHERS = 6
_PAPER = 2 * int(np.searchsorted(_RADII[::2], 1.16))
_FEW = np.s_[..., ::2]  # radii, for a first look
_EDGES = 3
_WIDTH = 1.15  # standard deviation of an edge of light, px
_SHARPEST = 0.05  # radii, that samples show
_SIZES = 1.1  # ratio of radii that share the edges of a first look
_OFFSETS = np.arange(-1.2, 1.21, 0.1)
_STRAIGHT, _CURVED, _CURVATURE = 16, 24, 0.7
_TOP = 40
_SHOWN = 0.15  # length of an edge that is looked for, of the longest
_ROUNDS = 6
_DEVIATIONS = 0.3, 0.3, 0.4  # of direction, offset and curvature, from the best of a first look
_MOST_CURVED = 1.2
_MOST_MOVED = 0.2  # in a round
_EVIDENCE = 25.0  # twice the likelihood, in ln, that an edge adds
_LEAST_VARIANCE = 0.003**2
_BRIGHTEST = 2.0  # gray value, of the mean, that has more weight than others


@dataclass(frozen=True, slots=True)
class Lights(ArrayRecord):
    """The light about k targets, in radii of frames."""

    frames: np.ndarray  # (k, 3, 3)
    heights: np.ndarray  # (k, 4 + e), of ln I: x, y, x^2 - y^2, 2 x y, and edges; 0 for none
    edges: np.ndarray  # (k, e, 3): direction, rad, offset and curvature
    moved: np.ndarray  # (k, 3, 3), frames in the middle of what is the same all around

    def at(self, frames: np.ndarray, angles: np.ndarray, radii: np.ndarray) -> np.ndarray:
        """Return the light at angles (m,) and radii (n,) of frames, float32, shape (k, m, n)."""
        there = np.linalg.inv(self.frames) @ frames
        points = frame.project(there, frame.circle_points(angles, radii)).astype(np.float32)
        x, y = (of[:, None] for of in np.moveaxis(points, -1, 0))
        heights = self.heights.astype(np.float32)
        light = (heights[:, :2, None, None] * _smooth(x, y)).sum(axis=1)
        width = _widths(frame.mean_radii(self.frames))
        for number in range(self.edges.shape[1]):
            some = np.flatnonzero(heights[:, 2 + number])
            step = _steps(self.edges[some, number : number + 1], x[some], y[some], width[some])
            light[some] += heights[some, 2 + number, None, None] * step[:, 0]
        return np.exp(light)

    @staticmethod
    def about(gray: np.ndarray, frames: np.ndarray) -> Lights:
        """Return the light about targets whose frames, (k, 3, 3), are known to about a tenth."""
        size = frame.mean_radii(frames)
        if not len(frames):
            return Lights(frames, np.zeros((0, 2 + _EDGES)), np.zeros((0, _EDGES, 3)), frames)
        values = np.maximum(sample_circles(gray, frames, _ANGLES, _RADII), 1)
        bright = np.minimum(values / values.mean(axis=(1, 2), keepdims=True), _BRIGHTEST)
        weight = _RADII * bright**2  # noise is that of gray values
        weight /= weight.sum(axis=(1, 2), keepdims=True)
        values, area = np.log(values), np.pi * (_RADII[-1] * size) ** 2
        scene = _Scene(values, weight, _widths(size), area, _slopes(values, weight))
        edges, heights = np.zeros((len(size), _EDGES, 3)), np.zeros((len(size), _OTHERS + _EDGES))
        fit = scene.fit(edges[:, :0])
        heights[:, :_OTHERS] = fit.heights
        rows = np.arange(len(size))
        plain = _less_means(values - (fit.heights[:, :2, None, None] * _smooth(_X, _Y)).sum(axis=1), weight, _PAPER)
        for number in range(_EDGES):
            first = scene.first_look(plain[rows], size[rows], number) if number < 2 else np.concatenate([fit.edges, scene.first_look(fit.rest, size[rows], 0)], axis=1)
            more = scene.settled(first)
            gain = scene.area * np.log(fit.variance / more.variance)
            better = gain > _EVIDENCE
            rows, scene, more = rows[better], scene.select(better), more.select(better)
            if not len(rows):
                break
            scene = scene.without(more)
            fit = scene.fit(more.edges)
            edges[rows, : number + 1], heights[rows, : _OTHERS + number + 1] = fit.edges, fit.heights
        changes = np.zeros((len(size), 5))
        changes[:, [0, 1, 3, 4]] = np.clip(heights[:, 2:_OTHERS], -_MOST_MOVED, _MOST_MOVED)
        return Lights(frames, heights[:, [0, 1, *range(_OTHERS, _OTHERS + _EDGES)]], edges, frame.moved(frames, changes))


@dataclass(frozen=True, slots=True)
class _Fit(ArrayRecord):
    edges: np.ndarray  # (k, e, 3)
    heights: np.ndarray  # (k, 8 + e)
    rest: np.ndarray  # (k, m, n)
    variance: np.ndarray  # (k,)


@dataclass(frozen=True, slots=True)
class _Scene(ArrayRecord):
    """What the light is fitted to."""

    values: np.ndarray  # ln I, (k, m, n)
    weight: np.ndarray  # of a sum of 1, the same shape
    width: np.ndarray  # of edges, radii, (k,)
    area: np.ndarray  # px, (k,)
    slope: np.ndarray  # of what is the same all around, by the radius, (k, n)

    def without(self, fit: _Fit) -> _Scene:
        light = (fit.heights[:, :2, None, None] * _smooth(_X, _Y)).sum(axis=1)
        steps = _steps(fit.edges, _X, _Y, self.width)
        light = light + (fit.heights[:, _OTHERS:, None, None] * steps).sum(axis=1)
        return replace(self, slope=_slopes(self.values - light, self.weight))

    def others(self) -> np.ndarray:
        """Return (k, 8, m, n)."""
        smooth = np.broadcast_to(_smooth(_X, _Y), (len(self.values), 2, *_X.shape))
        return np.concatenate([smooth, -self.slope[:, None, None] * _AROUND], axis=1)

    def fit(self, edges: np.ndarray) -> _Fit:
        """Return the best heights of edges (k, e, 3)."""
        steps = _steps(edges, _X, _Y, self.width)
        basis = self._centred(np.concatenate([self.others(), steps], axis=1))
        rest = self._centred(self.values[:, None])[:, 0]
        extra = np.zeros(basis.shape[:2])
        extra[:, 2:6] = 1e-3
        heights = self._solved(basis, rest, extra)
        rest = rest - (heights[..., None, None].astype(np.float32) * basis).sum(axis=1)
        variance = (self.weight * rest**2).sum(axis=(1, 2)) + _LEAST_VARIANCE
        return _Fit(edges, heights, rest, variance)

    def first_look(self, rest: np.ndarray, size: np.ndarray, number: int) -> np.ndarray:
        """Return the best of some edges for what is left, shape (k, 1, 3)."""
        best = np.empty((len(rest), number + 1, 3))
        steps = np.rint(np.log(size) / np.log(_SIZES)).astype(int)
        left = (rest[_FEW] * np.sqrt(_RADII[_FEW])).reshape(len(rest), -1)
        for step in np.unique(steps).tolist():
            edges, along = _first_edges(step)
            some = np.flatnonzero(steps == step)
            gain = left[some] @ along.T
            if not number:
                best[some, 0] = edges[np.abs(gain).argmax(axis=1)]
                continue
            alike = along @ along.T
            high = np.argpartition(-np.abs(gain), _TOP, axis=1)[:, :_TOP]
            for row, own, tops in zip(some, gain, high, strict=True):
                a, of = own[tops][:, None], alike[tops]
                both = (a * a + own * own - 2 * of * a * own) / np.maximum(1 - of * of, 0.1)
                i, j = np.unravel_index(both.argmax(), both.shape)
                best[row] = edges[tops[i]], edges[j]
        return best

    def settled(self, edges: np.ndarray) -> _Fit:
        """Return the best edges near to some, (k, e, 3), by Levenberg and Marquardt."""
        fit, count = self.fit(edges), edges.shape[1]
        damping = np.full(len(edges), 1e-3)
        usual = np.tile(np.array(_DEVIATIONS) ** -2.0, count)
        for _ in range(_ROUNDS):
            away, across, along = _away(fit.edges, _X, _Y)
            width = self.width[:, None, None, None]
            density = np.exp(-0.5 * (away / width) ** 2) / width / math.sqrt(2 * math.pi)
            density *= fit.heights[:, _OTHERS:, None, None].astype(np.float32)
            _, offset, curved = _columns(fit.edges)
            turn = along * (1 + curved * offset)
            change = np.stack([turn, curved * across - 1, -(across**2 + along**2) / 2], axis=2)
            change = (density[:, :, None] * change).reshape(len(edges), -1, *_X.shape)
            step = normal_share(away / width)
            basis = self._centred(np.concatenate([change, self.others(), step], axis=1))
            extra = np.zeros((len(edges), basis.shape[1]))
            extra[:, : 3 * count] = usual * (fit.variance / self.area)[:, None]
            move = self._solved(basis, fit.rest, extra, damping)[:, : 3 * count]
            move = np.clip(move, -_MOST_MOVED, _MOST_MOVED).reshape(-1, count, 3)
            moved = fit.edges + move
            moved[..., 2] = np.clip(moved[..., 2], -_MOST_CURVED, _MOST_CURVED)
            other = self.fit(moved)
            better = other.variance < fit.variance
            damping = np.where(better, np.maximum(damping / 5, 1e-4), 10 * damping)
            fit = fit.replaced(better, other.select(better))
        return fit

    def _centred(self, basis: np.ndarray) -> np.ndarray:
        """Return a basis (k, b, m, n) less its mean on each circle."""
        return _less_means(basis, self.weight[:, None], len(_RADII))

    def _solved(
        self,
        basis: np.ndarray,
        rest: np.ndarray,
        extra: np.ndarray | float = 0.0,
        damping: np.ndarray | float = 0.0,
    ) -> np.ndarray:
        flat = basis.reshape(*basis.shape[:2], -1)
        weighted = flat * self.weight.reshape(len(flat), 1, -1)
        normal = (weighted @ flat.transpose(0, 2, 1)).astype(np.float64)
        right = (weighted @ rest.reshape(len(flat), -1, 1)).astype(np.float64)
        diagonal = np.einsum('kii->ki', normal)
        diagonal *= 1 + np.expand_dims(damping, -1)
        diagonal += extra + 1e-7
        return np.linalg.solve(normal, right)[..., 0]


def _less_means(basis: np.ndarray, weight: np.ndarray, paper: int) -> np.ndarray:
    """Return a basis (..., m, n) less its mean on each circle, and that of all paper outside."""
    sums, total = (weight * basis).sum(axis=-2), weight.sum(axis=-2)
    outer = slice(paper, None)
    sums[..., outer] = sums[..., outer].sum(axis=-1, keepdims=True)
    means = sums / np.concatenate([total[..., :paper], np.broadcast_to(total[..., outer].sum(axis=-1, keepdims=True), total[..., outer].shape)], axis=-1)
    less: np.ndarray = basis - means[..., None, :]
    return less


def _slopes(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    mean = (weight * values).sum(axis=1) / weight.sum(axis=1)
    return np.gradient(mean, _RADII[1] - _RADII[0], axis=1).astype(np.float32)


def _columns(edges: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return direction, offset and curvature of edges (k, e, 3), float32, (k, e, 1, 1) each."""
    return tuple(np.moveaxis(edges.astype(np.float32), -1, 0)[..., None, None])


def _away(
    edges: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the distances of points from edges (k, e, 3), and those across and along them."""
    direction, offset, curved = _columns(edges)
    cosine, sine = np.cos(direction), np.sin(direction)
    across, along = cosine * x + sine * y - offset, cosine * y - sine * x
    return across - curved / 2 * (across**2 + along**2), across, along


def _steps(edges: np.ndarray, x: np.ndarray, y: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return the steps of edges (k, e, 3) at points, shape (k, e, m, n)."""
    return normal_share(_away(edges, x, y)[0] / width[:, None, None, None])


def _smooth(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return what changes smoothly on circles, shape (..., 4, m, n)."""
    axis = x.ndim - 2
    if axis:
        return np.concatenate([x, y], axis=axis - 1)
    return np.stack([x, y])


def _widths(size: np.ndarray) -> np.ndarray:
    """Return the widths of edges, in radii, for targets of so many px."""
    return np.maximum(_WIDTH / size, _SHARPEST).astype(np.float32)


@lru_cache(maxsize=64)
def _first_edges(step: int) -> tuple[np.ndarray, np.ndarray]:
    """Return edges (t, 3), and what is left of their steps on circles, normalised (t, n)."""
    straight = product(np.pi * np.arange(_STRAIGHT) / _STRAIGHT, _OFFSETS, [0.0])
    curved = product(2 * np.pi * np.arange(_CURVED) / _CURVED, _OFFSETS, [_CURVATURE])
    edges = np.array([*straight, *curved])
    x, y, weight = _X[_FEW], _Y[_FEW], np.sqrt(_RADII[_FEW])
    steps = _steps(edges[None], x, y, _widths(np.array([_SIZES**step])))[0]
    steps = (_less_means(steps, np.broadcast_to(weight**2, x.shape), _PAPER // 2) * weight).reshape(len(edges), -1)
    plane, _ = np.linalg.qr((_smooth(x, y) * weight).reshape(2, -1).T)
    steps = steps - (steps @ plane) @ plane.T
    length = np.linalg.norm(steps, axis=1)
    shown = length > _SHOWN * length.max()
    return edges[shown], (steps[shown] / length[shown, None]).astype(np.float32)
