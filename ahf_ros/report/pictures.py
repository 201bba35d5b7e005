"""Pictures of images, as large and as good as a number of bytes allows."""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass

import cv2
import numpy as np

THUMBNAIL_SIDES = 132, 88
"""Maximum width and height of a thumbnail, px."""

_THUMBNAIL_BYTES = 3000
_SIZES = {88: 1.75, 80: 1.4, 70: 1.15, 58: 1.0, 46: 0.85, 34: 0.7, 24: 0.58}
"""About how many bytes a quality takes, as a fraction of the medium one."""

_QUALITIES = tuple(_SIZES)
_MIDDLE = 58
_BITS = 1.1  # of a picture at first, per pixel; photographs of targets need 0.3 to 1.5
_AIMED = 1.2  # times the bytes of the medium quality: the one above it
_REDUCED = 0.85  # the same for a picture that has to be smaller; it keeps more pixels
_MAXIMUM_STEP = 6.0  # from one size to the next, in pixels
_MAXIMUM_WEBP = 2_000_000  # px; it takes 0.6 s per million
_MINIMUM_SIDE = 16  # px, the longer side


@dataclass(frozen=True, slots=True)
class Picture:
    """An encoded picture.

    Attributes
    ----------
    content : bytes
    kind : str
        Its media type.
    width, height : int
        Its size, px.
    """

    content: bytes
    kind: str
    width: int
    height: int

    @property
    def base64(self) -> str:
        """The content as text."""
        return base64.b64encode(self.content).decode('ascii')


def thumbnail(image: np.ndarray) -> Picture:
    """Return a small picture of an image, ndarray of uint8, shape (height, width)."""
    width, height = THUMBNAIL_SIDES
    scale = min(width / image.shape[1], height / image.shape[0], 1.0)
    return fitted(_resized(image, scale), _THUMBNAIL_BYTES)


def fitted(image: np.ndarray, limit: int) -> Picture:
    """Return a picture of an image that takes no more than a number of bytes.

    It is WebP, or JPEG if it is large or OpenCV was built without WebP.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
    limit : int
        Maximum number of bytes; pictures of a few pixels may need more.

    Examples
    --------
    >>> ramp = np.add.outer(np.arange(400), np.arange(600)).astype(np.uint8)
    >>> picture = fitted(ramp, 5000)
    >>> len(picture.content) <= 5000, picture.kind
    (True, 'image/webp')
    """
    pixels, growing = 8 * limit / _BITS, True
    while True:
        scale = min(1.0, math.sqrt(pixels / image.size))
        reduced = _resized(image, scale)
        probe = _encoded(reduced, _MIDDLE)
        room = limit / len(probe.content)
        if growing and scale < 1.0 and room > _SIZES[_QUALITIES[0]]:
            pixels *= min(room / _AIMED, _MAXIMUM_STEP)
            continue
        if picture := _best_of(reduced, probe, limit):
            return picture
        if max(reduced.shape) <= _MINIMUM_SIDE:
            return _encoded(reduced, _QUALITIES[-1])
        growing = False
        pixels = min(pixels, image.size) * min(max(room / _REDUCED, 1 / _MAXIMUM_STEP), 0.8)


def _best_of(image: np.ndarray, probe: Picture, limit: int) -> Picture | None:
    """Return the picture of the best quality that fits; None if none does.

    `probe` is the picture of medium quality, which shows what sizes may fit.
    """
    size = len(probe.content)
    for quality in _QUALITIES:
        if _SIZES[quality] * size > limit:
            continue
        picture = probe if quality == _MIDDLE else _encoded(image, quality)
        if len(picture.content) <= limit:
            return picture
    return None


def _resized(image: np.ndarray, scale: float) -> np.ndarray:
    if scale >= 1.0:
        return image
    height, width = image.shape
    size = (max(1, round(scale * width)), max(1, round(scale * height)))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def _encoded(image: np.ndarray, quality: int) -> Picture:
    height, width = image.shape
    if image.size <= _MAXIMUM_WEBP and cv2.haveImageWriter('.webp'):
        _, content = cv2.imencode('.webp', image, [cv2.IMWRITE_WEBP_QUALITY, quality])
        return Picture(content.tobytes(), 'image/webp', width, height)
    _, content = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return Picture(content.tobytes(), 'image/jpeg', width, height)
