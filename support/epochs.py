"""Epochs of a small network: adjusted bundles with noise, and targets that moved."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.network.adjustment import adjust
from ahf_ros.network.camera import project
from ahf_ros.network.network import ScaleBar
from ahf_ros.network.points import MeasuredPoints
from ahf_ros.network.solution import Solution
from support.networks import CALIBRATION, solution

NOISE = 0.02
"""Standard deviation of image points, px, which is about 0.02 mm on the object."""


def epoch(
    seed: int, moved: Mapping[str, Sequence[float]] | None = None, unit: str = 'mm'
) -> Solution:
    """Return the adjusted network of 12 targets, some of which have moved, mm.

    The scale is that of a bar from target 1 to target 2; there is none if the unit is empty.
    """
    made = solution(unit=unit)
    points = made.state.points.copy()
    bar = ScaleBar(('1', '2'), float(np.linalg.norm(points[0] - points[1])), 0.005)
    for name, step in (moved or {}).items():
        points[made.network.targets.index(name)] += step
    seen, start = made.network.observations, replace(made.state, points=points)
    exact = np.array(
        [
            project(
                CALIBRATION, start.rotations[photograph], start.positions[photograph], points[[it]]
            )[0]
            for photograph, it in zip(seen.photograph, seen.point, strict=True)
        ]
    )
    noise = NOISE * np.random.default_rng(seed).standard_normal(exact.shape)
    network = replace(
        made.network,
        cameras=(replace(made.network.cameras[0], calibration=CALIBRATION, fixed=True),),
        observations=replace(seen, xy=exact + noise),
        bars=(bar,) if unit else (),
    )
    return adjust(network, start, release=(), test=False)


def measured(
    seed: int, moved: Mapping[str, Sequence[float]] | None = None, unit: str = 'mm'
) -> MeasuredPoints:
    """Return the coordinates of an epoch."""
    return epoch(seed, moved, unit).measured_points
