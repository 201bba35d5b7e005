"""Evidence for and against dots at given places, from the steps of ln I round them.

Where there is a dot, the logarithm of the image has the same step along all rays, wherever the
light falls. Where there is none, it has no step, or a step of an edge of light, which crosses the
circle on two sides and in opposite directions.
"""

from __future__ import annotations

import numpy as np

from ahf_ros import kernels
from ahf_ros.vision.frame import determinants, ellipse_axes
from ahf_ros.vision.log_edges import LOG_SCALE

PIXELS_ASIDE = 1.0
"""Distance of samples from a circle in a sharp image, px of the minor axis."""

_ANGLES = 2 * np.pi * np.arange(16) / 16
_RAYS = np.array([np.cos(_ANGLES), np.sin(_ANGLES)])
_ASIDE = (0.3, 0.7)  # bounds of the distance of samples from the circle, dot radii
_DOT_SPREAD = (0.3, 0.6)  # standard deviation of steps below and above the usual one, in it
_EMPTY_SPREAD = 0.22  # the same of steps where there is no dot
_FLOOR = 0.12  # share of rays that edges of light disturb
_RANGE = 3.0  # of such steps
_CORRELATION = 2.5  # distance on the circle at which rays are independent, px


def circle_sides(
    log: np.ndarray, frames: np.ndarray, aside: float | np.ndarray = PIXELS_ASIDE
) -> tuple[np.ndarray, np.ndarray]:
    """Return ln(I + 8) at the inside of n circles and at their outside, along m rays.

    The image is LOG_SCALE ln(I + 8); samples are `aside` from the circle, px of the minor axis, a
    number or of shape (n,). With the values, float64 of shape (n, m, 2), comes whether all of a
    circle lies in the image, shape (n,).
    """
    apart = np.clip(np.divide(aside, ellipse_axes(frames)[1]), *_ASIDE)
    radii = np.stack([1 - apart, 1 + apart], axis=1)
    sides, inside = kernels.short_values(log, frames, _RAYS, radii, LOG_SCALE)
    return sides, inside


def dot_evidence(
    steps: np.ndarray, frames: np.ndarray, noise: float | np.ndarray = 0.0
) -> np.ndarray:
    """Return ln of the likelihood of dots, shape (...), divided by the likelihood of none.

    Steps from dots with frames (..., 3, 3) to their ground, shape (..., m), are in units of the
    usual step of such dots, as is the standard deviation of their noise, a number or of their
    shape. Rays round a small dot count less than so many independent ones.
    """
    below, above, empty = (np.hypot(spread, noise) for spread in (*_DOT_SPREAD, _EMPTY_SPREAD))
    spread = np.where(steps < 1, below, above)
    height = 2 / (np.sqrt(2 * np.pi) * (below + above))
    dot = height * np.exp(-0.5 * ((steps - 1) / spread) ** 2)
    none = np.exp(-0.5 * (steps / empty) ** 2) / (np.sqrt(2 * np.pi) * empty)
    floor = _FLOOR / _RANGE
    ratio = np.log(((1 - _FLOOR) * dot + floor) / ((1 - _FLOOR) * none + floor))
    return independent_rays(frames) * ratio.sum(axis=-1)


def independent_rays(frames: np.ndarray) -> np.ndarray:
    """Return the share of rays round dots with frames (..., 3, 3) that count as independent."""
    length = 2 * np.pi * np.sqrt(np.abs(determinants(frames)))
    return np.clip(length / _CORRELATION, 4, len(_ANGLES)) / len(_ANGLES)
