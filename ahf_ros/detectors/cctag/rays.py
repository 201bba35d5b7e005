"""Rays from the centre of a CCTag, whose light is taken out: linear functions of the ink."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.robust import NORMAL, geman_mcclure

_RAYS = 64
ANGLES = 2 * np.pi * np.arange(_RAYS) / _RAYS
PROFILE = np.linspace(0.06, 1.3, 72)
"""Radii at which rays are read."""
ALONG = PROFILE.astype(np.float32)
"""The same for rays, whose values are single precision."""
AROUND = np.zeros((_RAYS, 5, 9))
"""What each change does to the ink on rays, by powers of radii."""
AROUND[:, [0, 0, 1, 1, 1, 2, 2], range(7)] = -frame.displacement_basis(ANGLES, np.ones(_RAYS))
AROUND[:, [3, 4], [7, 8]] = 1.0
_QUIET = 0.35  # quantile of rays, whose errors are usual
_LEAST = 0.003  # standard deviation of gray values, of their mean
_ROUNDS = 2  # of weights
_OTHER_CONTRAST = 0.2  # difference of the contrast of a ray, that quarters its weight


def robust_rays(values: np.ndarray, ink: np.ndarray, outlier: float) -> Rays:
    """Return rays, values (k, rays, n) and ink (k, n), whose weights are low where light disturbs.

    An error of `outlier` usual deviations leaves a quarter of a weight. The contrast of ink is the
    same wherever the light falls.
    """
    usual_weight = np.broadcast_to(ALONG, values.shape)
    rays = Rays.of(values, ink, usual_weight)
    for _ in range(_ROUNDS):
        usual = np.median(rays.contrast, axis=1, keepdims=True)
        unlike = (rays.contrast - usual) / (_OTHER_CONTRAST * np.maximum(np.abs(usual), 1e-9))
        alike = geman_mcclure(1.0, unlike)
        middle = values.shape[2] // 2
        of_rays = np.partition(np.abs(rays.errors), middle, axis=2)[..., middle]
        spread = NORMAL * np.quantile(of_rays, _QUIET, axis=1)[:, None, None]
        weight = geman_mcclure(usual_weight, rays.errors / (outlier * np.maximum(spread, _LEAST)))
        rays = Rays.of(values, ink, weight * alike[..., None])
    return rays


@dataclass(frozen=True, slots=True)
class Rays:
    """Rays as linear functions of ink: values = paper + step ink + errors."""

    weight: np.ndarray  # (k, rays, n)
    away: np.ndarray  # of the ink, from its mean on the ray, the same shape
    step: np.ndarray  # (k, rays)
    errors: np.ndarray
    contrast: np.ndarray  # of ink, (k, rays), below 0 where it is darker

    @staticmethod
    def of(values: np.ndarray, ink: np.ndarray, weight: np.ndarray) -> Rays:
        """Fit rays to the ink of profiles, shape (k, n)."""
        total = np.maximum(weight.sum(axis=2), 1e-9)
        ink = np.broadcast_to(ink[:, None], values.shape)
        away = ink - ((weight * ink).sum(axis=2) / total)[..., None]
        mean = ((weight * values).sum(axis=2) / total)[..., None]
        power = np.maximum((weight * away * away).sum(axis=2), 1e-9)
        step = (weight * away * values).sum(axis=2) / power
        paper = mean[..., 0] - step * (weight * ink).sum(axis=2) / total
        contrast = step / np.maximum(np.maximum(paper, paper + step), 0.1)
        return Rays(weight, away, step, values - mean - step[..., None] * away, contrast)

    def deviations(self, values: np.ndarray) -> np.ndarray:
        """Return the differences of values from the weighted means of their rays."""
        total = np.maximum(self.weight.sum(axis=2, keepdims=True), 1e-9)
        away: np.ndarray = values - (self.weight * values).sum(axis=2, keepdims=True) / total
        return away

    def equations(self, changes: np.ndarray, ink: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the normal equations of the changes of a frame, of shift and of blur.

        What another paper and ink of a ray would explain is left to these. The changes of the ink
        (k, 5, n) are those by the radius, times its powers 0 to 2, by the shift and by the blur.
        """
        basis = np.concatenate([np.ones_like(ink)[:, None], ink[:, None], changes], axis=1)
        products = (basis[:, :, None] * basis[:, None]).reshape(len(ink), -1, ink.shape[1])
        moments = self.weight @ products.transpose(0, 2, 1)
        moments = moments.reshape(*self.step.shape, 7, 7).astype(np.float64)
        light = moments[..., :2, :2] + 1e-6 * np.eye(2)
        mixed = moments[..., 2:, :2]
        own = moments[..., 2:, 2:] - mixed @ np.linalg.inv(light) @ mixed.swapaxes(2, 3)
        own *= self.step[..., None, None] ** 2
        errors = (self.weight * self.errors) @ changes.transpose(0, 2, 1)
        normal = (AROUND.swapaxes(1, 2) @ own @ AROUND).sum(axis=1)
        right = (self.step[..., None, None] * errors[..., None, :] @ AROUND).sum(axis=(1, 2))
        return normal, right


def normal_share(x: np.ndarray) -> np.ndarray:
    """Return the share of a normal distribution below x, to 0.0005 (Page, JRSS C 1977, 26, 75)."""
    share: np.ndarray = 0.5 * (1 + np.tanh(math.sqrt(2 / math.pi) * x * (1 + 0.044715 * x * x)))
    return share
