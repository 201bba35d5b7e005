"""Interpolation in images of any size, which `cv2.remap` does in images of less than 32767 px."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

LARGEST = 32_766
"""Longest side of an image, and of a map, that OpenCV takes, px."""

_POINTS = 16_384  # in an image that is too large, at a time


def remapped(
    image: np.ndarray, x: np.ndarray, y: np.ndarray | None, border: int = cv2.BORDER_REPLICATE
) -> np.ndarray:
    """Return the bilinearly interpolated values of an image at places, of its dtype.

    Beyond the border of an image that is taken in parts the nearest pixel counts.

    Parameters
    ----------
    image : ndarray of uint8, uint16, int16 or float32, shape (height, width)
    x, y : ndarray of float32, shape (n, m)
        Columns and rows, px; or x of shape (n, m, 2) with both, and y None.
    border : int
        What lies beyond the border of other images, as in OpenCV.

    Returns
    -------
    ndarray, shape (n, m)
    """
    if max(image.shape + x.shape) <= LARGEST:
        return cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=border)  # type: ignore[arg-type]
    if y is None:
        x, y = x[..., 0], x[..., 1]
    shape, (height, width) = x.shape, image.shape
    x, y = np.clip(x.reshape(1, -1), 0, width - 1), np.clip(y.reshape(1, -1), 0, height - 1)
    values = np.empty(x.shape, image.dtype)
    for top, bottom in _spans(height):
        rows = np.flatnonzero((y[0] >= top) & (y[0] < bottom))
        for left, right in _spans(width):
            across = x[0, rows]
            which = rows[(across >= left) & (across < right)]
            part = image[top : bottom + 1, left : right + 1] if which.size else image
            for start in range(0, which.size, _POINTS):
                some = which[start : start + _POINTS]
                at = x[:, some] - np.float32(left), y[:, some] - np.float32(top)
                values[:, some] = cv2.remap(part, *at, cv2.INTER_LINEAR)
    return values.reshape(shape)


def _spans(side: int) -> Iterator[tuple[int, int]]:
    """Yield the bounds of parts of a side, each short enough with the next pixel."""
    for start in range(0, side, LARGEST - 1):
        yield start, min(start + LARGEST - 1, side)
