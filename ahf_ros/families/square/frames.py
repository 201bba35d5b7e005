"""Frames of square markers: homographies from the square about the origin with sides of 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros import kernels
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.frame import reduced

SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
"""Corners of the square about the origin with sides of 1."""


@dataclass(frozen=True, slots=True)
class Places(ArrayRecord):
    """Where square markers are.

    Attributes
    ----------
    corners : ndarray of float64, shape (k, 4, 2)
        Corners, clockwise in the image, px.
    share : ndarray of float64, shape (k,)
        Fraction of the marker that looks as it should; 0 where it was not measured.
    covariance : ndarray of float64, shape (k, 2, 2)
        Covariance of the centre, px^2.
    edge_shift : ndarray of float64, shape (k,)
        Growth of what is dark in light, on every edge, px; NaN where that was not measured. The
        corners are those without it.
    """

    corners: np.ndarray
    share: np.ndarray
    covariance: np.ndarray
    edge_shift: np.ndarray

    @classmethod
    def unmeasured(cls, corners: np.ndarray) -> Places:
        """Return markers of which only corners are known."""
        count = len(corners)
        return cls(corners, np.zeros(count), np.zeros((count, 2, 2)), np.full(count, np.nan))

    def enlarged(self) -> Places:
        """Return the same in px of the image of which they were measured in a half."""
        corners = reduced(self.corners, -1)
        return Places(corners, self.share, 4 * self.covariance, 2 * self.edge_shift)


def centres(corners: np.ndarray) -> np.ndarray:
    """Return the intersections of the diagonals, the images of the centres, shape (k, 2)."""
    return meet(corners[:, 0], corners[:, 2], corners[:, 1], corners[:, 3])


def side_lengths(corners: np.ndarray) -> np.ndarray:
    """Return the lengths of sides, shape (k, 4)."""
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def cell_sizes(corners: np.ndarray, cells: int) -> np.ndarray:
    """Return the lengths of cells along the first sides and the second ones, shape (k, 2)."""
    lengths = side_lengths(corners) / cells
    return (lengths[:, :2] + lengths[:, 2:]) / 2


def square_frames(corners: np.ndarray) -> np.ndarray:
    """Return the frames of squares with corners, shape (k, 3, 3)."""
    frames: np.ndarray = kernels.square_frames(corners)
    return frames


def meet(
    first: np.ndarray, second: np.ndarray, third: np.ndarray, fourth: np.ndarray
) -> np.ndarray:
    """Return the intersections of lines first-second and third-fourth, shape (..., 2) all.

    Those of parallel lines are NaN.
    """
    one, other, between = second - first, fourth - third, third - first
    turn = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    share = between[..., 0] * other[..., 1] - between[..., 1] * other[..., 0]
    turn = np.where(np.abs(turn) < 1e-9, np.nan, turn)
    return first + (share / turn)[..., None] * one
