"""The pyramid of an image: its halves, their logarithms and the edges in these.

In ln I an edge of a target is a step of the same height wherever the light falls.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log2

import cv2
import numpy as np

from ahf_ros.features.log_edges import LOG_SCALE, LogEdges, find_edges
from ahf_ros.imaging.logarithm import LOG_OFFSET

LARGEST_RADIUS = 11.2
"""Largest radius of a dot that is voted for on one level, px; larger ones take a higher level."""


@dataclass(frozen=True, slots=True)
class ImagePyramid:
    """An image and its halves; pixel (x, y) of a level covers four of the level below.

    Attributes
    ----------
    gray : ndarray of float32, shape (height, width)
        The image, gray values from 0 to 255.
    logs : tuple of ndarray of int16
        LOG_SCALE ln(I + LOG_OFFSET) of each level, the image as received first.
    edges : tuple of LogEdges
        Of each level from the first half on: `edges[i]` are those of `logs[i + 1]`.
    """

    gray: np.ndarray
    logs: tuple[np.ndarray, ...]
    edges: tuple[LogEdges, ...]


def image_pyramid(gray: np.ndarray, max_radius: float) -> ImagePyramid:
    """Return the pyramid of an image in which dots can be found.

    Parameters
    ----------
    gray : ndarray of uint8 or float32, shape (height, width)
        Gray values from 0 to 255.
    max_radius : float
        Largest radius of a dot, px; it decides how often the image is halved.
    """
    levels = max(1, ceil(log2(max_radius / LARGEST_RADIUS)))
    logs = tuple(log_image(level) for level in halved(gray, levels))
    edges = tuple(find_edges(log) for log in logs[1:])
    return ImagePyramid(gray.astype(np.float32, copy=False), logs, edges)


def halved(image: np.ndarray, levels: int) -> list[np.ndarray]:
    """Return an image and its halves, each pixel the mean of four of the one before."""
    images = [image]
    for _ in range(levels):
        height, width = (max(side // 2, 1) for side in images[-1].shape)
        even = images[-1][: 2 * height, : 2 * width]
        images.append(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA))
    return images


def log_image(gray: np.ndarray) -> np.ndarray:
    """Return the logarithm of an image.

    Parameters
    ----------
    gray : ndarray of uint8 or float32, shape (height, width)
        Gray values from 0 to 255.

    Returns
    -------
    ndarray of int16, shape (height, width)
        LOG_SCALE ln(I + LOG_OFFSET).
    """
    if gray.dtype == np.uint8:
        table = LOG_SCALE * np.log(np.arange(256) + LOG_OFFSET)
        return cv2.LUT(gray, table.astype(np.int16))
    return (LOG_SCALE * cv2.log(gray + np.float32(LOG_OFFSET))).astype(np.int16)
