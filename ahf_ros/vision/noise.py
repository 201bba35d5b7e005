"""The noise of an image about targets, which edges of light do not pass for.

The second difference of rows, of the second difference of columns, has the noise of six pixels and
next to nothing of edges, as long as these are straight for three pixels (Immerkær [1]_). The
median of its size over a target is that of noise, whatever light falls on it.

References
----------
.. [1] Immerkær, Fast noise variance estimation, Computer Vision and Image Understanding 64(2),
   1996, 300-302, eq. 2 to 4.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.vision import frame
from ahf_ros.vision.robust import NORMAL, medians

_PLACES = 12  # along either side of the square about a target
_SECOND = np.array([1, -2, 1], np.float32)
_DIFFERENCE = np.outer(_SECOND, _SECOND)
_INTERPOLATED = 2 / 3  # mean share of the noise of pixels that bilinear values have


def reading_noise(gray: np.ndarray, frames: np.ndarray, radius: float) -> np.ndarray:
    """Return the standard deviation of the noise of interpolated gray values, shape (k,).

    It is the usual one in squares about targets, of half a side of `radius`, dot radii; `gray` is
    at least 3 px high and wide.
    """
    along = radius * (2 * (np.arange(_PLACES) + 0.5) / _PLACES - 1)
    points = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    height, width = gray.shape
    corners = np.rint(frame.project(frames, points)).astype(np.intp) - 1
    column, row = np.moveaxis(corners, -1, 0)
    row, column = np.clip(row, 0, height - 3), np.clip(column, 0, width - 3)
    first, values = row * width + column, gray.ravel()
    differences = np.zeros(first.shape, np.float32)
    for (down, across), factor in np.ndenumerate(_DIFFERENCE):
        differences += factor * values.take(first + (down * width + across))
    return medians(np.abs(differences)) * (NORMAL * _INTERPOLATED / np.linalg.norm(_DIFFERENCE))
