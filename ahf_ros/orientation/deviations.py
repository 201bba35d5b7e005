"""Known lengths and coordinates beside those of an adjusted network."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ahf_ros.orientation.measurement import distances
from ahf_ros.orientation.network import ControlPoint, FloatArray, ScaleBar
from ahf_ros.orientation.points import blocks
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
    points = solution.measured_points
    names = set(points.names if points.unit else ())
    bars = [bar for bar in solution.network.bars if names.issuperset(bar.ends)]
    return [
        BarDeviation(bar, it.length, math.hypot(it.sigma, bar.sigma if bar.check else 0.0))
        for bar, it in zip(bars, distances(points, [bar.ends for bar in bars]), strict=True)
    ]


def control_deviations(solution: Solution) -> list[ControlDeviation]:
    """Return the control and check points that the network determines, if it has a scale."""
    points = solution.measured_points
    known = [it for it in solution.network.control if points.unit and it.name in points.names]
    rows = points.indices([it.name for it in known])
    variances = np.diagonal(blocks(points.covariance)[rows], axis1=1, axis2=2)
    return [
        ControlDeviation(
            point,
            points.xyz[row] - point.xyz,
            np.sqrt(np.maximum(own, 0) + point.check * np.diag(point.covariance)),
        )
        for point, row, own in zip(known, rows, variances, strict=True)
    ]
