"""Otsu's threshold in overlapping blocks, interpolated bilinearly from block to block."""

from __future__ import annotations

import cv2
import numpy as np

_LEVELS = 256  # of gray values
_MINIMUM_CONTRAST = 20.0  # difference of the means of the two classes for a block to have any


def local_otsu(gray: np.ndarray, side: int) -> np.ndarray:
    """Return a threshold for every pixel.

    Blocks overlap by half. One that has no contrast takes the thresholds of those about it.

    Parameters
    ----------
    gray : ndarray of uint8, shape (height, width)
    side : int
        Of a block, px, at least 2.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Gray values.

    References
    ----------
    Otsu, IEEE Trans. Systems, Man and Cybernetics 9, 1979, 62-66.

    Examples
    --------
    >>> gray = np.where(np.arange(64) < 32, 40, 200).astype(np.uint8)
    >>> bool(((local_otsu(np.tile(gray, (64, 1)), 32) - 120) ** 2 < 1).all())
    True
    """
    height, width = gray.shape
    tile = max(side // 2, 1)
    rows, columns = -(-height // tile), -(-width // tile)
    rows_of, columns_of = np.arange(height) // tile, np.arange(width) // tile
    of_pixel = (rows_of[:, None] * columns + columns_of) * _LEVELS + gray
    tiles = np.bincount(of_pixel.ravel(), minlength=rows * columns * _LEVELS)
    tiles = np.pad(tiles.reshape(rows, columns, _LEVELS), ((1, 1), (1, 1), (0, 0)))
    blocks = tiles[:-1, :-1] + tiles[1:, :-1] + tiles[:-1, 1:] + tiles[1:, 1:]
    thresholds, contrast = otsu(blocks)
    grid = _filled(thresholds, contrast >= _MINIMUM_CONTRAST)
    # Block (i, j) has its middle at pixel (i, j) tile - 0.5.
    x = ((np.arange(width) + 0.5) / tile).astype(np.float32)
    y = ((np.arange(height) + 0.5) / tile).astype(np.float32)
    across, down = np.meshgrid(x, y)
    return cv2.remap(grid, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def otsu(histograms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the thresholds that part histograms best, and the distance of the two means.

    Parameters
    ----------
    histograms : ndarray of int, shape (..., n)
        Counts of the values 0 to n - 1.

    Returns
    -------
    thresholds, contrast : ndarray of float64, shape (...)
        The threshold is halfway between the means of the two classes.
    """
    levels = np.arange(histograms.shape[-1])
    below = np.cumsum(histograms, axis=-1).astype(np.float64)
    first = np.cumsum(histograms * levels, axis=-1).astype(np.float64)
    above, second = below[..., -1:] - below, first[..., -1:] - first
    low, high = first / np.maximum(below, 1), second / np.maximum(above, 1)
    between = below * above * (high - low) ** 2
    best = between.argmax(axis=-1)[..., None]
    low, high = (np.take_along_axis(mean, best, axis=-1)[..., 0] for mean in (low, high))
    parted = np.take_along_axis(between, best, axis=-1)[..., 0] > 0
    return (low + high) / 2, np.where(parted, high - low, 0.0)


def _filled(thresholds: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Return thresholds, those that are not valid from their neighbours, ndarray of float32."""
    values = np.where(valid, thresholds, 0.0).astype(np.float32)
    weights = valid.astype(np.float32)
    filled, known = values.copy(), valid.copy()
    reach = 3
    while not known.all() and reach < 4 * max(valid.shape):
        mass = cv2.blur(weights, (reach, reach), borderType=cv2.BORDER_CONSTANT)
        mean = cv2.blur(values, (reach, reach), borderType=cv2.BORDER_CONSTANT)
        new = ~known & (mass > 0)
        filled[new] = mean[new] / mass[new]
        known |= new
        reach = 2 * reach + 1
    return filled
