"""Simulated scans around an object: a ring of stations whose neighbours share targets."""

from collections.abc import Sequence

import numpy as np

from ahf_ros.base.target import Target
from ahf_ros.clouds.localisation import positions
from ahf_ros.clouds.registration.scan import Scan
from ahf_ros.files.cloud_files import AXES
from ahf_ros.network.camera import rotation_matrices
from ahf_ros.network.network import FloatArray
from ahf_ros.network.transform import Transform

RADIUS = 0.5
"""Radius of the object, m."""

DISTANCE = 1.0
"""Distance of the scanner from the axis of the object, m."""


SIGMA = 20e-6  # m, of the targets that are drawn
NOISE = 0.1e-3  # m, of the points of a cloud
FOCAL_LENGTH = 2500.0  # px
DOT = 8.0  # px, radius
CENTRE = 0.03  # px, standard deviation of the centres


def ring(count: int, common: int, random: np.random.Generator) -> FloatArray:
    """Return targets (count, common, 3), m; group k is common to scans k and k + 1."""
    angle = (np.arange(count)[:, None] + random.uniform(0.1, 0.9, (count, common))) / count
    turn = 2 * np.pi * angle
    radius = RADIUS + random.uniform(-0.03, 0.03, turn.shape)
    # Spread over the height, or a narrow group would be near a line by chance.
    height = (np.arange(common) + random.uniform(0, 1, turn.shape)) / common - 0.5
    return np.stack((radius * np.cos(turn), radius * np.sin(turn), 0.8 * height), axis=-1)


def station(number: int, count: int) -> Transform:
    """Return the pose of a scanner that looks at the groups before and after its number."""
    turn = 2 * np.pi * number / count
    outward = np.array([np.cos(turn), np.sin(turn), 0.0])
    rotation = np.column_stack((np.cross([0.0, 0.0, 1.0], outward), [0.0, 0.0, -1.0], -outward))
    return Transform(rotation, (RADIUS + DISTANCE) * outward)


def covariances(count: int, sigma: float, random: np.random.Generator) -> FloatArray:
    """Return covariances (n, 3, 3) with axes of 0.5 to 2 sigma in all directions, m^2."""
    turns = rotation_matrices(random.normal(size=(count, 3)))
    sizes = (sigma * random.uniform(0.5, 2, (count, 3))) ** 2
    return turns * sizes[:, None] @ turns.transpose(0, 2, 1)


def measured(
    names: Sequence[str],
    points: FloatArray,
    transform: Transform,
    sigma: float,
    random: np.random.Generator,
) -> Scan:
    """Return what a scanner measures of points (n, 3) of the object."""
    spread = covariances(len(points), sigma, random)
    errors = np.linalg.cholesky(spread) @ random.normal(size=(len(points), 3, 1))
    return Scan(tuple(names), transform.inverse.moved(points) + errors[:, :, 0], spread)


def squared_error(found: Transform, true: Transform) -> float:
    """Return the squared error of a transform over its covariance: 6 on average."""
    error = found.step_from(true)
    return float(error @ np.linalg.solve(found.covariance, error))


def drawn(
    names: Sequence[str], points: FloatArray, pose: Transform, random: np.random.Generator
) -> Scan:
    """Return targets with errors drawn from their covariances."""
    return measured(names, points, pose, SIGMA, random)


def clouds(
    names: Sequence[str], points: FloatArray, pose: Transform, random: np.random.Generator
) -> Scan:
    """Return targets that are measured in clouds; their planes face away from the axis."""
    places, covariances = [], []
    for point in points:
        normal = pose.rotation.T @ (point * (1, 1, 0))
        place, covariance = _in_cloud(pose.inverse.moved(point), normal, random)
        places.append(place)
        covariances.append(covariance)
    return Scan(tuple(names), np.array(places), np.array(covariances))


def _in_cloud(
    true: FloatArray, normal: FloatArray, random: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return position and covariance of a target from the points around it."""
    centre = FOCAL_LENGTH * true[:2] / true[2]
    first = np.round(centre) - 3 * DOT - 2
    size = int(6 * DOT + 5)
    rows, columns = np.mgrid[:size, :size]
    pixels = np.stack((columns, rows), axis=-1) + first
    rays = np.concatenate((pixels / FOCAL_LENGTH, np.ones((size, size, 1))), axis=-1)
    depth = (true @ normal) / (rays @ normal)
    depth += NOISE * random.standard_normal(depth.shape)
    cloud = np.zeros((size, size), [(name, '<f4') for name in AXES])
    for axis, name in enumerate(AXES):
        cloud[name] = rays[..., axis] * depth
    x, y = centre + CENTRE * random.standard_normal(2)
    seen = x - first[0], y - first[1]
    target = Target(1, 1, *seen, DOT, DOT, covariance=(CENTRE**2, 0.0, 0.0, CENTRE**2))
    found = positions(cloud, [target])
    return found.points[0], found.covariances[0]
