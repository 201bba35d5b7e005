"""Evidence for and against dots at given places, from the steps of ln I round them.

Where there is a dot, the logarithm of the image has the same step along all rays, wherever the
light falls. Where there is none, it has no step, or a step of an edge of light, which crosses the
circle on two sides and in opposite directions.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.features.frame import circle_points, ellipse_axes, project
from ahf_ros.features.log_edges import LOG_SCALE
from ahf_ros.features.sampling import sample, within

PIXELS_ASIDE = 1.0
"""Distance of samples from a circle in a sharp image, px of the minor axis."""

_RAYS = 16
_ANGLES = 2 * np.pi * np.arange(_RAYS) / _RAYS
_ASIDE = (0.3, 0.7)  # bounds of the distance of samples from the circle, dot radii
_DOT_SPREAD = (0.3, 0.6)  # standard deviation of steps below and above the usual one, in it
_EMPTY_SPREAD = 0.22  # the same of steps where there is no dot
_FLOOR = 0.12  # share of rays that edges of light disturb
_RANGE = 3.0  # of such steps
_CORRELATION = 2.5  # distance on the circle at which rays are independent, px
_PART = 400_000  # samples at a time, which bounds the memory


def circle_sides(
    log: np.ndarray, frames: np.ndarray, aside: float | np.ndarray = PIXELS_ASIDE
) -> tuple[np.ndarray, np.ndarray]:
    """Return ln(I + 8) at the inside of circles and at their outside, along rays.

    Parameters
    ----------
    log : ndarray of int16, shape (height, width)
        LOG_SCALE ln(I + 8).
    frames : ndarray of float64, shape (n, 3, 3)
        Of the circles.
    aside : float or ndarray of float, shape (n,)
        Distance of the samples from the circle, px of the minor axis.

    Returns
    -------
    sides : ndarray of float64, shape (n, m, 2)
        The inside, then the outside.
    inside : ndarray of bool, shape (n,)
        Whether all of the circle lies in the image.
    """
    count = max(_PART // (2 * _RAYS), 1)
    aside = np.broadcast_to(aside, len(frames))
    parts = [
        _sides(log, frames[start : start + count], aside[start : start + count])
        for start in range(0, max(len(frames), 1), count)
    ]
    sides, inside = (np.concatenate(part) for part in zip(*parts, strict=True))
    return sides, inside


def _sides(
    log: np.ndarray, frames: np.ndarray, aside: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    aside = np.clip(aside / ellipse_axes(frames)[1], *_ASIDE)
    radii = np.stack([1 - aside, 1 + aside], axis=1)
    pixels = project(frames, circle_points(_ANGLES, radii))
    values = sample(log, pixels).astype(np.float64) / LOG_SCALE
    inside = np.asarray(within(pixels, log.shape).all(axis=(1, 2)))
    return values, inside


def dot_evidence(
    steps: np.ndarray, frames: np.ndarray, noise: float | np.ndarray = 0.0
) -> np.ndarray:
    """Return ln of the likelihood of a dot divided by the likelihood of none.

    Parameters
    ----------
    steps : ndarray of float64, shape (..., m)
        From the dot to its ground, in the usual step of such dots.
    frames : ndarray of float64, shape (..., 3, 3)
        Of the dots; rays round a small dot count less than so many independent ones.
    noise : float or ndarray of float64, shape (..., m)
        Standard deviation of the steps by noise, in the unit of `steps`.

    Returns
    -------
    ndarray of float64, shape (...)
    """
    evidence: np.ndarray = independent_rays(frames) * _log_ratio(steps, noise).sum(axis=-1)
    return evidence


def independent_rays(frames: np.ndarray) -> np.ndarray:
    """Return the share of the rays round dots that count as independent, shape (...).

    Parameters
    ----------
    frames : ndarray of float64, shape (..., 3, 3)
    """
    length = 2 * np.pi * np.sqrt(np.abs(np.linalg.det(frames[..., :2, :2])))
    share: np.ndarray = np.clip(length / _CORRELATION, 4, _RAYS) / _RAYS
    return share


def _log_ratio(steps: np.ndarray, noise: float | np.ndarray) -> np.ndarray:
    """Return ln of the likelihood of steps at a dot over that where there is none."""
    below, above, empty = (np.hypot(spread, noise) for spread in (*_DOT_SPREAD, _EMPTY_SPREAD))
    spread = np.where(steps < 1, below, above)
    height = 2 / (np.sqrt(2 * np.pi) * (below + above))
    dot = height * np.exp(-0.5 * ((steps - 1) / spread) ** 2)
    none = np.exp(-0.5 * (steps / empty) ** 2) / (np.sqrt(2 * np.pi) * empty)
    floor = _FLOOR / _RANGE
    ratio: np.ndarray = np.log(((1 - _FLOOR) * dot + floor) / ((1 - _FLOOR) * none + floor))
    return ratio
