"""Random networks without images: photographs of targets, with noise and perhaps wrong IDs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ahf_ros.network.camera import pinhole, project
from ahf_ros.network.network import CameraView, FloatArray, IntArray, Network, Observations

WIDTH, HEIGHT = 3000, 2000
NOISE = 0.05
"""Standard deviation of a coordinate in px."""


@dataclass(frozen=True)
class Rendered:
    """A network with its truth: points (n, 3), and the targets whose IDs are wrong by rows."""

    network: Network
    points: FloatArray
    wrong: np.ndarray


def rendered(
    seed: int,
    *,
    flat: bool,
    known: bool,
    wrong: float = 0.0,
    photographs: int = 0,
    distorted: bool = False,
) -> Rendered:
    """Return a random network: 8 to 60 photographs of 20 to 150 targets, tilted and rolled.

    A distorted one has a lens as usual: k1 from -0.3 to 0.1, and a principal point that is off by
    up to 2 % of the image's width.
    """
    random = np.random.default_rng(seed)
    count = photographs or int(random.integers(8, 61))
    number = int(random.integers(20, 151))
    focal = WIDTH * random.uniform(0.7, 2.5)
    points = random.uniform(-1, 1, (number, 3)) * [1, random.uniform(0.5, 1), 0.5]
    if flat:
        points[:, 2] = 0
    rotations, positions = [], []
    tilt = np.radians(random.uniform(15, 50))
    for _ in range(count):
        around = random.uniform(0, 2 * np.pi)
        lean = random.uniform(0.3, 1) * tilt
        away = np.array(
            [np.sin(lean) * np.cos(around), np.sin(lean) * np.sin(around), np.cos(lean)]
        )
        distance = random.uniform(0.7, 1.3) * 2 * focal / WIDTH
        rotations.append(looking(-away, random.uniform(0, 2 * np.pi)))
        positions.append(random.uniform(-0.4, 0.4, 3) * [1, 1, 0] + distance * away)
    view = CameraView('camera', WIDTH, HEIGHT, focal if known else None)
    calibration = pinhole(focal, WIDTH, HEIGHT)
    cameras, of = (view,), np.zeros(count, dtype=int)
    if distorted:
        calibration[1:3] += WIDTH * random.uniform(-0.02, 0.02, 2)
        calibration[3] = random.uniform(-0.3, 0.1)
    return photographed(
        points, rotations, positions, cameras, of, calibration[None], random, wrong
    )


def photographed(
    points: FloatArray,
    rotations: Sequence[FloatArray],
    positions: Sequence[FloatArray],
    cameras: tuple[CameraView, ...],
    camera_of: IntArray,
    calibrations: FloatArray,
    random: np.random.Generator,
    wrong: float = 0.0,
) -> Rendered:
    """Return the network of poses: nine of ten targets in the image, a share with wrong IDs.

    `calibrations` (cameras or photographs, parameters) are the true ones.
    """
    rows = []
    for photograph, (rotation, position) in enumerate(zip(rotations, positions, strict=True)):
        camera = camera_of[photograph]
        own = photograph if len(calibrations) == len(rotations) else camera
        xy = project(calibrations[own], rotation, position, points)
        size = np.array([cameras[camera].width, cameras[camera].height])
        inside = np.all((xy > 10) & (xy < size - 10), axis=1)
        ideal = (points - position) @ rotation.T
        # No lens images twice: beyond this radius Brown's polynomial turns back.
        turning = 1 + 3 * calibrations[own][3] * np.sum((ideal[:, :2] / ideal[:, 2:]) ** 2, axis=1)
        inside &= turning > 0.2
        inside &= random.random(len(points)) < 0.9
        rows += [(photograph, point, *xy[point]) for point in np.flatnonzero(inside)]
    table = np.array(rows)
    xy = table[:, 2:] + random.normal(0, NOISE, (len(table), 2))
    seen_in, ids = table[:, 0].astype(int), table[:, 1].astype(int)
    false = random.random(len(table)) < wrong
    for row in np.flatnonzero(false):
        free = np.setdiff1d(np.arange(len(points)), ids[seen_in == seen_in[row]])
        if len(free):
            ids[row] = random.choice(free)
        else:
            false[row] = False
    network = Network(
        tuple(f'{index}.png' for index in range(len(rotations))),
        np.asarray(camera_of),
        cameras,
        tuple(str(index) for index in range(len(points))),
        Observations(seen_in, ids, xy, np.broadcast_to(NOISE**2 * np.eye(2), (len(table), 2, 2))),
    )
    return Rendered(network, points, false)


def looking(along: FloatArray, roll: float) -> FloatArray:
    """Return a rotation from world to camera that looks along a unit vector and is rolled."""
    up = np.array([0, 1, 0]) if abs(along[1]) < 0.9 else np.array([1, 0, 0])
    right = np.cross(along, up)
    right = right / np.linalg.norm(right)
    rotation = np.array([right, np.cross(along, right), along])
    turn = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    return turn @ rotation


def deviations(points: FloatArray, truth: FloatArray) -> FloatArray:
    """Return what is left of points (n, 3) against the truth after a similarity transform."""
    source, target = points - points.mean(axis=0), truth - truth.mean(axis=0)
    left, values, right = np.linalg.svd(target.T @ source)
    sign = np.diag([1, 1, np.linalg.det(left @ right)])
    rotation = left @ sign @ right
    scale = np.sum(values * np.diag(sign)) / np.sum(source**2)
    return scale * source @ rotation.T - target
