"""A projector that throws a pattern on the wall."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Projector:
    """A projector beside the camera that lights the same part of the wall.

    Attributes
    ----------
    pose : ndarray of float64, shape (3, 3)
        Homography from the wall (x, y, 1) to rays (x, y, 1).
    position : ndarray of float64, shape (3,)
        Position in the coordinates of the wall.
    scale : float
        Focal length, projector px; projector pixel (0, 0) is the principal point.
    """

    pose: np.ndarray
    position: np.ndarray
    scale: float

    @property
    def homography(self) -> np.ndarray:
        """Homography from the wall (x, y, 1) to projector pixels."""
        return np.diag((self.scale, self.scale, 1.0)) @ self.pose

    def irradiance(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the light of a white pattern on points of the wall, 1 at its origin.

        It follows the inverse square of the distance, the cosine of the angle of incidence, and
        the fourth power of the cosine of the projector's field angle.
        """
        towards = np.stack((x - self.position[0], y - self.position[1]), axis=-1)
        squared = (towards**2).sum(axis=-1) + self.position[2] ** 2
        reach = self.position @ self.position
        field = (self.position[2] ** 2 - towards @ self.position[:2]) / np.sqrt(squared * reach)
        light: np.ndarray = (reach / squared) ** 1.5 * np.clip(field, 0, 1) ** 4
        return light


def rig_projector(
    camera_pose: np.ndarray, pixel: float, generator: np.random.Generator
) -> Projector:
    """Return a projector 12 to 20 degrees beside the camera, aimed at the wall's origin.

    It is displaced along the axis of the wall's tilt, so that projector and camera see the wall
    at similar angles, and rotated about its optical axis by up to 8 degrees.

    Parameters
    ----------
    camera_pose : ndarray, shape (3, 3)
        `Camera.pose`; the optical axis meets the origin of the wall.
    pixel : float
        Size of a projector pixel at the wall's origin, units of the wall.
    generator : numpy.random.Generator
        Draws the angles and the distance.
    """
    aside = generator.uniform(math.radians(12), math.radians(20)) * generator.choice((-1, 1))
    turn = generator.uniform(-math.radians(8), math.radians(8))
    nearness = generator.uniform(0.85, 1.1)
    rotation = np.column_stack(
        (camera_pose[:, :2], np.cross(camera_pose[:, 0], camera_pose[:, 1]))
    )
    tilted = np.hypot(*rotation[:2, 2])
    free = generator.uniform(0, 2 * math.pi)
    across = rotation[:2, 2] / tilted if tilted > 1e-6 else (math.cos(free), math.sin(free))
    swing, _ = cv2.Rodrigues(np.array([*across, 0.0]) * aside)
    roll, _ = cv2.Rodrigues(np.array([0.0, 0.0, turn]))
    orientation = roll @ swing @ rotation
    distance = camera_pose[2, 2] * nearness
    pose = np.column_stack((orientation[:, :2], (0.0, 0.0, distance)))
    return Projector(pose, -orientation.T @ (0.0, 0.0, distance), distance / pixel)
