"""Rigid transforms with the covariance of their errors.

A small error of a transform (R, t) is a shift d and a turn w, both along the fixed axes of the
frame that it leads to: the true one is (exp([w]x) R, t + d). The covariance is that of (d, w), as
geometry_msgs/PoseWithCovariance has it. Errors of inverse and product are to first order
(Barfoot, State Estimation for Robotics, 2017, 7.3).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ahf_ros.network.camera import rotation_matrices, skew
from ahf_ros.network.network import FloatArray


@dataclass(frozen=True)
class Transform:
    """A rigid transform x' = R x + t, which is the pose of the frame of x in that of x'.

    `rotation` is (3, 3), `translation` (3,). `covariance` (6, 6) is of x, y, z and of small
    rotations, rad, about the fixed axes of the frame of x'; zero if nothing is said.
    """

    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    translation: FloatArray = field(default_factory=lambda: np.zeros(3))
    covariance: FloatArray = field(default_factory=lambda: np.zeros((6, 6)))

    def __matmul__(self, other: Transform) -> Transform:
        """Return the transform that does the other one first; their errors are independent."""
        first = turned_errors(self.rotation, other.covariance)
        place = self.rotation @ other.translation
        by_error = lever(place)
        covariance = first + by_error @ self.covariance @ by_error.T
        return Transform(self.rotation @ other.rotation, place + self.translation, covariance)

    @property
    def inverse(self) -> Transform:
        """The transform x = R' (x' - t), with its covariance about the axes of the frame of x."""
        back = self.rotation.T
        by_error = lever(-self.translation)
        covariance = turned_errors(back, by_error @ self.covariance @ by_error.T)
        return Transform(back, -back @ self.translation, (covariance + covariance.T) / 2)

    @property
    def quaternion(self) -> FloatArray:
        """The rotation as a unit quaternion (x, y, z, w), with w of at least 0."""
        r = self.rotation
        products = np.empty((4, 4))  # 4 q q' but for its trace, symmetric
        products[:3, :3] = r + r.T - (np.trace(r) - 1) * np.eye(3)
        products[:3, 3] = r[[2, 0, 1], [1, 2, 0]] - r[[1, 2, 0], [2, 0, 1]]
        products[3, :3] = products[:3, 3]
        products[3, 3] = np.trace(r) + 1
        best = products[np.argmax(np.diag(products))]
        unit: FloatArray = best / np.linalg.norm(best)
        return -unit if unit[3] < 0 else unit

    @property
    def turn(self) -> FloatArray:
        """The rotation as a rotation vector (3,), rad."""
        return rotation_vector(self.quaternion)

    def moved(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) after the transform."""
        return points @ self.rotation.T + self.translation

    def turned(self, covariances: FloatArray) -> FloatArray:
        """Return covariances (n, 3, 3) of points after the transform, which is without error."""
        return self.rotation @ covariances @ self.rotation.T

    def changes(self, points: FloatArray) -> FloatArray:
        """Return how `moved` of points (n, 3) changes with errors of the transform, (n, 3, 6)."""
        return lever(points @ self.rotation.T)[:, :3]

    def stepped(self, step: FloatArray) -> Transform:
        """Return the transform after a small shift and turn (6,), the last three in rad."""
        turn = rotation_matrices(step[None, 3:])[0]
        return Transform(turn @ self.rotation, self.translation + step[:3], self.covariance)

    def step_from(self, start: Transform) -> FloatArray:
        """Return the step (6,) that leads from another transform to this one."""
        turn = Transform(self.rotation @ start.rotation.T).turn
        return np.concatenate([self.translation - start.translation, turn])

    def scaled(self, factor: float) -> Transform:
        """Return the transform where lengths are `factor` times as large, as in another unit."""
        size = np.repeat([factor, 1.0], 3)
        covariance = size[:, None] * self.covariance * size
        return Transform(self.rotation, factor * self.translation, covariance)


def camera_pose(rotation: FloatArray, position: FloatArray, covariance: FloatArray) -> Transform:
    """Return where the camera of X_camera = R (X - position) is in the frame of X.

    The covariance (6, 6) is of the position and of a small turn r of the camera about its own
    axes, R <- exp([r]x) R, which turns R' by -R' r.
    """
    by_error = np.eye(6)
    by_error[3:, 3:] = -rotation.T
    whole = by_error @ covariance @ by_error.T
    return Transform(rotation.T, position, (whole + whole.T) / 2)


def lever(places: FloatArray) -> FloatArray:
    """Return errors (..., 6, 6) at places (..., 3) from the origin, by those at the origin.

    A turn there shifts a place p by w x p.
    """
    result = np.zeros((*places.shape[:-1], 6, 6))
    result[...] = np.eye(6)
    result[..., :3, 3:] = skew(-places)
    return result


def twice(rotation: FloatArray) -> FloatArray:
    """Return the matrix (6, 6) that turns both a shift and a turn."""
    result = np.zeros((6, 6))
    result[:3, :3] = result[3:, 3:] = rotation
    return result


def turned_errors(rotation: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return a covariance (6, 6) of shift and turn along the axes of another frame."""
    turn = twice(rotation)
    return turn @ covariance @ turn.T


def rotation_vector(quaternion: FloatArray) -> FloatArray:
    """Return the rotation vector (3,), rad, of a unit quaternion (x, y, z, w)."""
    sine = float(np.linalg.norm(quaternion[:3]))
    if not sine:
        return np.zeros(3)
    return 2 * np.arctan2(sine, quaternion[3]) / sine * quaternion[:3]
