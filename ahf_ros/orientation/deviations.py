"""Known lengths and coordinates beside those of an adjusted network."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ahf_ros.orientation.network import ControlPoint, FloatArray, ScaleBar
from ahf_ros.orientation.solution import Solution


@dataclass(frozen=True)
class BarDeviation:
    """A scale bar, its length in the network, and the standard deviation of the difference.

    The latter counts the bar's own precision where it is a check; a bar that was used has the one
    of its adjusted length.
    """

    bar: ScaleBar
    length: float
    sigma: float

    @property
    def deviation(self) -> float:
        """Computed minus known length."""
        return self.length - self.bar.length


@dataclass(frozen=True)
class ControlDeviation:
    """A control point, computed minus known coordinates (3,), and their standard deviations."""

    point: ControlPoint
    deviation: FloatArray
    sigma: FloatArray


def bar_deviations(solution: Solution) -> list[BarDeviation]:
    """Return the scale bars whose ends the network determines, if it has a scale."""
    index = _determined(solution)
    found = []
    for bar in solution.network.bars if solution.network.unit else ():
        if not all(end in index for end in bar.ends):
            continue
        first, second = (index[end] for end in bar.ends)
        points = solution.start.points
        along = points[second] - points[first]
        length = float(np.linalg.norm(along))
        rows = [*range(3 * first, 3 * first + 3), *range(3 * second, 3 * second + 3)]
        slopes = np.concatenate((-along, along)) / length
        variance = float(slopes @ solution.covariance_of_points[np.ix_(rows, rows)] @ slopes)
        own = bar.sigma if bar.check else 0.0
        found.append(BarDeviation(bar, length, math.sqrt(max(variance, 0.0) + own**2)))
    return found


def control_deviations(solution: Solution) -> list[ControlDeviation]:
    """Return the control and check points that the network determines, if it has a scale."""
    index = _determined(solution)
    found = []
    for point in solution.network.control if solution.network.unit else ():
        if point.name in index:
            row = index[point.name]
            block = solution.covariance_of_points[3 * row : 3 * row + 3, 3 * row : 3 * row + 3]
            own = np.diag(point.covariance) if point.check else np.zeros(3)
            sigma = np.sqrt(np.maximum(np.diag(block), 0) + own)
            found.append(ControlDeviation(point, solution.start.points[row] - point.xyz, sigma))
    return found


def _determined(solution: Solution) -> dict[str, int]:
    """Return the rows of the targets that have coordinates."""
    known = np.isfinite(solution.start.points).all(axis=1)
    return {solution.network.targets[row]: int(row) for row in np.flatnonzero(known)}
