"""A wall with targets, as a scanner sees it: images and organised clouds."""

import math

import numpy as np

from ahf_ros.network.camera import rotation_matrices
from ahf_ros.scenes.camera import tilted_camera
from ahf_ros.scenes.scene import SceneSettings

SCENE = SceneSettings(width=640, height=480, targets=6, dot_radius=10.0, tilt=30.0, seed=3)
TURN = rotation_matrices(np.array([[0.1, -0.2, 0.3]]))[0]
SHIFT = np.array([0.1, 0.2, -0.3])  # m
DISTANCE = 0.8  # m


def wall(seed: int = 0) -> np.ndarray:
    """Return the points (480, 640, 3) of the wall that the scene shows, m, with noise."""
    setup = np.random.default_rng(np.random.SeedSequence(SCENE.seed).spawn(5)[0])
    focal_length = SCENE.focal_length * SCENE.width
    tilt = math.radians(SCENE.tilt)
    camera = tilted_camera(640, 480, focal_length, tilt, SCENE.distortion, setup)
    rows, columns = np.mgrid[:480, :640]
    pixels = np.column_stack((columns.ravel(), rows.ravel())).astype(float)
    points = np.column_stack((camera.wall(pixels), np.ones(len(pixels)))) @ camera.pose.T
    points *= DISTANCE / focal_length
    points *= 1 + 1e-4 * np.random.default_rng(seed).standard_normal((len(points), 1))
    return points.reshape(480, 640, 3)


def moved(times: int) -> np.ndarray:
    """Return the points of the wall for a scanner that was moved so many times."""
    points = wall(times)
    for _ in range(times):
        points = (points - SHIFT) @ TURN
    return points


def as_cloud(points: np.ndarray) -> np.ndarray:
    """Return points (height, width, 3) as an organised cloud."""
    cloud = np.zeros(points.shape[:2], [(axis, '<f4') for axis in 'xyz'])
    for axis, letter in enumerate('xyz'):
        cloud[letter] = points[..., axis]
    return cloud
