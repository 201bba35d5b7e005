"""Rays from the centre of a CCTag, whose light is taken out: linear functions of the ink."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from ahf_ros import kernels
from ahf_ros.vision import frame
from ahf_ros.vision.robust import NORMAL

RAYS, FEW_RAYS = 64, 32
"""Rays of a target, and those that are enough to compare its likely IDs."""
PROFILE = np.linspace(0.06, 1.3, 72)
"""Radii at which rays are read."""
ALONG = PROFILE.astype(np.float32)
"""The same for rays, whose values are single precision."""
BLACK, WHITE = 0.0, 255.0
"""Gray values that a camera clips to."""
LIMITS = BLACK + 1.0, WHITE - 1.0
"""Gray values beyond which they are clipped."""
_QUIET = 0.35  # quantile of rays, whose errors are usual
_LEAST = 0.003  # standard deviation of gray values, of their mean
_ROUNDS = 2  # of weights
_ROUNDS_OF_CLIPPED = 4  # in which rays are fitted to what the camera clips
_LEAST_GAIN = 0.05
_DRAWN, _BETWEEN = 1e-4, 0.2  # least share of black and of white, most between, in a drawing
_OF_DRAWING = 40.0, 235.0  # its gray values, as a camera sees it
_BLUR_OF_DRAWING = 0.7  # the same, px
_OTHER_CONTRAST = 0.2  # difference of the contrast of a ray, that quarters its weight


@dataclass(frozen=True, slots=True)
class Seen:
    """Gray values of k targets along rays, less their light."""

    values: np.ndarray  # float32, (k, rays, n)
    highest: np.ndarray  # what a camera can show, less the light, the same shape
    mixed: np.ndarray  # share of what interpolation mixes, the same shape
    apart: np.ndarray  # int, (k,), radii to that, or 0 where few gray values are clipped


@dataclass(frozen=True, slots=True)
class Rays:
    """Rays as linear functions of ink: values = paper + step ink + errors, unless clipped."""

    weight: np.ndarray  # (k, rays, n)
    model: np.ndarray  # what a camera that does not clip would see, (k, rays, n)
    errors: np.ndarray  # of what is seen, the same shape
    gain: np.ndarray  # change of what is seen by that of the model, the same shape
    step: np.ndarray  # (k, rays)
    variance: np.ndarray  # of errors, (k,), as the next 0 if no outlier is known
    normal: np.ndarray  # normal equations of changes of frames and edges, (k, 10, 10)
    right: np.ndarray  # (k, 10)

    @staticmethod
    def of(seen: Seen, inks: Sequence[np.ndarray], outlier: float = math.inf) -> Rays:
        """Fit rays to the ink of profiles and its changes, shape (k, n) each.

        Places count as much as their circles are long, and less where light disturbs: an error of
        `outlier` usual deviations leaves a quarter. The contrast of ink is the same wherever the
        light falls. What another paper and ink of a ray would explain is left to these.
        """
        around = _around(seen.values.shape[1])
        rounds = _ROUNDS if outlier < math.inf else 0
        found = kernels.cctag_rays(
            *(seen.values, seen.highest, seen.mixed, seen.apart, *inks, ALONG, around, rounds),
            *(outlier, _OTHER_CONTRAST, _QUIET, NORMAL, _LEAST, _ROUNDS_OF_CLIPPED, _LEAST_GAIN),
        )
        return Rays(*found[:8])


@lru_cache
def _around(rays: int) -> np.ndarray:
    """Return how far each change of a frame moves a circle on so many rays, (rays, 7)."""
    return frame.displacement_basis(ray_angles(rays), np.ones(rays))


def ray_angles(rays: int) -> np.ndarray:
    """Return the directions of so many rays, rad."""
    return 2 * np.pi * np.arange(rays) / rays


def clipped(values: np.ndarray) -> np.ndarray:
    """Return which gray values the camera has clipped."""
    return (values <= LIMITS[0]) | (values >= LIMITS[1])


def is_drawing(gray: np.ndarray) -> bool:
    """Return whether paper is white and ink black, with little between: no exposure does that."""
    black, white = (gray <= LIMITS[0]).mean(), (gray >= LIMITS[1]).mean()
    return min(black, white) >= _DRAWN and 1 - black - white <= _BETWEEN


def of_drawing(gray: np.ndarray) -> np.ndarray:
    """Return gray values as a camera sees a drawing: none is clipped, and edges are blurred."""
    low, high = _OF_DRAWING
    values = gray * np.float32((high - low) / (WHITE - BLACK)) + np.float32(low)
    return cv2.GaussianBlur(values, (0, 0), _BLUR_OF_DRAWING)
