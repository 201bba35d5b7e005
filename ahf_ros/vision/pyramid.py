"""The pyramid of an image: its halves, their logarithms and the edges in these.

In ln I an edge of a target is a step of the same height wherever the light falls.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil, log2

import cv2
import numpy as np

from ahf_ros.vision.common_search import CommonSearch
from ahf_ros.vision.log_edges import LOG_SCALE, LogEdges, find_edges
from ahf_ros.vision.logarithm import LOG_OFFSET

MAXIMUM_RADIUS = 11.2
"""Largest radius of a dot that is voted for on one level, px; larger ones take a higher level."""

MINIMUM_ASPECT = 0.2
"""Ratio of the axes of a dot, at the least."""

_OCTAVE_LEVELS = 3  # of the halves in which the dots of an octave are voted for
_ROWS = 32  # of an image that are converted at a time, which stay in the cache
_ABOVE, _SLACK = 1.01, 1.03  # of the bounds of octaves, which overlap by less than votes do


@dataclass(frozen=True, slots=True)
class ImagePyramid:
    """An image and its halves; pixel (x, y) of a level covers four of the level below."""

    image: np.ndarray  # gray values from 0 to 255, uint8 or float32, (height, width)
    halves: tuple[np.ndarray, ...]  # gray values, uint8 or float32, from the first half on
    logs: tuple[np.ndarray, ...]  # of each level, the image as received first; see `log_image`
    edges: tuple[LogEdges, ...]  # from the first half on: `edges[i]` belongs to `logs[i + 1]`
    contrast: int = 1  # times the steps in `logs`
    common: CommonSearch | None = None  # of the detectors that share it, in the first octave

    @property
    def gray(self) -> np.ndarray:
        """Gray values, float32. Those of uint8 are made anew: memory is rarer than time."""
        return self.image.astype(np.float32, copy=False)

    @property
    def images(self) -> tuple[np.ndarray, ...]:
        """The image and its halves."""
        return self.image, *self.halves

    def half(self, level: int) -> ImagePyramid:
        """Return the pyramid of the image that is halved so many times."""
        image, *halves = self.images[level:]
        return replace(
            self,
            image=image,
            halves=tuple(halves),
            logs=self.logs[level:],
            edges=self.edges[level:],
            common=None if level else self.common,
        )


@dataclass(frozen=True, slots=True)
class Octave:
    """The radii of dots that are read in an image, or in a half of it."""

    level: int  # how often the image is halved
    pyramid: ImagePyramid  # of that half
    radii: tuple[float, float]  # smallest and largest radius of the dots, px of that half


def image_pyramid(gray: np.ndarray, max_radius: float, contrast: int = 1) -> ImagePyramid:
    """Return the pyramid of an image, uint8 or float32 from 0 to 255, to find dots in.

    The largest radius of a dot, px, decides how often the image is halved. No dot is larger than
    the image, nor does a narrow image show one flatter than `MINIMUM_ASPECT`. Edges are those of
    so many times the contrast.
    """
    bare = bare_pyramid(gray, max_radius)
    logs = tuple(log_image(level, contrast) for level in bare.images)
    edges = tuple(find_edges(log) for log in logs[1:])
    return replace(bare, logs=logs, edges=edges, contrast=contrast)


def bare_pyramid(gray: np.ndarray, max_radius: float) -> ImagePyramid:
    """Return the same without logarithms and edges, to measure dots in that are known."""
    narrow, wide = sorted(gray.shape)
    largest = min(max_radius, wide / 2, narrow / 2 / MINIMUM_ASPECT)
    image, *halves = halved(gray, max(1, ceil(log2(largest / MAXIMUM_RADIUS))))
    return ImagePyramid(image, tuple(halves), (), ())


def octaves(pyramid: ImagePyramid, min_radius: float, max_radius: float) -> Iterator[Octave]:
    """Yield the octaves of the radii of dots, small dots first.

    Dots of up to 90 px are read in the image as it is. Each octave of larger ones is read in an
    image half the size of the one before, so that a dot never has more pixels than it needs. The
    bounds of the radius are px of the image.
    """
    largest = MAXIMUM_RADIUS * 2**_OCTAVE_LEVELS
    for level in range(max(1, len(pyramid.halves) - _OCTAVE_LEVELS + 1)):
        smallest = largest / 2 * _ABOVE if level else 0.0
        low = max(min_radius / 2**level, smallest)
        high = min(max_radius / 2**level, largest * _SLACK)
        if low <= high:
            yield Octave(level, pyramid.half(level), (low, high))


def halved(image: np.ndarray, levels: int) -> list[np.ndarray]:
    """Return an image and its halves, each pixel the mean of four of the one before."""
    images = [image]
    for _ in range(levels):
        height, width = (max(side // 2, 1) for side in images[-1].shape)
        even = images[-1][: 2 * height, : 2 * width]
        images.append(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA))
    return images


def log_image(gray: np.ndarray, contrast: int = 1) -> np.ndarray:
    """Return LOG_SCALE ln(I + LOG_OFFSET), int16, of an image, uint8 or float32 from 0 to 255.

    Its whole numbers are multiplied by `contrast`.
    """
    if gray.dtype == np.uint8:
        table = LOG_SCALE * np.log(np.arange(256) + LOG_OFFSET)
        return cv2.LUT(gray, contrast * table.astype(np.int16))
    log = np.empty(gray.shape, np.int16)
    for start in range(0, len(gray), _ROWS):
        values = gray[start : start + _ROWS] + np.float32(LOG_OFFSET)
        cv2.log(values, values)
        values *= np.float32(LOG_SCALE)
        log[start : start + _ROWS] = values
    log *= contrast
    return log
