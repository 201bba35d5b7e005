"""What this package accepts as an image."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

MINIMUM_SIDE = 16
"""Smallest width and height of an image, px: less cannot hold one readable target."""

HOT_SHARE = 100_000
"""One pixel of so many may be hot, brighter than any light in the image."""

IMAGE_TYPES = (np.uint8, np.uint16, np.float32, np.float64)
"""Accepted types of a pixel, in the byte order of the machine."""


def check_image(image: Any, name: str = 'image') -> None:
    """Raise unless `image` is a gray image that can show something.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
        Radiance or gray values, linear or not, any strides; floats on any scale.
    name : str
        How the error calls it.

    Raises
    ------
    ValueError
        If `image` is not a two-dimensional array of an accepted type, is narrower or lower than
        `MINIMUM_SIDE`, is constant, or is a float image with a NaN, infinite or negative pixel.
        The message names the image, what it was and what is accepted.
    """
    if not isinstance(image, np.ndarray):
        raise ValueError(f'{name} is a {type(image).__name__}, accepted is a numpy array')
    if image.ndim != 2:
        raise ValueError(f'{name} has shape {image.shape}, accepted is (height, width)')
    if image.dtype not in IMAGE_TYPES:
        accepted = ', '.join(np.dtype(kind).name for kind in IMAGE_TYPES)
        raise ValueError(f'{name} has pixels of type {image.dtype}, accepted is one of {accepted}')
    height, width = image.shape
    if min(height, width) < MINIMUM_SIDE:
        raise ValueError(
            f'{name} is {width} x {height} px, '
            f'accepted is at least {MINIMUM_SIDE} x {MINIMUM_SIDE} px'
        )
    _check_values(image, name)


def _check_values(image: np.ndarray, name: str) -> None:
    lowest, highest = image.min(), image.max()  # both NaN where one pixel is
    if not (np.isfinite(lowest) and np.isfinite(highest)):
        raise ValueError(f'{name} has NaN or infinite pixels, accepted are finite values')
    if lowest < 0:
        raise ValueError(f'{name} has pixels down to {lowest:g}, accepted is at least 0')
    if lowest == highest:
        raise ValueError(
            f'{name} is constant, {highest:g} everywhere, accepted is one with contrast'
        )


def brightest(image: np.ndarray) -> float:
    """Return the gray value of the brightest light in an image, hot pixels left out."""
    rank = image.size - 1 - image.size // HOT_SHARE
    return float(np.partition(image, rank, axis=None)[rank]) or float(image.max())


def as_gray(image: np.ndarray) -> np.ndarray:
    """Return gray values from 0 to 255, of which an 8-bit image is its own.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)

    Returns
    -------
    ndarray of uint8 or float32, shape (height, width)
        Other images are scaled by their brightest light, so that it does not matter how many bits
        of a type are used, or whether a pixel is hot.
    """
    if image.dtype == np.uint8:
        return image
    kind = np.float64 if image.dtype == np.float64 else np.float32
    share = image / kind(brightest(image))
    return np.minimum(255 * share, 255).astype(np.float32)


def stretched_to_8_bit(image: np.ndarray) -> np.ndarray:
    """Return an image with its extremes at 0 and 255, uint8; an 8-bit image is its own result.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
    """
    if image.dtype == np.uint8:
        return image
    scaled = np.empty(image.shape, np.uint8)
    return cv2.normalize(image, scaled, 0, 255, cv2.NORM_MINMAX, cv2.CV_8U)
