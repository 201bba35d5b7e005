"""Whole outlines: connected edges that form an ellipse all by themselves."""

from __future__ import annotations

import cv2
import numpy as np

from ahf_ros.features.dots import Dots, best
from ahf_ros.features.frame import affine_frames
from ahf_ros.features.log_edges import LogEdges

MAXIMUM_OUTLINES = 20_000
"""Whole ellipses kept at the most, those that are most exactly ellipses."""

_MAXIMUM_SPREAD = 0.15  # of the radius, of the points of a whole ellipse
_MINIMUM_AGREEMENT = 0.7  # mean of the signs of their gradients along the outward direction
_MINIMUM_LENGTH = 0.6  # of an outline, in circumferences of the smallest circle, in edge pixels
_MAXIMUM_LENGTH = 1.1  # the same, in circumferences of the largest
_MINIMUM_MINOR = 1.0  # px
_DEGENERATE = 1e-6  # px^4, smallest determinant of a covariance, of a line


def whole_outlines(edges: LogEdges, min_radius: float, max_radius: float) -> Dots:
    """Return the ellipses that whole connected edges form, at any tilt.

    Parameters
    ----------
    edges : LogEdges
    min_radius, max_radius : float
        Bounds of the semi-major axis, px of the edges.

    Returns
    -------
    Dots
        In pixels of the edges.
    """
    label, pixels, count = _connected(edges, min_radius, max_radius)

    def mean(values: np.ndarray) -> np.ndarray:
        sums = np.bincount(label, values, minlength=count)
        return sums / np.maximum(np.bincount(label, minlength=count), 1)

    x, y = pixels.x.astype(np.float64), pixels.y.astype(np.float64)
    centre_x, centre_y = mean(x), mean(y)
    x, y = x - centre_x[label], y - centre_y[label]
    # The points of an ellipse have half of its squared axes as their covariance.
    xx, xy, yy = 2 * mean(x * x), 2 * mean(x * y), 2 * mean(y * y)
    determinant = np.maximum(xx * yy - xy * xy, _DEGENERATE)[label]
    radius = (yy[label] * x * x - 2 * xy[label] * x * y + xx[label] * y * y) / determinant
    spread = np.sqrt(mean((np.sqrt(np.maximum(radius, 0)) - 1) ** 2))
    outwards = mean(np.sign(pixels.unit_x * x + pixels.unit_y * y))
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    major, minor = np.sqrt(middle + half), np.sqrt(np.maximum(middle - half, 0))
    good = (spread < _MAXIMUM_SPREAD) & (np.abs(outwards) > _MINIMUM_AGREEMENT)
    good &= (major >= min_radius) & (major <= max_radius) & (minor >= _MINIMUM_MINOR)
    kept = best(np.flatnonzero(good), spread[good], MAXIMUM_OUTLINES, 'whole ellipses')
    frames = affine_frames(centre_x, centre_y, major, minor, np.arctan2(xy, (xx - yy) / 2) / 2)
    return Dots(frames[kept], np.sign(outwards[kept]).astype(int), np.ones(len(kept)))


def _connected(
    edges: LogEdges, min_radius: float, max_radius: float
) -> tuple[np.ndarray, LogEdges, int]:
    """Return the connected edges of the right length: labels of pixels, these, and the number."""
    count, labels = cv2.connectedComponents(edges.marked, connectivity=8, ltype=cv2.CV_32S)
    label = labels[edges.y, edges.x]
    size = np.bincount(label, minlength=count)
    usable = size > 2 * np.pi * min_radius * _MINIMUM_LENGTH
    usable &= size < 2 * np.pi * max_radius * _MAXIMUM_LENGTH
    number = np.cumsum(usable) - 1
    kept = usable[label]
    return number[label[kept]], edges.select(kept), int(usable.sum())
