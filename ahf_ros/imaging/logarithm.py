"""From gray values to logarithms, and from filtered logarithms back to 8 bit."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np

from ahf_ros.imaging.image import brightest

LOG_OFFSET = 8.0
"""Added to a gray value, of 255, before a logarithm in which edges are looked for: about where
noise drowns contrast."""

SAMPLE_ROWS, SAMPLE_COLUMNS = 32, 1024
"""Rows and columns on whose crossings the output mapping looks at the filtered image."""

MINIMUM_CONTRAST = 1e-3
"""Smallest difference of s between black and white; a flatter image stays gray."""


def logarithm(image: np.ndarray, offset: float) -> np.ndarray:
    """Return z = ln(image / range + offset); 8- and 16-bit images by look-up.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
        Gray values, at least 0 and somewhere above.
    offset : float
        As a share of the range, > 0.

    Returns
    -------
    ndarray of float32, shape (height, width)
        From ln(offset) to ln(1 + offset). The range is 255 for 8-bit images; the largest number
        of the bit depth for 16-bit images, the depth being the smallest from 8 to 16 that holds
        the brightest pixel; and that pixel for float images, hot pixels left out.
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
    """Return `scale` and `zero` with which exp(s + scale) - zero is the 8-bit image.

    Parameters
    ----------
    samples : ndarray
        Values of s, the logarithm of the image to be mapped.
    black_percentile, white_percentile : float
        Percentiles of exp s that become 0 and 255, in percent.
    """
    percentiles = np.percentile(samples, (black_percentile, white_percentile))
    black, white = (float(value) for value in percentiles)
    missing = max(MINIMUM_CONTRAST - (white - black), 0.0)
    zero = 255 / math.expm1(white - black + missing)
    return math.log(zero) - (black - missing / 2), zero


@lru_cache(maxsize=16)
def sample_lattice(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows and the columns that the output mapping looks at, ascending."""
    # one at random in every interval: even steps would fall in step with projected stripes
    generator = np.random.default_rng(0)
    lattice = []
    for length, count in ((height, SAMPLE_ROWS), (width, SAMPLE_COLUMNS)):
        edges = np.linspace(0, length, min(length, count) + 1).astype(int)
        lattice.append(generator.integers(edges[:-1], edges[1:]))
    return lattice[0], lattice[1]


def sampled(values: np.ndarray) -> np.ndarray:
    """Return `values`, shape (height, width), on the crossings of `sample_lattice`."""
    return values[np.ix_(*sample_lattice(*values.shape))]
