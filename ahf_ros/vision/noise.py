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

from ahf_ros import kernels
from ahf_ros.vision.robust import NORMAL

_PLACES = 12  # along either side of the square about a target
_DIFFERENCE = 6.0  # root of the sum of the squares of its factors
_APART = 8  # rows, of which three tell the noise of an image
_INTERPOLATED = 2 / 3  # mean share of the noise of pixels that bilinear values have


def reading_noise(gray: np.ndarray, frames: np.ndarray, radius: float) -> np.ndarray:
    """Return the standard deviation of the noise of interpolated gray values, shape (k,).

    It is the usual one in squares about targets, of half a side of `radius`, dot radii.
    """
    along = radius * (2 * (np.arange(_PLACES) + 0.5) / _PLACES - 1)
    points = np.stack(np.meshgrid(along, along)).reshape(2, -1)
    sizes, _ = kernels.second_differences(gray, frames, points)
    return np.asarray(sizes * (NORMAL * _INTERPOLATED / _DIFFERENCE))


def usual_noise(image: np.ndarray) -> float:
    """Return the usual standard deviation of the noise of an image of uint8, by some of its rows.

    It has at least 8 rows and 3 columns.
    """
    height, width = image.shape
    rows = image[: height // _APART * _APART].reshape(-1, _APART, width)[:, :3].astype(np.int16)
    across = rows[..., 2:] - 2 * rows[..., 1:-1] + rows[..., :-2]
    sizes = np.abs(across[:, 0] - 2 * across[:, 1] + across[:, 2])
    return NORMAL * _median(sizes.ravel()) / _DIFFERENCE


def _median(values: np.ndarray) -> float:
    """Return the median of small integers from 0 on, (n,), which are counted and not sorted."""
    up_to = np.cumsum(np.bincount(values))
    middle = (values.size - 1) // 2, values.size // 2
    return float(np.searchsorted(up_to, middle, side='right').mean())
