"""Epochs of networks whose targets move: linearised adjustments, and whole ones.

Each epoch is a bundle of its own photographs: image points with normal errors, poses, focal length
and radial distortion unknown, inner constraints, and a scale bar where the scale is fixed.
"""

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.network.adjustment import adjust
from ahf_ros.network.camera import PARAMETERS, linearise, pinhole, project, rotation_matrices
from ahf_ros.network.datum import movements, s_transform
from ahf_ros.network.network import FloatArray, ScaleBar
from ahf_ros.network.points import MeasuredPoints
from ahf_ros.network.similarity import Similarity
from ahf_ros.network.solution import Solution
from support.network_scenes import Field as Scene
from support.network_scenes import simulate

WIDTH, HEIGHT, FOCAL_LENGTH = 4000, 3000, 4200.0
NOISE = 0.05
"""Standard deviation of image points, px."""
BAR_SIGMA = 2e-5
"""Standard deviation of a scale bar, as a share of its length."""
_RELEASED = 'f', 'cx', 'cy', 'k1', 'k2', 'p1', 'p2'
_FREE = [PARAMETERS.index(name) for name in ('f', 'k1')]


@dataclass(frozen=True)
class Field:
    """A field of targets, in units of length, and how many photographs are taken of it."""

    name: str
    extent: tuple[float, float, float]
    targets: int
    photographs: int
    adjusted: bool = False
    """Whether every epoch is adjusted, by `adjust`, from image points with errors."""


FIELDS = (
    Field('wall', (1.0, 0.7, 0.0), 20, 10),
    Field('box', (1.0, 0.8, 0.6), 8, 8),
    Field('machine', (1.0, 0.8, 0.6), 24, 16),
    Field('beam', (3.0, 0.2, 0.1), 14, 12),
    Field('hall', (1.0, 1.0, 0.4), 60, 40),
    Field('adjusted', (2.0, 2.0, 1.0), 16, 10, adjusted=True),
)


class Epoch:
    """The linearised adjustment of a bundle: errors of image points in, coordinates out."""

    def __init__(
        self, xyz: FloatArray, photographs: int, bar: bool, rng: np.random.Generator
    ) -> None:
        design = _design(xyz, photographs, rng)
        free = movements(xyz, scale=not bar)
        if bar:
            row = np.zeros((1, design.shape[1]))
            difference = xyz[1] - xyz[0]
            row[0, :3] = -difference / (difference @ difference) / BAR_SIGMA
            row[0, 3:6] = -row[0, :3]
            design = np.vstack([design, row])
        size, count = 3 * len(xyz), design.shape[1]
        border = np.zeros((count, free.shape[1]))
        border[:size] = free
        scale = 1 / np.linalg.norm(design, axis=0)  # so that inverting loses no digits
        border *= scale[:, None]
        border /= np.linalg.norm(border, axis=0)
        normal = (design * scale).T @ (design * scale)
        bordered = np.block([[normal, border], [border.T, np.zeros((free.shape[1],) * 2)]])
        inverse = np.linalg.inv(bordered)[:count, :count] * scale[:, None] * scale
        self.xyz, self.bar, self.design = xyz, bar, design
        self.gain = inverse @ design.T
        self.covariance = inverse[:size, :size]
        self.redundancy = len(design) - count + free.shape[1]

    def measured(self, moved: FloatArray, rng: np.random.Generator) -> MeasuredPoints:
        """Return coordinates of targets that have moved by (n, 3), in a frame of the epoch."""
        errors = rng.standard_normal(len(self.design))
        change = self.gain @ errors
        variance = errors @ (errors - self.design @ change) / self.redundancy
        xyz = self.xyz + moved + change[: self.xyz.size].reshape(-1, 3)
        points = points_of(self.xyz, self.covariance, self.redundancy, self.bar, variance)
        return _turned(replace(points, xyz=xyz), rng)


class Adjusted:
    """The same by `adjust`: errors of image points in, coordinates out."""

    def __init__(
        self, xyz: FloatArray, photographs: int, bar: bool, rng: np.random.Generator
    ) -> None:
        network, start = simulate(Scene(photographs, len(xyz)), rng)
        self.xyz, self.bar, self.network = xyz, bar, network
        self.start = replace(start, points=xyz)
        exact = self._adjusted(np.zeros_like(xyz), rng).measured_points
        self.covariance, self.redundancy = exact.cofactors, exact.redundancy

    def measured(self, moved: FloatArray, rng: np.random.Generator) -> MeasuredPoints:
        """Return coordinates of targets that have moved by (n, 3), in a frame of the epoch."""
        return _turned(self._adjusted(moved, rng).measured_points, rng)

    def _adjusted(self, moved: FloatArray, rng: np.random.Generator) -> Solution:
        seen, start = self.network.observations, replace(self.start, points=self.xyz + moved)
        poses = start.rotations[seen.photograph], start.positions[seen.photograph]
        exact = project(start.calibrations[0], *poses, start.points[seen.point])
        noise = np.sqrt(seen.covariance[:, :1, 0]) * rng.standard_normal(exact.shape)
        network = replace(self.network, observations=replace(seen, xy=exact + noise))
        if self.bar:
            length = float(np.linalg.norm(start.points[1] - start.points[0]))  # at its epoch
            given = length * (1 + BAR_SIGMA * rng.standard_normal())
            bar = ScaleBar(('0', '1'), given, BAR_SIGMA * length)
            network = replace(network, bars=(bar,), unit='m')
        return adjust(network, start, release=_RELEASED, test=False)


def points_of(
    xyz: FloatArray, covariance: FloatArray, redundancy: int, bar: bool, variance: float = 1.0
) -> MeasuredPoints:
    """Return coordinates in m, or without a unit where nothing fixes their scale."""
    names = tuple(f'{index}' for index in range(len(xyz)))
    unit = 'm' if bar else ''
    return MeasuredPoints(names, xyz, covariance, float(np.sqrt(variance)), redundancy, unit)


def _turned(points: MeasuredPoints, rng: np.random.Generator) -> MeasuredPoints:
    """Return points in another frame, and in another scale where they have none."""
    turn = rotation_matrices(rng.normal(0, 1, (1, 3)))[0]
    scale = 1.0 if points.unit else float(rng.uniform(0.5, 2))
    movement = Similarity(turn, rng.normal(0, 1, 3), scale)
    moved, covariance = movement.moved(points.xyz), movement.turned(points.covariance)
    return replace(points, xyz=moved, covariance=covariance)


def _design(xyz: FloatArray, photographs: int, rng: np.random.Generator) -> FloatArray:
    """Return the derivatives of image points, in their standard deviations, by all unknowns.

    These are the points, the poses, and the focal length and k1 of the camera.
    """
    calibration = pinhole(FOCAL_LENGTH, WIDTH, HEIGHT)
    reach = np.linalg.norm(xyz - xyz.mean(axis=0), axis=1).max()
    distance = 2.3 * FOCAL_LENGTH / HEIGHT * reach
    rows = []
    for index in range(photographs):
        tilt, around = np.radians(rng.uniform(15, 50)), 2 * np.pi * (index + rng.random())
        around /= photographs / 3  # three rounds
        out = np.array(
            [np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), np.cos(tilt)]
        )
        forward = -out
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        upright = np.stack([right, np.cross(forward, right), forward])
        roll = rotation_matrices(np.array([[0, 0, np.pi / 2 * (index % 4)]]))[0]
        seen = linearise(calibration, roll @ upright, xyz.mean(axis=0) + distance * out, xyz)
        block = np.zeros((len(xyz), 2, 3 * len(xyz) + 6 * photographs + len(_FREE)))
        for point in range(len(xyz)):
            block[point, :, 3 * point : 3 * point + 3] = seen.by_point[point]
        start = 3 * len(xyz) + 6 * index
        block[:, :, start : start + 6] = seen.by_pose
        block[:, :, -len(_FREE) :] = seen.by_calibration[:, :, _FREE]
        shown = (seen.xy > 0).all(axis=1) & (seen.xy < (WIDTH, HEIGHT)).all(axis=1)
        shown &= rng.random(len(xyz)) > 0.1
        rows.append(block[shown].reshape(-1, block.shape[2]))
    return np.vstack(rows) / NOISE


def differences(xyz: FloatArray, covariance: FloatArray, bar: bool) -> FloatArray:
    """Return the covariances (n, 3, 3) of differences, each in the datum of all other targets."""
    found = []
    for index in range(len(xyz)):
        others = np.arange(len(xyz)) != index
        moved = s_transform(xyz, covariance, others.astype(float), scale=not bar)[1]
        found.append(moved[3 * index : 3 * index + 3, 3 * index : 3 * index + 3])
    return np.array(found)
