"""The pose of a camera among known targets, with its covariance, and its inverse.

A small error of a pose (R, t) is a shift d and a turn w, both along the fixed axes of the frame
that the pose leads to: the true pose is (exp([w]x) R, t + d). The covariance is that of (d, w),
as geometry_msgs/PoseWithCovariance has it. As d and w are about fixed axes, the covariance of the
inverse follows from the adjoint of the transform (Barfoot, State Estimation for Robotics, 2017,
section 7.1.4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.orientation.network import FloatArray, Rejection


@dataclass(frozen=True)
class Transform:
    """A rigid transform x' = R x + t with the covariance of its small errors.

    `rotation` is (3, 3), `translation` (3,). `covariance` (6, 6) is of x, y, z and of small
    rotations, rad, about the fixed axes of the frame of x'.
    """

    rotation: FloatArray
    translation: FloatArray
    covariance: FloatArray

    @property
    def inverse(self) -> Transform:
        """The transform x = R' (x' - t), with its covariance about the axes of the frame of x."""
        back = self.rotation.T
        by_error = np.zeros((6, 6))
        by_error[:3, :3] = by_error[3:, 3:] = -back
        by_error[:3, 3:] = -back @ cross_matrix(self.translation)
        covariance = by_error @ self.covariance @ by_error.T
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


@dataclass(frozen=True)
class Pose:
    """The pose of a camera in the frame of known targets, from one image.

    Attributes
    ----------
    camera : Transform
        From the frame of the camera (x right, y down, z forward) to that of the targets: its
        translation is the centre of projection. Covariances hold the a-priori weights, scaled by
        the square of `sigma0` where that is too large by chance.
    second : Transform or None
        Another pose that is not much less likely, as planes have one where perspective is weak.
    targets : tuple of str
        Names of the targets that agree.
    residuals : ndarray of float64, shape (n, 2)
        Measured minus computed of these, in focal lengths.
    rejected : tuple of Rejection
        What was left out, and why; the photograph has no name.
    sigma0 : float
        Square root of the variance of unit weight.
    redundancy : int
        Its degrees of freedom.
    """

    camera: Transform
    second: Transform | None
    targets: tuple[str, ...]
    residuals: FloatArray
    rejected: tuple[Rejection, ...]
    sigma0: float
    redundancy: int


def cross_matrix(vector: FloatArray) -> FloatArray:
    """Return the matrix [v]x with [v]x u = v x u."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
