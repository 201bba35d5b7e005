"""A small network whose coordinates, poses and observations are known without any error."""

from dataclasses import replace
from typing import Any

import numpy as np

from ahf_ros.base.target import Identification, Target
from ahf_ros.files.target_json import to_json
from ahf_ros.network.camera import pinhole, project
from ahf_ros.network.network import (
    CameraView,
    ControlPoint,
    FloatArray,
    Network,
    Observations,
    ScaleBar,
)
from ahf_ros.network.solution import NetworkState, Solution

SIZE = 1600, 1200
CALIBRATION = np.array([1500.0, 803.0, 596.0, -0.08, 0.02, 0.001, 2e-4, -1e-4, 1e-4, 2e-5])


def simulated(
    photographs: int = 8,
    targets: int = 24,
    *,
    sigma: float = 0.02,
    seed: int = 7,
    calibration: FloatArray | None = None,
) -> tuple[Network, NetworkState]:
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
    return network, NetworkState(lens[None], rotations, positions, points, used)


def _looking(position: FloatArray, roll: float) -> FloatArray:
    """Return the rotation of a camera that looks at the origin, rolled about its axis, rad."""
    forward = -position / np.linalg.norm(position)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    upright = np.array([right, np.cross(forward, right), forward])
    cosine, sine = np.cos(roll), np.sin(roll)
    turn = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    return np.asarray(turn @ upright)


def known(network: Network) -> Network:
    """Return a network with scale bars and control points, one of each a check."""
    points = solution().state.points
    bars = [
        ScaleBar(
            (network.targets[a], network.targets[b]),
            float(np.linalg.norm(points[a] - points[b])) + 0.02,
            0.05,
            check,
        )
        for a, b, check in ((0, 1, False), (2, 3, True))
    ]
    control = [
        ControlPoint(network.targets[index], points[index] - 0.01, 0.0004 * np.eye(3), check)
        for index, check in ((4, False), (5, True))
    ]
    return replace(network, bars=tuple(bars), control=tuple(control))


def solution(photographs: int = 6, targets: int = 12, unit: str = 'mm') -> Solution:
    """Return an adjusted network of targets in a volume, all of them seen in all photographs.

    Its coordinates are the true ones, its residuals the noise; its covariances are made up.
    """
    network, start = simulated(photographs, targets, calibration=CALIBRATION)
    seen = network.observations
    poses = start.rotations[seen.photograph], start.positions[seen.photograph]
    errors = seen.xy - project(CALIBRATION, *poses, start.points[seen.point])
    rows = 0.01 * np.random.default_rng(8).standard_normal((3 * targets, 3 * targets))
    sigmas = np.array([0.3, 0.2, 0.2, 1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 0, 0])
    return Solution(
        network=replace(network, unit=unit),
        state=start,
        residuals=errors,
        normalised=np.hypot(*errors.T) / 0.02,
        camera_covariances=(np.diag(sigmas**2),),
        released=(('f', 'cx', 'cy', 'k1', 'k2', 'k3', 'p1', 'p2'),),
        pose_covariances=np.tile(np.diag([4e-4] * 3 + [1e-8] * 3), (photographs, 1, 1)),
        covariance_of_points=rows @ rows.T / len(rows),
        sigma0=0.98,
        redundancy=2 * len(errors) - 6 * photographs - 3 * targets - 8 + 7,
        rejected=(),
        warnings=(),
    )


def records(of: Network, size: tuple[int, int] = SIZE) -> list[dict[str, Any]]:
    """Return the image points of a network as `ahf identify --json` prints them."""
    seen = of.observations
    found = []
    for index, name in enumerate(of.photographs):
        targets = tuple(
            Target(
                int(of.targets[seen.point[row]]),
                19,
                x=float(seen.xy[row, 0]),
                y=float(seen.xy[row, 1]),
                semi_major=4.0,
                semi_minor=3.5,
                covariance=tuple(seen.covariance[row].ravel().tolist()),
                family='cct12',
            )
            for row in np.flatnonzero(seen.photograph == index)
        )
        found.append(to_json(Identification(targets), name, size[::-1], 'cct12', 'ring'))
    return found
