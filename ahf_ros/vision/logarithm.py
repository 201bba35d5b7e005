"""Logarithms of images, and the mapping of filtered logarithms to 8 bit."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np

from ahf_ros.vision.image import brightest

LOG_OFFSET = 8.0
"""Added to gray values, 0 to 255, before a logarithm that is searched for edges: about where noise
hides contrast."""

MINIMUM_CONTRAST = 1e-3
"""Minimum difference of s between black and white; a flatter image stays gray."""


def logarithm(image: np.ndarray, offset: float) -> np.ndarray:
    """Return z = ln(image / range + offset), float32; for 8- and 16-bit images from a table.

    The offset is a fraction of the range, > 0. The range is 255 for 8-bit images. For 16-bit
    images it is the maximum of their bit depth, the minimum depth from 8 to 16 that holds
    `brightest`. For float images it is `brightest`.
    """
    if image.dtype.kind == 'f':
        share = (image / brightest(image)).astype(np.float32)
        return np.log(share + np.float32(offset))
    depth = 8 if image.dtype == np.uint8 else max(8, int(brightest(image)).bit_length())
    share = np.arange(np.iinfo(image.dtype).max + 1) / (2**depth - 1)
    table = np.log(share + offset).astype(np.float32)
    return cv2.LUT(image, table) if image.dtype == np.uint8 else table[image]


def mapping(
    samples: np.ndarray, black_percentile: float, white_percentile: float
) -> tuple[float, float]:
    """Return `scale` and `zero` such that exp(s + scale) - zero is the 8-bit image.

    `samples` are values of s, the logarithm of the image. The percentiles, %, are those of exp s
    that become 0 and 255.
    """
    percentiles = np.percentile(samples, (black_percentile, white_percentile))
    black, white = (float(value) for value in percentiles)
    missing = max(MINIMUM_CONTRAST - (white - black), 0.0)
    zero = 255 / math.expm1(white - black + missing)
    return math.log(zero) - (black - missing / 2), zero


@lru_cache(maxsize=16)
def sample_lattice(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows and the columns of the lattice of the output mapping, ascending."""
    # one at random per interval: even steps could coincide with projected stripes
    generator = np.random.default_rng(0)

    def places(length: int, count: int) -> np.ndarray:
        edges = np.linspace(0, length, min(length, count) + 1).astype(int)
        return generator.integers(edges[:-1], edges[1:])

    return places(height, 32), places(width, 1024)
