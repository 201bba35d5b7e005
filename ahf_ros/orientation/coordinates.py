"""Coordinates of targets with the whole of their covariance: what a network is made for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.orientation.network import FloatArray
from ahf_ros.orientation.solution import Solution


@dataclass(frozen=True)
class Coordinates:
    """Coordinates of targets by name, and what tests of them need.

    `points` is (n, 3) and `covariance` (3n, 3n), in the order x1, y1, z1, x2, and so on, in `unit`
    and its square; `unit` is empty where nothing gave the network a scale. `sigma0` and
    `redundancy` are those of the adjustment.
    """

    names: tuple[str, ...]
    points: FloatArray
    covariance: FloatArray
    sigma0: float
    redundancy: int
    unit: str


def coordinates_of(solution: Solution) -> Coordinates:
    """Return the coordinates of the targets that a network determines, in its order."""
    points = solution.start.points
    known = np.isfinite(points).all(axis=1)
    rows = np.repeat(known, 3)
    names = solution.network.targets
    return Coordinates(
        names=tuple(names[index] for index in np.flatnonzero(known)),
        points=points[known],
        covariance=solution.covariance_of_points[np.ix_(rows, rows)],
        sigma0=solution.sigma0,
        redundancy=solution.redundancy,
        unit=solution.network.unit,
    )
