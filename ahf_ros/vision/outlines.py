"""Closed outlines of regions, as `cv2.findContours` gives them: measured all at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def points_of(outlines: Sequence[np.ndarray]) -> np.ndarray:
    """Return the points of outlines, shape (n, 1, 2) each, one after the other, (m, 2)."""
    return np.concatenate([np.zeros((0, 1, 2), np.int32), *outlines])[:, 0]


def measured(outlines: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the areas, lengths and boxes of k outlines of whole pixels, (n, 1, 2) each.

    Returns
    -------
    areas : ndarray of float64, shape (k,)
        px^2, positive for those that are clockwise in the image.
    lengths : ndarray of float64, shape (k,)
        px.
    boxes : ndarray of int, shape (k, 2)
        Width and height, px.

    Examples
    --------
    >>> measured([np.array([[[0, 0]], [[4, 0]], [[4, 3]]], np.int32)])
    (array([6.]), array([12.]), array([[5, 4]], dtype=int32))
    """
    x, y = points = np.ascontiguousarray(points_of(outlines).T)
    counts = np.array([*map(len, outlines)], int)
    first = np.cumsum(counts) - counts
    after = np.roll(points, -1, axis=1)
    after[:, first + counts - 1] = points[:, first]
    areas = np.add.reduceat(x * after[1] - y * after[0], first, dtype=np.float64) / 2
    lengths = np.add.reduceat(np.hypot(*(after - points)), first)
    boxes = np.maximum.reduceat(points, first, axis=1) - np.minimum.reduceat(points, first, axis=1)
    boxes = boxes.T + 1
    return areas, lengths, boxes
