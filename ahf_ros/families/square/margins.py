"""How clearly an image shows the cells of square markers, in the figures of the AprilTag library.

The threshold between ink and paper is in the middle of two planes, fitted to the cells of the
border and to the ring of paper around it, as in `quad_decode` of apriltag.c [1]_.

References
----------
.. [1] Wang, Olson, AprilTag 2: Efficient and robust fiducial detection, IROS 2016.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ahf_ros.families.square.frames import square_frames
from ahf_ros.vision.frame import project
from ahf_ros.vision.sampling import sample


def decision_margins(
    gray: np.ndarray, corners: np.ndarray, ink: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return how many cells of markers have the wrong colour, and how far cells are from it.

    Parameters
    ----------
    gray : ndarray of uint8 or float32, shape (height, width)
        The image, 0 to 255.
    corners : ndarray of float64, shape (k, 4, 2)
        Corners of the border, px, as those of `SquareMarker`.
    ink : ndarray of bool, shape (k, side, side)
        The cells of the markers, True where there is ink; the outermost are those of the border.

    Returns
    -------
    hamming : ndarray of int, shape (k,)
        Cells within the border whose colour is not that of the marker.
    decision_margin : ndarray of float64, shape (k,)
        Mean distance of the cells within the border from the threshold: that of the dark ones, or
        of the bright ones where it is smaller.
    """
    places, levels = _grid(ink.shape[1])
    values = sample(gray, project(square_frames(corners), places)).astype(np.float64)
    cells = values[:, 2:-2, 2:-2].reshape(len(values), -1)
    above = cells - values.reshape(len(values), -1) @ levels
    bright = above > 0
    means = [
        (np.abs(above) * of).sum(axis=1) / np.maximum(of.sum(axis=1), 1)
        for of in (bright, ~bright)
    ]
    wrong = bright == ink[:, 1:-1, 1:-1].reshape(len(values), -1)
    return wrong.sum(axis=1), np.minimum(*means)


@lru_cache(maxsize=16)
def _grid(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where the cells and the ring around them are, and what makes thresholds of them.

    Places have the shape (side + 2, side + 2, 2), in sides about the centre. A row of values of
    all of these, times the matrix, is a row of thresholds of the cells within the border.
    """
    along = (np.arange(-1, side + 1) + 0.5) / side - 0.5
    places = np.stack(np.meshgrid(along, along), axis=2)
    planes = np.dstack((places, np.ones(places.shape[:2])))
    ring = np.abs(np.arange(side + 2) - (side + 1) / 2)
    ring = (side + 1) / 2 - np.maximum(ring[:, None], ring)  # 0: paper, 1: border
    matrix = np.zeros((ring.size, (side - 2) ** 2))
    for width in (0, 1):
        of = ring == width
        fitted = planes[2:-2, 2:-2].reshape(-1, 3) @ np.linalg.pinv(planes[of])
        matrix[of.ravel()] = fitted.T / 2
    return places, matrix
