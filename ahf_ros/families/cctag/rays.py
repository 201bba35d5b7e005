"""Rays from the centre of a CCTag, whose light is taken out: linear functions of the ink."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np

from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.robust import NORMAL, geman_mcclure, medians, quantiles

RAYS, FEW_RAYS = 64, 32
"""Rays of a target, and those that are enough to compare its likely IDs."""
PROFILE = np.linspace(0.06, 1.3, 72)
"""Radii at which rays are read."""
ALONG = PROFILE.astype(np.float32)
"""The same for rays, whose values are single precision."""
BLACK, WHITE = 0.0, 255.0
"""Gray values that a camera clips to."""
_QUIET = 0.35  # quantile of rays, whose errors are usual
_LEAST = 0.003  # standard deviation of gray values, of their mean
_ROUNDS = 2  # of weights
_ROUNDS_OF_CLIPPED = 4  # in which rays are fitted to what the camera clips
_CLIPPED = 1.0  # distance of gray values from limits, within which they are clipped
_LEAST_GAIN = 0.05
_DRAWN, _BETWEEN = 1e-4, 0.2  # least share of black and of white, most between, in a drawing
_OF_DRAWING = 40.0, 235.0  # its gray values, as a camera sees it
_BLUR_OF_DRAWING = 0.7  # the same, px
_INTERPOLATED = 0.58  # distance of what linear interpolation mixes with a quarter each, px
_OTHER_CONTRAST = 0.2  # difference of the contrast of a ray, that quarters its weight


@dataclass(frozen=True, slots=True)
class Limits(ArrayRecord):
    """What a camera can show of c targets, of which it has clipped many gray values."""

    lowest: np.ndarray  # gray values, less their light, (c, rays, n)
    highest: np.ndarray  # the same
    apart: np.ndarray  # int, (c,), radii that interpolation mixes with one
    mixed: np.ndarray  # share of these, (c, rays, n)

    @staticmethod
    def of(frames: np.ndarray, radii: np.ndarray, light: np.ndarray) -> Limits:
        """Return the limits of rays at radii (n,) of frames in a light (c, rays, n)."""
        angles = ray_angles(light.shape[1])
        step = frame.mean_radii(frames) * (radii[1] - radii[0])
        apart = np.maximum(np.rint(_INTERPOLATED / step), 1)
        points = frame.project(frames, frame.circle_points(angles, radii))
        between = points - np.floor(points)
        away = points - frames[:, None, None, :2, 2]
        away /= np.linalg.norm(away, axis=-1, keepdims=True)
        variance = (away**2 * between * (1 - between)).sum(axis=-1)
        return Limits(
            lowest=np.float32(BLACK) / light,
            highest=np.float32(WHITE) / light,
            apart=apart.astype(int),
            mixed=(variance / (apart * step)[:, None, None] ** 2).astype(np.float32),
        )


@dataclass(frozen=True, slots=True)
class Seen:
    """Gray values of k targets along rays, less their light."""

    values: np.ndarray  # float32, (k, rays, n)
    clipped: np.ndarray  # int, (c,), those of which the camera has clipped many
    limits: Limits  # of these


def robust_rays(seen: Seen, ink: np.ndarray, outlier: float) -> Rays:
    """Return rays of what is seen, ink (k, n), whose weights are low where light disturbs.

    An error of `outlier` usual deviations leaves a quarter of a weight. The contrast of ink is the
    same wherever the light falls.
    """
    rays = Rays.of(seen, ink)
    for _ in range(_ROUNDS):
        usual = medians(rays.contrast)[:, None]
        unlike = (rays.contrast - usual) / (_OTHER_CONTRAST * np.maximum(np.abs(usual), 1e-9))
        alike = geman_mcclure(1.0, unlike)
        middle = seen.values.shape[2] // 2
        of_rays = np.partition(np.abs(rays.errors), middle, axis=2)[..., middle]
        spread = NORMAL * quantiles(of_rays, _QUIET)[:, None]
        unlike = rays.errors / (outlier * np.maximum(spread, _LEAST))[..., None].astype(np.float32)
        weight = geman_mcclure((alike[..., None] * ALONG).astype(np.float32), unlike)
        rays = Rays.of(seen, ink, weight, rays.model)
    return rays


@dataclass(frozen=True, slots=True)
class Rays:
    """Rays as linear functions of ink: values = paper + step ink + errors, unless clipped."""

    weight: np.ndarray  # (k, rays, n)
    step: np.ndarray  # (k, rays)
    model: np.ndarray  # what a camera that does not clip would see, (k, rays, n)
    errors: np.ndarray  # of what is seen, the same shape
    gain: np.ndarray  # change of what is seen by that of the model; (k, 1, 1) if none is clipped
    contrast: np.ndarray  # of ink, (k, rays), below 0 where it is darker

    @staticmethod
    def of(
        seen: Seen,
        ink: np.ndarray,
        weight: np.ndarray | None = None,
        model: np.ndarray | None = None,
    ) -> Rays:
        """Fit rays to the ink of profiles, shape (k, n), from a model unless there is none.

        Without weights, a place counts as much as the circle that it is on is long.
        """
        if weight is None:
            weight = np.empty_like(seen.values)
            weight[:] = ALONG
        gain = np.ones((len(weight), 1, 1), np.float32)
        rays = Rays._fitted(seen.values, ink, weight, gain)
        some, limits = seen.clipped, seen.limits
        if not len(some):
            return rays
        values, ink, part = seen.values[some], ink[some], weight[some]
        fitted = (rays.model if model is None else model)[some]
        for _ in range(_ROUNDS_OF_CLIPPED):
            errors, gain = _as_seen(values, limits, fitted)
            steady = np.maximum(gain, _LEAST_GAIN)
            unclipped = Rays._fitted(fitted + errors / steady, ink, part * steady**2, gain)
            fitted = unclipped.model
        errors, gain = _as_seen(values, limits, fitted)
        of_all = np.ones_like(rays.model)
        of_all[some], rays.errors[some], rays.model[some] = gain, errors, fitted
        rays.step[some], rays.contrast[some] = unclipped.step, unclipped.contrast
        return replace(rays, gain=of_all)

    @staticmethod
    def _fitted(values: np.ndarray, ink: np.ndarray, weight: np.ndarray, gain: np.ndarray) -> Rays:
        powers = np.stack([np.ones_like(ink), ink, ink**2], axis=2)
        total, of_ink, of_square = (weight @ powers).transpose(2, 0, 1)
        of_values, of_both = ((weight * values) @ powers[..., :2]).transpose(2, 0, 1)
        total = np.maximum(total, 1e-9)
        mean = of_ink / total
        step = (of_both - mean * of_values) / np.maximum(of_square - mean * of_ink, 1e-9)
        paper = of_values / total - step * mean
        contrast = step / np.maximum(np.maximum(paper, paper + step), 0.1)
        model = step[..., None] * ink[:, None]
        model += paper[..., None]
        return Rays(weight, step, model, values - model, gain, contrast)

    def equations(self, changes: np.ndarray, ink: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the normal equations of the changes of a frame and of edges.

        What another paper and ink of a ray would explain is left to these. The changes of the ink
        (k, 6, n) are those by the radius, times its powers 0 to 2, by the shift, by the blur and
        by the sharpening.
        """
        count, rays = self.step.shape
        of_frame, of_pairs = _around(rays)
        basis = np.concatenate([np.ones_like(ink)[:, None], ink[:, None], changes], axis=1)
        first, second = _pairs(basis.shape[1])
        weight = self.weight * self.gain
        errors = (weight * self.errors) @ changes.transpose(0, 2, 1)
        errors = (self.step[..., None] * errors).reshape(count, -1).astype(np.float64)
        weight *= self.gain
        pairs = weight @ (basis[:, first] * basis[:, second]).transpose(0, 2, 1)
        pairs = _without_first(_without_first(pairs.astype(np.float64), 8), 7)
        pairs *= self.step[..., None] ** 2
        normal = (pairs.reshape(count, -1) @ of_pairs).reshape(count, 10, 10)
        return normal, errors @ of_frame


def _without_first(pairs: np.ndarray, size: int) -> np.ndarray:
    """Return moments of pairs, (..., n), less what the first of so many variables explains.

    Pairs are those of the upper triangle of a matrix, row by row, before and after.
    """
    head, (first, second) = pairs[..., 1:size], _pairs(size - 1)
    share = head / (pairs[..., :1] + 1e-6)
    less: np.ndarray = pairs[..., size:] - head[..., first] * share[..., second]
    return less


@lru_cache
def _pairs(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows and columns of the upper triangle of a matrix, row by row."""
    return np.triu_indices(size)


@lru_cache
def _around(rays: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what makes equations of a frame and of edges of those of so many rays.

    The first, (6 rays, 10), is what each change does to the ink on rays, by powers of radii and by
    edges. The other, (21 rays, 100), is the same for pairs of these.
    """
    around = np.zeros((rays, 6, 10))
    basis = frame.displacement_basis(ray_angles(rays), np.ones(rays))
    around[:, [0, 0, 1, 1, 1, 2, 2], range(7)] = -basis
    around[:, [3, 4, 5], [7, 8, 9]] = 1.0
    first, second = _pairs(6)
    pairs = around[:, first, :, None] * around[:, second, None]
    pairs += np.where((first != second)[:, None, None], pairs.swapaxes(2, 3), 0)
    return around.reshape(-1, 10), pairs.reshape(-1, 100)


def ray_angles(rays: int) -> np.ndarray:
    """Return the directions of so many rays, rad."""
    return 2 * np.pi * np.arange(rays) / rays


def clipped(values: np.ndarray) -> np.ndarray:
    """Return which gray values the camera has clipped."""
    return (values <= BLACK + _CLIPPED) | (values >= WHITE - _CLIPPED)


def is_drawing(gray: np.ndarray) -> bool:
    """Return whether paper is white and ink black, with little between: no exposure does that."""
    black, white = (gray <= BLACK + _CLIPPED).mean(), (gray >= WHITE - _CLIPPED).mean()
    return min(black, white) >= _DRAWN and 1 - black - white <= _BETWEEN


def of_drawing(gray: np.ndarray) -> np.ndarray:
    """Return gray values as a camera sees a drawing: none is clipped, and edges are blurred."""
    low, high = _OF_DRAWING
    values = gray * np.float32((high - low) / (WHITE - BLACK)) + np.float32(low)
    return cv2.GaussianBlur(values, (0, 0), _BLUR_OF_DRAWING)


def _as_seen(seen: np.ndarray, limits: Limits, model: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what a camera that clips differs by from a model, and the gain, (k, rays, n) each.

    What is seen between pixels is interpolated after they are clipped.
    """
    shown = np.clip(model, limits.lowest, limits.highest)
    count, rays, length = model.shape
    rows, ray = np.arange(count)[:, None, None], np.arange(rays)[:, None]
    before, after = (
        np.clip(np.arange(length) + side[:, None, None], 0, length - 1)
        for side in (-limits.apart, limits.apart)
    )

    def mixed(values: np.ndarray) -> np.ndarray:
        between = (values[rows, ray, before] + values[rows, ray, after]) / 2
        return values + limits.mixed * (between - values)

    return seen - mixed(shown), mixed((shown == model).astype(np.float32))
