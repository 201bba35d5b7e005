"""Dots seen obliquely, found in the image as it would be seen from straight ahead.

Gradients at the edge of a circle all point away from its middle, those at the edge of a narrow
ellipse do not. The targets that are certain tell how obliquely a scene is seen, and an affine map
that makes them round makes the others nearly so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.dot_search import voted_dots
from ahf_ros.features.dots import Dots
from ahf_ros.features.pyramid import image_pyramid

_OBLIQUE = 1.5  # ratio of the axes of ellipses that gradients do not tell well
_FEWEST = 4  # certain targets that tell how obliquely a scene is seen


def rounding(certain: np.ndarray) -> np.ndarray | None:
    """Return the map that makes the targets of an oblique view as round as it can.

    Parameters
    ----------
    certain : ndarray of float64, shape (k, 3, 3)
        Frames of the certain targets of a whole image.

    Returns
    -------
    ndarray of float64, shape (2, 2), or None
        It leaves areas as they are. None where hardly any target is certain, or the usual one is
        round enough.
    """
    if len(certain) < _FEWEST:
        return None
    shapes = frame.local_affine(certain)
    shapes = shapes @ shapes.swapaxes(1, 2)
    usual = np.median(shapes / np.sqrt(np.linalg.det(shapes))[:, None, None], axis=0)
    squares, axes = np.linalg.eigh(usual)
    ratio = np.sqrt(squares[1] / squares[0])
    if ratio < _OBLIQUE:
        return None
    turned: np.ndarray = axes @ np.diag([np.sqrt(ratio), 1 / np.sqrt(ratio)]) @ axes.T
    return turned


def oblique_dots(
    gray: np.ndarray,
    rounded: np.ndarray,
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    explained: np.ndarray,
) -> Dots:
    """Return the dots that votes of gradients find where an oblique view is seen straight ahead.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    rounded : ndarray of float64, shape (2, 2)
        As `rounding` gives it.
    min_radius, max_radius, polarities
        As for `voted_dots`.
    explained : ndarray of float, shape (n, m, 2)
        Outlines of objects that are known already, px of the image.
    """
    height, width = gray.shape
    corners = np.array([[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1]])
    seen = corners @ rounded.T
    onto = np.eye(3)
    onto[:2, :2], onto[:2, 2] = rounded, -seen.min(axis=0)
    size = np.ceil(np.ptp(seen, axis=0)).astype(int) + 1
    straight = cv2.warpAffine(gray, onto[:2], size.tolist(), borderMode=cv2.BORDER_REPLICATE)
    outlines = explained @ rounded.T + onto[:2, 2]
    dots = voted_dots(
        image_pyramid(straight, max_radius), min_radius, max_radius, polarities, outlines
    )
    return replace(dots, frames=np.linalg.inv(onto) @ dots.frames)
