"""A network whose true values are known, for examples and tests."""

from __future__ import annotations

import numpy as np

from ahf_ros.orientation.camera import pinhole, project
from ahf_ros.orientation.network import CameraView, FloatArray, Network, Observations
from ahf_ros.orientation.solution import Start

SIZE = 1600, 1200


def simulated(
    photographs: int = 8,
    targets: int = 24,
    *,
    sigma: float = 0.02,
    seed: int = 7,
    calibration: FloatArray | None = None,
) -> tuple[Network, Start]:
    """Return image points with noise of `sigma` px, and the values that they come from.

    The targets are in a volume of 600 x 400 x 200, and every photograph shows all of them. Every
    second one is rolled by 90 degrees.
    """
    source = np.random.default_rng(seed)
    lens = pinhole(1500.0, *SIZE) if calibration is None else calibration
    points = source.uniform(-1, 1, (targets, 3)) * (300, 200, 100)
    angles = np.linspace(0.0, 1.6, photographs)
    positions = 1400 * np.column_stack((np.cos(angles), np.sin(angles), 0.4 + 0.1 * angles))
    rolls = np.where(np.arange(photographs) % 2, np.pi / 2, 0.0)
    rotations = np.array([_looking(*pose) for pose in zip(positions, rolls, strict=True)])
    photograph, point = (it.ravel() for it in np.indices((photographs, targets)))
    exact = project(lens, rotations[photograph], positions[photograph], points[point])
    network = Network(
        photographs=tuple(f'view_{index}.jpg' for index in range(photographs)),
        camera_of=np.zeros(photographs, np.int64),
        cameras=(CameraView('camera', *SIZE),),
        targets=tuple(str(number) for number in range(1, targets + 1)),
        observations=Observations(
            photograph=photograph,
            point=point,
            xy=exact + sigma * source.standard_normal(exact.shape),
            covariance=np.tile(sigma**2 * np.eye(2), (len(exact), 1, 1)),
        ),
    )
    used = np.ones(len(exact), np.bool_)
    return network, Start(lens[None], rotations, positions, points, used)


def _looking(position: FloatArray, roll: float) -> FloatArray:
    """Return the rotation of a camera that looks at the origin, rolled about its axis, rad."""
    forward = -position / np.linalg.norm(position)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    upright = np.array([right, np.cross(forward, right), forward])
    cosine, sine = np.cos(roll), np.sin(roll)
    turn = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    return np.asarray(turn @ upright)
