"""Networks without images: exact projections of targets in many photographs, with noise."""

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.network.camera import pinhole, project, rotation_matrices
from ahf_ros.network.network import CameraView, Network, Observations
from ahf_ros.network.solution import NetworkState

WIDTH, HEIGHT = 4000, 3000


@dataclass(frozen=True)
class Field:
    """A field of targets in a cube or a square of 2 units, and photographs around it.

    Every fourth is rolled by a quarter turn more, if they are `rolled`. `each` limits the targets
    of a photograph.
    """

    photographs: int = 12
    targets: int = 40
    planar: bool = False
    sigma: float = 0.05
    each: int | None = None
    rolled: bool = True


LENS = pinhole(3200, WIDTH, HEIGHT) + np.array([0, 15, -10, -0.1, 0.03, 0, 4e-4, -3e-4, 0, 0])
"""Calibration of the camera."""


def simulate(
    field: Field,
    random: np.random.Generator,
    lenses: np.ndarray = LENS[None],
    targets: np.ndarray | None = None,
) -> tuple[Network, NetworkState]:
    """Return a network with noise in its image points, and the true values.

    Standard deviations of centres vary by a factor of two, and are those of the noise. Cameras of
    calibrations `lenses` (cameras, parameters) take turns. The
    places of targets (n, 3) may be given.
    """
    camera_of = np.arange(field.photographs) % len(lenses)
    points = random.uniform(-1, 1, (field.targets, 3)) * [1, 1, 0 if field.planar else 0.5]
    points = points if targets is None else targets
    directions = random.normal(size=(field.photographs, 3))
    directions[:, 2] = np.abs(directions[:, 2]) + 0.7
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    positions = directions * random.uniform(3.6, 4.4, (field.photographs, 1))
    aims = random.normal(0, 0.1, (field.photographs, 3))
    rolls = np.arange(field.photographs) // len(lenses) % 4 * np.pi / 2 * field.rolled
    rotations = np.stack([_towards(*view) for view in zip(positions, aims, rolls, strict=True)])
    photograph, point = np.divmod(np.arange(field.photographs * field.targets), field.targets)
    xy = project(
        lenses[camera_of[photograph]], rotations[photograph], positions[photograph], points[point]
    )
    inside = ((xy > 0) & (xy < [WIDTH, HEIGHT])).all(axis=1)
    order = np.where(inside, random.random(len(xy)), 2).reshape(field.photographs, -1)
    rank = order.argsort(axis=1).argsort(axis=1).reshape(-1)
    inside &= rank < (field.each or field.targets)
    photograph, point, xy = photograph[inside], point[inside], xy[inside]
    sigma = field.sigma * random.uniform(0.7, 1.4, len(xy))
    network = Network(
        tuple(f'{number}.jpg' for number in range(field.photographs)),
        camera_of,
        tuple(CameraView(f'camera{place or ""}', WIDTH, HEIGHT) for place in range(len(lenses))),
        tuple(str(number) for number in range(field.targets)),
        Observations(
            photograph,
            point,
            xy + sigma[:, None] * random.normal(size=xy.shape),
            sigma[:, None, None] ** 2 * np.eye(2),
        ),
    )
    used = np.ones(len(xy), dtype=bool)
    return network, NetworkState(lenses, rotations, positions, points, used)


def approximate(
    truth: NetworkState, random: np.random.Generator, size: float = 0.02
) -> NetworkState:
    """Return true values with errors of a size in units and rad, and no distortion."""
    count = len(truth.positions)
    turns = rotation_matrices(random.normal(0, size, (count, 3)))
    return replace(
        truth,
        calibrations=np.tile(
            pinhole(3200 * (1 + 2 * size), WIDTH, HEIGHT), (len(truth.calibrations), 1)
        ),
        rotations=turns @ truth.rotations,
        positions=truth.positions + random.normal(0, size, (count, 3)),
        points=truth.points + random.normal(0, size, truth.points.shape),
    )


def _towards(position: np.ndarray, aim: np.ndarray, roll: float) -> np.ndarray:
    """Return the rotation of a camera that looks from a position to an aim."""
    z = (aim - position) / np.linalg.norm(aim - position)
    x = np.cross(z, [0.1, 0.2, 1])
    x /= np.linalg.norm(x)
    return rotation_matrices(np.array([[0, 0, roll]]))[0] @ np.stack([x, np.cross(z, x), z])
