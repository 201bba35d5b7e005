"""A small network whose coordinates, poses and observations are known without any error."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ahf_ros.interchange.target_json import to_json
from ahf_ros.orientation.camera import project
from ahf_ros.orientation.network import ControlPoint, Network, ScaleBar
from ahf_ros.orientation.simulation import SIZE, simulated
from ahf_ros.orientation.solution import Solution
from ahf_ros.target import Identification, Target

CALIBRATION = np.array([1500.0, 803.0, 596.0, -0.08, 0.02, 0.001, 2e-4, -1e-4, 1e-4, 2e-5])


def known(network: Network) -> Network:
    """Return a network with scale bars and control points, one of each a check."""
    points = solution().start.points
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
        start=start,
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
                *(19, *seen.xy[row].tolist(), 4.0, 3.5),
                covariance=tuple(seen.covariance[row].ravel().tolist()),
                family='cct12',
            )
            for row in np.flatnonzero(seen.photograph == index)
        )
        found.append(to_json(Identification(targets), name, size[::-1], 'cct12', 'ring'))
    return found
