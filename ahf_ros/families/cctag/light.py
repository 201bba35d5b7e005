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

from ahf_ros.families.cctag.rays import BLACK, PROFILE, RAYS, Limits, Seen, clipped, ray_angles
from ahf_ros.families.cctag.templates import less_lines
from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.normal import normal_integral
from ahf_ros.vision.sampling import circle_places, sample_circles

_EVERY = 2  # one of so many angles and radii is looked at
_ANGLES, _RADII = ray_angles(RAYS)[::_EVERY], PROFILE[::_EVERY].astype(np.float32)
_STEP = float(_RADII[1] - _RADII[0])
_X, _Y = (np.outer(of(_ANGLES), _RADII).astype(np.float32) for of in (np.cos, np.sin))
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
_SHOWN = 0.15  # length of an edge that is looked for, of the longest
_ROUNDS = 4
_DEVIATIONS = 0.3, 0.3, 0.4, 0.3  # of direction, offset, curvature and ln of width
_USUAL_MOVES = 1e-3  # weight of none
_MOST_CURVED, _MOST_MOVED = 1.2, 0.2  # the latter in a round
_HIGHEST, _MOST_LIGHT = 2.5, 4.0  # ln of an edge, and of light
_EVIDENCE = 40.0  # twice the ln of the likelihood, that an edge adds
_LEAST_VARIANCE = 0.003**2
_OF_CLIPPED = 0.1  # weight of gray values that are clipped
_MANY = 0.02  # share of gray values, from which it matters that they are clipped
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

    def at(self, frames: np.ndarray, angles: np.ndarray, radii: np.ndarray) -> np.ndarray:
        """Return the light at angles (m,) and radii (n,) of frames, float32, shape (k, m, n)."""
        there = np.linalg.inv(self.frames) @ frames
        x, y = circle_places(there, angles, radii)
        heights = self.heights.astype(np.float32)[..., None, None]
        light = heights[:, 0] * x + heights[:, 1] * y
        size = frame.mean_radii(self.frames)
        for number in range(self.edges.shape[1]):
            some = np.flatnonzero(self.heights[:, 2 + number])
            if not len(some):
                continue
            edge = self.edges[some, number : number + 1]
            own = some if len(some) < len(x) else slice(None)  # no copy of all
            step = _steps(edge, x[own, None], y[own, None], usual_widths(size[some]))[:, 0]
            light[some] += heights[some, 2 + number] * step
        slope = _interpolated(self.slope, radii)
        light += _mixed(light, slope, _LENS / size, radii[1] - radii[0])
        return np.exp(light.clip(-_MOST_LIGHT, _MOST_LIGHT))

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
            fit = scene.fit(edges[:, :0])
            slope[:], heights[:, :_OTHERS] = scene.slope, fit.heights
            tilt = np.einsum('ks,smn->kmn', fit.heights[:, :2], np.stack([_X, _Y]))
            plain = _less_means(scene.values - tilt, scene.weight, _PAPER)
            rows = np.arange(count)
        for number in range(most if count else 0):
            if number < 2:
                first = _first_look(plain[rows], size[rows], number + 1)
            else:
                first = _first_look(fit.rest, size[rows], 1)
                first = np.concatenate([fit.edges, first], axis=1)
            more = scene.settled(first)
            better = scene.area * np.log(fit.variance / more.variance) > _EVIDENCE
            if not better.any():
                break
            rows, more = rows[better], more.select(better)
            scene = scene.select(better).in_light(more)
            fit = scene.fit(more.edges)
            slope[rows], edges[rows, : number + 1] = scene.slope, fit.edges
            heights[rows, : _OTHERS + number + 1] = fit.heights
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
    angles = ray_angles(rays)
    values = np.maximum(sample_circles(gray, frames, angles, radii), BLACK)
    some = np.flatnonzero(clipped(values).mean(axis=(1, 2)) > _MANY)
    light = lights.at(frames, angles, radii)
    values /= light
    own = np.maximum(values.mean(axis=2, keepdims=True), np.float32(1e-3))
    values /= own
    limits = Limits.of(frames[some], radii, light[some] * own[some])
    return Seen(values, some, limits)


def shares_alike(gray: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return the shares of what rays show that are the same on all, in light without edges, (k,).

    The frames, (k, 3, 3), are known to about a tenth, as for `Lights.about`.
    """
    if not len(frames):
        return np.zeros(0)
    scene = _Scene.of(gray, frames, frame.mean_radii(frames))
    slopes = scene.fit(np.zeros((len(frames), 0, 5))).heights.astype(np.float32)[..., None, None]
    values = np.exp(scene.seen - slopes[:, 0] * _X - slopes[:, 1] * _Y)
    values /= values.mean(axis=2, keepdims=True)
    means, rays = less_lines(values.mean(axis=1), _EVERY), less_lines(values, _EVERY)
    return (means**2).sum(axis=1) / (rays**2).sum(axis=2).mean(axis=1)


@dataclass(frozen=True, slots=True)
class _Fit(ArrayRecord):
    """Light that is fitted to targets."""

    edges: np.ndarray  # (k, e, 5)
    heights: np.ndarray  # (k, 6 + e): slopes, moves of the frame, and edges
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
    smooth: np.ndarray  # slopes of light and moves of the frame, less means, (k, 6, m n)
    changing: np.ndarray  # values less means of circles, (k, m n)

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
        return _Scene(values, values, weight, slope, size, area, *_smooth(values, weight, slope))

    def in_light(self, fit: _Fit) -> _Scene:
        """Return what is seen in a light that is known."""
        heights = fit.heights.astype(np.float32)[..., None, None]
        light = heights[:, 0] * _X + heights[:, 1] * _Y
        light = light + (heights[:, _OTHERS:] * self._steps(fit.edges)).sum(axis=1)
        slope = _slopes(self.values - light, self.weight)
        values = self.seen - _mixed(light, slope, _LENS / self.size, _STEP)
        slope = _slopes(values - light, self.weight)
        smooth, changing = _smooth(values, self.weight, slope)
        return replace(self, values=values, slope=slope, smooth=smooth, changing=changing)

    def fit(self, edges: np.ndarray) -> _Fit:
        """Return the best heights of edges (k, e, 5)."""
        basis = self._less_means(self._steps(edges))
        extra = np.zeros((len(basis), _OTHERS + basis.shape[1]))
        extra[:, 2:_OTHERS] = _USUAL_MOVES
        heights = self._solved(basis, self.changing, extra, 0.0)
        of_smooth, of_edges = np.split(heights.astype(np.float32)[:, None], [_OTHERS], axis=2)
        rest = self.changing - (of_smooth @ self.smooth)[:, 0] - (of_edges @ basis)[:, 0]
        rest = rest.reshape(self.seen.shape)
        variance = (self.weight * rest**2).sum(axis=(1, 2)) + _LEAST_VARIANCE
        return _Fit(edges, heights, rest, variance)

    def settled(self, edges: np.ndarray) -> _Fit:
        """Return the best edges near to some, (k, e, 5), by Levenberg and Marquardt."""
        fit, count = self.fit(edges), edges.shape[1]
        damping = np.full((len(edges), 1), 1e-3)
        usual = np.tile(np.array(_DEVIATIONS) ** -2.0, count)
        for _ in range(_ROUNDS):
            away, across, along = _away(fit.edges, _X, _Y)
            width = _own_widths(fit.edges, usual_widths(self.size))
            step, by_share = _logarithms(normal_integral(away / width), fit.edges)
            density = np.exp(-0.5 * (away / width) ** 2) / width / math.sqrt(2 * math.pi)
            density *= by_share * fit.heights[:, _OTHERS:, None, None].astype(np.float32)
            _, offset, curved, *_ = _columns(fit.edges)
            turn = along * (1 + curved * offset)
            bend = -(across**2 + along**2) / 2
            change = np.stack([turn, curved * across - 1, bend, -away], axis=2)
            change = (density[:, :, None] * change).reshape(len(edges), -1, *_X.shape)
            basis = self._less_means(np.concatenate([change, step], axis=1))
            extra = np.zeros((len(edges), _OTHERS + basis.shape[1]))
            moving = np.s_[:, _OTHERS : _OTHERS + 4 * count]
            extra[moving] = usual * (fit.variance / self.area)[:, None]
            move = self._solved(basis, fit.rest, extra, damping)[moving]
            moved = fit.edges.copy()
            moved[..., [0, 1, 2, 4]] += np.clip(move, -_MOST_MOVED, _MOST_MOVED).reshape(
                -1, count, 4
            )
            moved[..., 2] = np.clip(moved[..., 2], -_MOST_CURVED, _MOST_CURVED)
            moved[..., 3] = np.clip(fit.heights[:, _OTHERS:], -_HIGHEST, _HIGHEST)
            other = self.fit(moved)
            better = other.variance < fit.variance
            damping = np.where(better[:, None], np.maximum(damping / 5, 1e-4), 10 * damping)
            fit = fit.replaced(better, other.select(better))
        return fit

    def _steps(self, edges: np.ndarray) -> np.ndarray:
        return _steps(edges, _X, _Y, usual_widths(self.size))

    def _less_means(self, of_edges: np.ndarray) -> np.ndarray:
        """Return what is of edges (k, b, m, n) less means of circles, (k, b, m n)."""
        return _flat(_less_means(of_edges, self.weight[:, None]))

    def _solved(
        self, basis: np.ndarray, rest: np.ndarray, extra: np.ndarray, damping: np.ndarray | float
    ) -> np.ndarray:
        """Return what is smooth and what is of edges (k, b, m n) in a rest, (k, 6 + b)."""
        every = np.concatenate([self.smooth, basis], axis=1)
        weighted = every * self.weight.reshape(len(every), 1, -1)
        normal = (weighted @ every.transpose(0, 2, 1)).astype(np.float64)
        right = (weighted @ rest.reshape(len(every), -1, 1)).astype(np.float64)
        index = np.arange(normal.shape[1])
        normal[:, index, index] *= 1 + damping
        normal[:, index, index] += extra + 1e-7
        return np.linalg.solve(normal, right)[..., 0]


def _smooth(
    values: np.ndarray, weight: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return slopes of light and moves of frames, and values (k, m, n), all less means."""
    slopes = np.broadcast_to(np.stack([_X, _Y]), (len(values), 2, *_X.shape))
    moves = -slope[:, None, None] * _AROUND
    smooth = _less_means(np.concatenate([slopes, moves], axis=1), weight[:, None])
    return _flat(smooth), _less_means(values, weight).reshape(len(values), -1)


def _flat(basis: np.ndarray) -> np.ndarray:
    """Return (k, b, m, n) as (k, b, m n)."""
    return basis.reshape(*basis.shape[:2], math.prod(basis.shape[2:]))


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
    x, y, weight = _X[_FEW], _Y[_FEW], np.sqrt(_RADII[_FEW])
    steps = _steps(edges[None], x, y, usual_widths(np.array([_SIZES**size])))[0]
    steps = _less_means(steps, np.broadcast_to(weight**2, x.shape), _PAPER // 2) * weight
    steps = steps.reshape(len(edges), -1)
    plane, _ = np.linalg.qr((np.stack([x, y]) * weight).reshape(2, -1).T)
    steps = steps - (steps @ plane) @ plane.T
    length = np.linalg.norm(steps, axis=1)
    shown = length > _SHOWN * length.max()
    return edges[shown], (steps[shown] / length[shown, None]).astype(np.float32)


def _columns(edges: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the columns of edges (k, e, 5), float32, of shape (k, e, 1, 1)."""
    edges = edges.astype(np.float32)[..., None, None]
    return tuple(edges[:, :, column] for column in range(edges.shape[2]))


def _away(
    edges: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the distances of points from edges (k, e, 5), and those across and along them."""
    direction, offset, curved, *_ = _columns(edges)
    cosine, sine = np.cos(direction), np.sin(direction)
    across, along = cosine * x + sine * y - offset, cosine * y - sine * x
    return across - curved / 2 * (across**2 + along**2), across, along


def _steps(edges: np.ndarray, x: np.ndarray, y: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return the steps of edges (k, e, 5) at points, in their heights, shape (k, e, m, n)."""
    share = normal_integral(_away(edges, x, y)[0] / _own_widths(edges, width))
    return _logarithms(share, edges)[0]


def _logarithms(share: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return steps of ln of light, in their heights, and the derivative by the share of light.

    Blur mixes light, and not its logarithm. No height is 0.
    """
    height = _columns(edges)[3]
    height = np.where(np.abs(height) < 0.01, np.float32(0.01), height)
    more = np.expm1(height)
    light = 1 + more * share
    return np.log(light) / height, more / height / light


def _own_widths(edges: np.ndarray, width: np.ndarray) -> np.ndarray:
    return width[:, None, None, None] * np.exp(_columns(edges)[4])


def usual_widths(size: np.ndarray) -> np.ndarray:
    """Return the usual widths of edges, in radii, about targets of so many px."""
    return np.maximum(_WIDTH / size, _SHARPEST).astype(np.float32)


def _mixed(light: np.ndarray, slope: np.ndarray, blur: np.ndarray, step: float) -> np.ndarray:
    """Return what blur adds to ln I where light and ink change at once, to the second order."""
    change = np.gradient(light, step, axis=2) * (blur**2)[:, None, None]
    return (change * slope[:, None]).astype(np.float32)


def _less_means(basis: np.ndarray, weight: np.ndarray, paper: int = len(_RADII)) -> np.ndarray:
    """Return a basis (..., m, n) less its mean on each circle, and that of all from `paper` on."""
    sums, total = (weight * basis).sum(axis=-2), weight.sum(axis=-2)
    if paper < basis.shape[-1]:
        sums[..., paper:] = sums[..., paper:].mean(axis=-1, keepdims=True)
        total[..., paper:] = total[..., paper:].mean(axis=-1, keepdims=True)
    return basis - (sums / total)[..., None, :]


def _interpolated(values: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return values (k, n) that are known at `_RADII` at others (m,), as `np.interp`, (k, m)."""
    known, values = _RADII.astype(np.float64), values.astype(np.float64)
    at = radii.clip(known[0], known[-1])
    below = np.searchsorted(known, at, side='right').clip(1, len(known) - 1) - 1
    rise = np.diff(values, axis=1) / np.diff(known)
    return rise[:, below] * (at - known[below]) + values[:, below]


def _slopes(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the slopes by the radius, (k, n), of the means of circles."""
    means = (weight * values).sum(axis=1) / weight.sum(axis=1)
    return np.gradient(means, _STEP, axis=1).astype(np.float32)
