"""Frames of square markers: homographies from the square about the origin with sides of 1.

A small change of a frame is one of the square before it is projected,

    (x, y) -> (x, y) + (a x + b y + c, d x + e y + f) - (g x + h y) (x, y),

so that what moves an edge is linear in eight unknowns, in sides of the square.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.frame import local_affine

SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
"""Corners of the square about the origin with sides of 1."""

SYSTEMATIC = 0.003
"""Standard deviation of the effects of lens distortion and pixels on a centre, px."""

PLACE = 8
"""Unknowns of a frame."""


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


def centres(corners: np.ndarray) -> np.ndarray:
    """Return the intersections of the diagonals, the images of the centres, shape (k, 2)."""
    return meet(corners[:, 0], corners[:, 2], corners[:, 1], corners[:, 3])


def side_lengths(corners: np.ndarray) -> np.ndarray:
    """Return the lengths of sides, shape (k, 4)."""
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def square_frames(corners: np.ndarray) -> np.ndarray:
    """Return the frames of squares with corners, shape (k, 3, 3)."""
    square = SQUARE.astype(np.float32)
    found = [cv2.getPerspectiveTransform(square, of) for of in corners.astype(np.float32)]
    return np.array(found).reshape(-1, 3, 3)


def changed(frames: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """Return frames after changes, shape (k, 8)."""
    moved = np.tile(np.eye(3), (len(frames), 1, 1))
    moved.reshape(-1, 9)[:, :PLACE] += changes
    return frames @ moved


def derivatives(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how distances and places change at the centres, shapes (k, 2) and (k, 2, 2).

    Distances from the camera change in shares of their own, in a side of the square; places in px.
    """
    scaled = frames / frames[:, 2:, 2:]
    return scaled[:, 2, :2], local_affine(scaled)


def centre_covariance(frames: np.ndarray, normals: np.ndarray, sums: np.ndarray) -> np.ndarray:
    """Return the covariances of centres, px^2, from least squares whose errors come in groups.

    Normal matrices, shape (k, m, m), have the changes of frames first. What the weighted errors of
    each group add to the right sides has the shape (k, m, n), 0 for a group that is not seen.
    """
    inverse = np.linalg.inv(normals)
    count = (sums != 0).any(axis=1).sum(axis=1)
    freedom = (count / np.maximum(count - normals.shape[1], 1)) ** 2
    of_all = inverse @ (sums @ np.swapaxes(sums, 1, 2)) @ inverse
    centre = of_all[:, [[2, 2], [5, 5]], [[2, 5], [2, 5]]]
    _, along = derivatives(frames)
    covariance = along @ centre @ np.swapaxes(along, 1, 2)
    return freedom[:, None, None] * covariance + SYSTEMATIC**2 * np.eye(2)


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
