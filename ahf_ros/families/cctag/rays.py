"""Rays from the centre of a CCTag, whose light is taken out: linear functions of the ink."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.robust import NORMAL, geman_mcclure

_RAYS = 64
ANGLES = 2 * np.pi * np.arange(_RAYS) / _RAYS
PROFILE = np.linspace(0.06, 1.3, 72)
"""Radii at which rays are read."""
ALONG = PROFILE.astype(np.float32)
"""The same for rays, whose values are single precision."""
AROUND = np.zeros((_RAYS, 6, 10))
"""What each change does to the ink on rays, by powers of radii."""
AROUND[:, [0, 0, 1, 1, 1, 2, 2], range(7)] = -frame.displacement_basis(ANGLES, np.ones(_RAYS))
AROUND[:, [3, 4, 5], [7, 8, 9]] = 1.0
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
_OTHER_CONTRAST = 0.2  # difference of the contrast of a ray, that quarters its weight


@dataclass(frozen=True, slots=True)
class Seen(ArrayRecord):
    """Gray values of k targets along rays, less their light."""

    values: np.ndarray  # float32, (k, rays, n)
    lowest: np.ndarray  # that the camera can show, the same shape, as the next
    highest: np.ndarray
    clipped: np.ndarray  # bool, (k,), whether the camera has clipped many
    apart: np.ndarray  # int, (k,), radii that interpolation mixes with one
    mixed: np.ndarray  # share of these, where many are clipped, (k, rays, n)


def robust_rays(seen: Seen, ink: np.ndarray, outlier: float) -> Rays:
    """Return rays of what is seen, ink (k, n), whose weights are low where light disturbs.

    An error of `outlier` usual deviations leaves a quarter of a weight. The contrast of ink is the
    same wherever the light falls.
    """
    usual_weight = np.broadcast_to(ALONG, seen.values.shape)
    rays = Rays.of(seen, ink, usual_weight)
    for _ in range(_ROUNDS):
        usual = np.median(rays.contrast, axis=1, keepdims=True)
        unlike = (rays.contrast - usual) / (_OTHER_CONTRAST * np.maximum(np.abs(usual), 1e-9))
        alike = geman_mcclure(1.0, unlike)
        middle = seen.values.shape[2] // 2
        of_rays = np.partition(np.abs(rays.errors), middle, axis=2)[..., middle]
        spread = NORMAL * np.quantile(of_rays, _QUIET, axis=1)[:, None, None]
        weight = geman_mcclure(usual_weight, rays.errors / (outlier * np.maximum(spread, _LEAST)))
        rays = Rays.of(seen, ink, weight * alike[..., None], rays.model)
    return rays


@dataclass(frozen=True, slots=True)
class Rays(ArrayRecord):
    """Rays as linear functions of ink: values = paper + step ink + errors, unless clipped."""

    weight: np.ndarray  # (k, rays, n)
    away: np.ndarray  # of the ink, from its mean on the ray, the same shape
    step: np.ndarray  # (k, rays)
    model: np.ndarray  # what a camera that does not clip would see, (k, rays, n)
    errors: np.ndarray  # of what is seen, the same shape
    gain: np.ndarray  # change of what is seen by that of the model, the same shape
    contrast: np.ndarray  # of ink, (k, rays), below 0 where it is darker

    @staticmethod
    def of(
        seen: Seen, ink: np.ndarray, weight: np.ndarray, model: np.ndarray | None = None
    ) -> Rays:
        """Fit rays to the ink of profiles, shape (k, n), from a model unless there is none."""
        ink = np.broadcast_to(ink[:, None], seen.values.shape)
        rays = Rays._fitted(seen.values, ink, weight, np.ones_like(seen.values))
        some = np.flatnonzero(seen.clipped)
        if not len(some):
            return rays
        seen, ink, weight = seen.select(some), ink[some], weight[some]
        fitted = rays.select(some).model if model is None else model[some]
        for _ in range(_ROUNDS_OF_CLIPPED):
            errors, gain = _as_seen(seen, fitted)
            steady = np.maximum(gain, _LEAST_GAIN)
            unclipped = Rays._fitted(fitted + errors / steady, ink, weight * steady**2, gain)
            fitted = unclipped.model
        errors, gain = _as_seen(seen, fitted)
        return rays.replaced(some, replace(unclipped, weight=weight, errors=errors, gain=gain))

    @staticmethod
    def _fitted(values: np.ndarray, ink: np.ndarray, weight: np.ndarray, gain: np.ndarray) -> Rays:
        total = np.maximum(weight.sum(axis=2), 1e-9)
        away = ink - ((weight * ink).sum(axis=2) / total)[..., None]
        mean = ((weight * values).sum(axis=2) / total)[..., None]
        power = np.maximum((weight * away * away).sum(axis=2), 1e-9)
        step = (weight * away * values).sum(axis=2) / power
        paper = mean[..., 0] - step * (weight * ink).sum(axis=2) / total
        contrast = step / np.maximum(np.maximum(paper, paper + step), 0.1)
        model = mean + step[..., None] * away
        return Rays(weight, away, step, model, values - model, gain, contrast)

    def deviations(self, values: np.ndarray) -> np.ndarray:
        """Return the differences of values from the weighted means of their rays."""
        total = np.maximum(self.weight.sum(axis=2, keepdims=True), 1e-9)
        return values - (self.weight * values).sum(axis=2, keepdims=True) / total

    def equations(self, changes: np.ndarray, ink: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the normal equations of the changes of a frame and of edges.

        What another paper and ink of a ray would explain is left to these. The changes of the ink
        (k, 6, n) are those by the radius, times its powers 0 to 2, by the shift, by the blur and
        by the sharpening.
        """
        basis = np.concatenate([np.ones_like(ink)[:, None], ink[:, None], changes], axis=1)
        products = (basis[:, :, None] * basis[:, None]).reshape(len(ink), -1, ink.shape[1])
        moments = (self.weight * self.gain**2) @ products.transpose(0, 2, 1)
        moments = moments.reshape(*self.step.shape, 8, 8).astype(np.float64)
        light = moments[..., :2, :2] + 1e-6 * np.eye(2)
        mixed = moments[..., 2:, :2]
        own = moments[..., 2:, 2:] - mixed @ np.linalg.inv(light) @ mixed.swapaxes(2, 3)
        own *= self.step[..., None, None] ** 2
        errors = (self.weight * self.gain * self.errors) @ changes.transpose(0, 2, 1)
        normal = (AROUND.swapaxes(1, 2) @ own @ AROUND).sum(axis=1)
        right = (self.step[..., None, None] * errors[..., None, :] @ AROUND).sum(axis=(1, 2))
        return normal, right


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


def _as_seen(seen: Seen, model: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what a camera that clips differs by from a model, and the gain, (k, rays, n) each.

    What is seen between pixels is interpolated after they are clipped.
    """
    shown = np.clip(model, seen.lowest, seen.highest)
    count, rays, length = model.shape
    rows, ray = np.arange(count)[:, None, None], np.arange(rays)[:, None]
    before, after = (
        np.clip(np.arange(length) + side[:, None, None], 0, length - 1)
        for side in (-seen.apart, seen.apart)
    )

    def mixed(values: np.ndarray) -> np.ndarray:
        between = (values[rows, ray, before] + values[rows, ray, after]) / 2
        return values + seen.mixed * (between - values)

    return seen.values - mixed(shown), mixed((shown == model).astype(np.float32))
