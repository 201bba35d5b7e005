"""A glance at disc and border: the share of the steps of ln I that a target has there.

Any light has steps. Those of a target lie on three circles at once and have one height.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.codes.dots import DotFamily
from ahf_ros.features.frame import circle_points
from ahf_ros.features.log_edges import LOG_SCALE
from ahf_ros.features.sampling import sample

_RAYS = 20
_ANGLES = 2 * np.pi * np.arange(_RAYS) / _RAYS
_MINIMUM_STEP = 0.12  # step of ln of a disc
_EDGE_SIDES = 5  # radii between which the edges lie
_PART = 2_000_000  # samples at a time, which bounds the memory


def border_steps(
    log: np.ndarray,
    frames: np.ndarray,
    polarity: np.ndarray,
    code: DotFamily,
    scales: np.ndarray | None = None,
) -> np.ndarray:
    """Return the mean step at the edges of disc and border, in steps of the disc.

    Parameters
    ----------
    log : ndarray of int16, shape (height, width)
        LOG_SCALE ln(I + 8).
    frames : ndarray of float64, shape (k, 3, 3)
        Of the discs.
    polarity : ndarray of int, shape (k,)
        1 for dark targets, -1 for bright ones.
    code : DotFamily
    scales : ndarray of float, shape (n,), optional
        Radii that the discs may have instead, in radii of the frames.

    Returns
    -------
    ndarray of float64, shape (k, n)
        At most 1.
    """
    scales = np.ones(1) if scales is None else scales
    points = circle_points(_ANGLES, (scales[:, None] * _radii(code)).ravel())
    count = max(_PART // points[..., 0].size, 1)
    parts = [
        _mean_steps(sample(log, _project(frames[part], points)), polarity[part], len(scales))
        for part in (slice(it, it + count) for it in range(0, max(len(frames), 1), count))
    ]
    return np.concatenate(parts)


def _project(frames: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the images of points, shape (m, n, 2), in frames, shape (k, m, n, 2), as float32.

    That is exact enough for samples, and much faster than `project`.
    """
    flat = np.concatenate([points.reshape(-1, 2), np.ones((points[..., 0].size, 1))], axis=1)
    images = flat.astype(np.float32) @ frames.transpose(0, 2, 1).astype(np.float32)
    pixels: np.ndarray = images[..., :2] / images[..., 2:]
    return pixels.reshape(-1, *points.shape)


def _radii(code: DotFamily) -> np.ndarray:
    """Return the radii between which the edges of disc, ground and border lie."""
    gap = (code.dot_circle - code.dot_radius - 1) / 2
    ground = (code.dot_circle + code.dot_radius + code.ground_radius) / 2
    ink = (code.ground_radius + code.border_radius) / 2
    return np.array([1 - gap, 1 + gap, ground, ink, 2 * code.border_radius - ink])


def _mean_steps(values: np.ndarray, polarity: np.ndarray, count: int) -> np.ndarray:
    """Return the mean steps from values of the log on rays, shape (k, rays, 5 count)."""
    values = values.reshape(len(values), _RAYS, count, _EDGE_SIDES).astype(np.float32)
    steps = values[..., [1, 2, 4]] - values[..., [0, 3, 3]]
    steps *= (polarity / LOG_SCALE)[:, None, None, None]
    usual = np.maximum(np.median(steps[..., 0], axis=1), _MINIMUM_STEP)
    means: np.ndarray = np.clip(steps / usual[:, None, :, None], -1, 1).mean(axis=(1, 3))
    return means.astype(np.float64)
