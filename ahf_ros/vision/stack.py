"""Several images of one unmoved scene, combined into one.

Where a projector lights the scene with one pattern after the other, most points are lit in some
of the images. A combination shows the scene in a light that is more even than in any image
of the stack.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce

import cv2
import numpy as np

from ahf_ros.vision import MAXIMUM_IMAGES
from ahf_ros.vision.even_light import even_light
from ahf_ros.vision.image import GAMMA, brightest, check_image

_FLOOR = 2 / 255  # of the range; added to both sides of a quotient, about what noise adds
_STRIP = 64  # rows combined at a time, which stay in the cache of a core


@dataclass(frozen=True, slots=True, eq=False)
class ImageStack:
    """Images of one unmoved scene, of one size and pixel type.

    Attributes
    ----------
    images : tuple of ndarray of uint8, uint16, float32 or float64, shape (height, width)
        Images that `ahf_ros.vision.image.check_image` accepts, in the order in which they were
        taken.

    Raises
    ------
    ValueError
        If there is no image or there are too many, if an image is not accepted, or if they differ
        in size or pixel type.

    Examples
    --------
    >>> left, right = np.full((2, 16, 32), 20, np.uint8)
    >>> left[:, :16], right[:, 16:] = 200, 200
    >>> np.unique(ImageStack((left, right)).combined('largest'))
    array([200], dtype=uint8)
    """

    images: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        """Refuse images that do not fit each other."""
        count = len(self.images)
        if not 1 <= count <= MAXIMUM_IMAGES:
            raise ValueError(
                f'stack has {count} images, accepted is a number from 1 to {MAXIMUM_IMAGES}'
            )
        for number, image in enumerate(self.images, start=1):
            check_image(image, f'image {number} of the stack' if count > 1 else 'image')
            if difference := unlike(self.images[0], image):
                raise ValueError(f'image {number} of the stack {difference}')

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width, px."""
        height, width = self.images[0].shape
        return height, width

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the combinations, the most promising first; of one image empty, and itself."""
        return COMBINATIONS if len(self.images) > 1 else ('',)

    def combined(self, name: str) -> np.ndarray:
        """Return a combination, of the size and the pixel type of the images.

        Parameters
        ----------
        name : str
            One of `names`.

        Raises
        ------
        ValueError
            If there is no combination of this name.
        """
        if name not in self.names:
            raise ValueError(
                f'combination is {name!r}, accepted is one of {", ".join(self.names)}'
            )
        first = self.images[0]
        if not name:
            return first
        scale = max(map(brightest, self.images)) if first.dtype != np.uint8 else 255.0
        result = np.empty_like(first, order='C')
        if name == 'even_light':
            shares = (image.astype(np.float32) / np.float32(scale) for image in self.images)
            _store(even_light(shares) * np.float32(scale), result)
            return result
        for top in range(0, len(first), _STRIP):
            rows = slice(top, top + _STRIP)
            strips = [image[rows].astype(np.float32) / np.float32(scale) for image in self.images]
            _store(_POINTWISE[name](strips) * np.float32(scale), result[rows])
        return result


def unlike(first: np.ndarray, image: np.ndarray) -> str:
    """Return in what an image differs from the first one of its stack, with what is accepted.

    Empty where they have the same size and pixel type.
    """
    if image.shape != first.shape:
        (height, width), (wanted_height, wanted_width) = image.shape, first.shape
        return (
            f'is {width} x {height} px, accepted is the size of the first, '
            f'{wanted_width} x {wanted_height} px'
        )
    if image.dtype != first.dtype:
        return (
            f'has pixels of type {image.dtype}, accepted is the type of the first, {first.dtype}'
        )
    return ''


def _largest(images: Sequence[np.ndarray]) -> np.ndarray:
    return reduce(np.maximum, images)


def _mean_light(images: Sequence[np.ndarray]) -> np.ndarray:
    light = sum(cv2.pow(image, GAMMA) for image in images)
    return cv2.pow(light / np.float32(len(images)), 1 / GAMMA)


def _mean_gray(images: Sequence[np.ndarray]) -> np.ndarray:
    return sum(images) / np.float32(len(images))


def _quotient(images: Sequence[np.ndarray]) -> np.ndarray:
    """Return 1 - darkest / largest, which separates what shines from what is lit."""
    floor = np.float32(_FLOOR)
    return 1 - (reduce(np.minimum, images) + floor) / (_largest(images) + floor)


_POINTWISE: dict[str, Callable[[Sequence[np.ndarray]], np.ndarray]] = {
    'largest': _largest,
    'mean_light': _mean_light,
    'mean_gray': _mean_gray,
    'quotient': _quotient,
}

COMBINATIONS: tuple[str, ...] = ('even_light', *_POINTWISE)
"""Names of the combinations of several images, the most promising first."""


def _store(values: np.ndarray, result: np.ndarray) -> None:
    """Put values into an array, rounded and saturated where it holds integers."""
    if result.dtype.kind == 'u':
        values = np.clip(np.rint(values), 0, np.iinfo(result.dtype).max)
    result[...] = values
