"""Images that the package accepts, and their gray values."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

MINIMUM_SIDE = 16
"""Minimum width and height of an image, px; a smaller one cannot show a readable target."""

SATURATED = 253.0
"""Gray value from which a reading is white, whatever the light."""

GAMMA = 2.2
"""Gray values are taken to be light to the power of 1 / `GAMMA`, unless they are light."""

IMAGE_TYPES = (np.uint8, np.uint16, np.float32, np.float64)
"""Accepted pixel types, in the byte order of the machine."""

_MAXIMUM_SIDE = 65_500  # px; JPEG files have no longer ones
_MAXIMUM_PIXELS = 2**28  # a filter takes some 30 bytes for each
_HOT_SHARE = 100_000  # one pixel in so many may be brighter than any light in the image
_MUCH_WHITE = 0.3  # share of an image
_ROWS = 64  # that are scaled at a time, so that large images need no copies


def check_image(image: Any, name: str = 'image') -> None:
    """Raise a ValueError unless `image` is a gray image with contrast, ndarray (height, width).

    It has radiance or gray values, linear or not, of one of `IMAGE_TYPES` with any strides, floats
    on any scale, finite and at least 0; it is no smaller than `MINIMUM_SIDE` and no larger than
    `check_size` accepts. The message begins with `name`.
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
    check_size(width, height, name)
    minimum, maximum = image.min(), image.max()  # both NaN if one pixel is
    if not (np.isfinite(minimum) and np.isfinite(maximum)):
        raise ValueError(f'{name} has NaN or infinite pixels, accepted are finite values')
    if minimum < 0:
        raise ValueError(f'{name} has pixels down to {minimum:g}, accepted is at least 0')
    if minimum == maximum:
        raise ValueError(
            f'{name} is constant, {maximum:g} everywhere, accepted is an image with contrast'
        )


def check_size(width: int, height: int, name: str) -> None:
    """Raise a ValueError if an image is too large, be it decoded or not yet; sides in px."""
    if max(width, height) > _MAXIMUM_SIDE or width * height > _MAXIMUM_PIXELS:
        raise ValueError(
            f'{name} is {width} x {height} px, accepted are sides of at most {_MAXIMUM_SIDE} px '
            f'and at most {_MAXIMUM_PIXELS} px in all'
        )


def as_oriented(image: np.ndarray, orientation: int) -> np.ndarray:
    """Return an image turned upright, from its orientation in Exif (CIPA DC-008, table 4).

    Orientations other than 1 to 8 are `UPRIGHT`.
    """
    if orientation in (5, 6, 7, 8):
        image = image.T
    if orientation in (3, 4, 7, 8):
        image = image[::-1]
    if orientation in (2, 3, 6, 7):
        image = image[:, ::-1]
    return np.ascontiguousarray(image)


def without_gaps(image: np.ndarray) -> np.ndarray:
    """Return an image in which pixels that are not finite are 0, unless all of them are not.

    Scanners and programs mark missing pixels like that.
    """
    if image.dtype.kind == 'f':
        finite = np.isfinite(image)
        if finite.any() and not finite.all():
            return np.where(finite, image, image.dtype.type(0))
    return image


def brightest(image: np.ndarray) -> float:
    """Return the gray value of the brightest light in an image, hot pixels excluded."""
    rank = image.size - 1 - image.size // _HOT_SHARE
    return float(np.partition(image, rank, axis=None)[rank]) or float(image.max())


def as_gray(image: np.ndarray) -> np.ndarray:
    """Return the gray values of an image on a scale from 0 to 255, uint8 or float32.

    An 8-bit image stays as it is. Others are scaled by their brightest light, so that neither the
    number of bits in use nor a hot pixel matters.
    """
    if image.dtype == np.uint8:
        return image
    kind = np.float64 if image.dtype == np.float64 else np.float32
    light, gray = kind(brightest(image)), np.empty(image.shape, np.float32)
    for top in range(0, len(image), _ROWS):
        gray[top : top + _ROWS] = np.minimum(255 * (image[top : top + _ROWS] / light), 255)
    return gray


def as_light(gray: np.ndarray) -> np.ndarray:
    """Return the light that gray values show, float32, from 0 to 255 as these."""
    return 255 * cv2.pow(np.maximum(gray, 0) / np.float32(255), GAMMA)


def stretched_to_8_bit(image: np.ndarray) -> np.ndarray:
    """Return an image with its extremes at 0 and 255, uint8; an 8-bit image is its own result."""
    if image.dtype == np.uint8:
        return image
    scaled = np.empty(image.shape, np.uint8)
    return cv2.normalize(image, scaled, 0, 255, cv2.NORM_MINMAX, cv2.CV_8U)


def white_remark(image: np.ndarray) -> str:
    """Return what it means that much of an image is white; empty if little is.

    Where light makes ink as white as paper, gaps or bands of targets vanish.

    Examples
    --------
    >>> white_remark(np.full((20, 20), 255, np.uint8)).partition(': ')
    ('100 % of the image is white', ': ', 'gaps or bands of targets may have vanished')
    """
    share = float((as_gray(image) >= SATURATED).mean())
    if share < _MUCH_WHITE:
        return ''
    return f'{100 * share:.0f} % of the image is white: gaps or bands of targets may have vanished'
