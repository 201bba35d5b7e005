"""The images that results are about: where they are now, and what a filter makes of them.

Pictures of them are as large and as good as a number of bytes allows.
"""

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ahf_ros.files.image_files import find_image, read_image
from ahf_ros.identification.filtering.homomorphic import HomomorphicFilter
from ahf_ros.identification.filtering.settings import FilterSettings
from ahf_ros.views.report.results import ImageResult
from ahf_ros.vision.image import stretched_to_8_bit
from ahf_ros.vision.stack import ImageStack, unlike

_THUMBNAIL_SIDES = 132, 88  # maximum width and height, px
_THUMBNAIL_BYTES = 3000
_SIZES = {88: 1.75, 80: 1.4, 70: 1.15, 58: 1.0, 46: 0.85, 34: 0.7, 24: 0.58}
"""About how many bytes a quality takes, as a fraction of the medium one."""

_BEST, *_, _WORST = _SIZES
_MIDDLE = 58
_BITS = 1.1  # of a picture at first, per pixel; photographs of targets need 0.3 to 1.5
_AIMED = 1.2  # times the bytes of the medium quality: the one above it
_REDUCED = 0.85  # the same for a picture that has to be smaller; it keeps more pixels
_MAXIMUM_STEP = 6.0  # from one size to the next, in pixels
_MAXIMUM_WEBP = 2_000_000  # px; it takes 0.6 s per million
_MAXIMUM_WEBP_SIDE = 16_383  # px, of the format
_MINIMUM_SIDE = 16  # px, the longer side


def shown_image(
    result: ImageResult, folders: Sequence[Path] = ()
) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the image of a result, and the filtered one if a filter was applied, of uint8.

    The image of a stack is its combination. `folders` are as for `find_image`. A ValueError names
    an image that is not there, cannot be read, or is not of the size of the result.
    """
    names = result.images if result.combination else (result.image,)
    images = [_read(name, result, folders) for name in names]
    for name, image in zip(names[1:], images[1:], strict=True):
        if difference := unlike(images[0], image):
            raise ValueError(f'{name} {difference}')
    try:
        stack = ImageStack(tuple(images))
        image = stack.combined(result.combination) if result.combination else images[0]
        filtered = _filtered(image, result) if result.filter.applied else None
    except ValueError as error:
        raise ValueError(f'{result.image}: {error}') from error
    return stretched_to_8_bit(image), filtered


def _read(name: str, result: ImageResult, folders: Sequence[Path]) -> np.ndarray:
    path = find_image(name, result.source, folders)
    image = read_image(path, upright=result.upright)
    size = image.shape[::-1]
    if result.width and size != (result.width, result.height):
        raise ValueError(
            f'{path} has {size[0]} x {size[1]} px, accepted is the size that the results were '
            f'found at, {result.width} x {result.height} px'
        )
    return image


def _filtered(image: np.ndarray, result: ImageResult) -> np.ndarray:
    used = result.filter
    return HomomorphicFilter(image, FilterSettings(**result.mapping)).filtered(
        used.gamma_high, used.gamma_low, used.cutoff or None, used.attenuation
    )


@dataclass(frozen=True, slots=True)
class Picture:
    """An encoded picture; `kind` is its media type, and its size is in px."""

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
    width, height = _THUMBNAIL_SIDES
    scale = min(width / image.shape[1], height / image.shape[0], 1.0)
    return fitted(_resized(image, scale), _THUMBNAIL_BYTES)


def fitted(image: np.ndarray, limit: int) -> Picture:
    """Return a picture of an image, ndarray of uint8, that takes at most `limit` bytes.

    Pictures of a few pixels may need more. It is WebP, or JPEG if it is large or OpenCV was built
    without WebP.

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
        if growing and scale < 1.0 and room > _SIZES[_BEST]:
            pixels *= min(room / _AIMED, _MAXIMUM_STEP)
            continue
        if picture := _best_of(reduced, probe, limit):
            return picture
        if max(reduced.shape) <= _MINIMUM_SIDE:
            return _encoded(reduced, _WORST)
        growing = False
        pixels = min(pixels, image.size) * min(max(room / _REDUCED, 1 / _MAXIMUM_STEP), 0.8)


def _best_of(image: np.ndarray, probe: Picture, limit: int) -> Picture | None:
    """Return the picture of the best quality that fits, by that of medium quality, or None."""
    for quality, size in _SIZES.items():
        if size * len(probe.content) > limit:
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
    small = image.size <= _MAXIMUM_WEBP and max(image.shape) <= _MAXIMUM_WEBP_SIDE
    if small and cv2.haveImageWriter('.webp'):
        _, content = cv2.imencode('.webp', image, [cv2.IMWRITE_WEBP_QUALITY, quality])
        return Picture(content.tobytes(), 'image/webp', width, height)
    _, content = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return Picture(content.tobytes(), 'image/jpeg', width, height)
