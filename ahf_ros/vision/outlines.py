"""Closed outlines of regions, as `cv2.findContours` gives them: measured all at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros import kernels


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
    points = np.concatenate([np.zeros((0, 1, 2), np.int32), *outlines])[:, 0]
    ends = np.cumsum([*map(len, outlines)], dtype=np.int64)
    found: tuple[np.ndarray, np.ndarray, np.ndarray] = kernels.outline_sizes(points, ends)
    return found
