"""Known lengths and coordinates beside those of an adjusted network."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ahf_ros.network.measurement import distances
from ahf_ros.network.network import ControlPoint, FloatArray, ScaleBar
from ahf_ros.network.points import blocks, standard_deviations
from ahf_ros.network.solution import Solution, Suspect
from ahf_ros.network.testing import special

_FAILED = 0.0027
"""Error probability at which a check fails: 3 standard deviations."""


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
    """A control point, computed minus known coordinates (3,), and their covariance (3, 3)."""

    point: ControlPoint
    deviation: FloatArray
    covariance: FloatArray

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations in x, y and z."""
        return standard_deviations(self.covariance)


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
    return [
        ControlDeviation(
            point,
            points.xyz[row] - point.xyz,
            blocks(points.covariance)[row] + point.check * point.covariance,
        )
        for point, row in zip(known, rows, strict=True)
    ]


def failed_checks(solution: Solution, left_out: Sequence[Suspect] = ()) -> tuple[Suspect, ...]:
    """Return the checks that fail, but for suspects that were left out."""
    named = {it.name for it in left_out}
    found = []
    # A bar between two exact points says nothing of the network.
    for bar in (it for it in bar_deviations(solution) if it.bar.check and it.sigma > 0):
        statistic, gap = (bar.deviation / bar.sigma) ** 2, abs(bar.deviation)
        found.append((bar.bar.title, 1, statistic, gap))
    for it in (it for it in control_deviations(solution) if it.point.check):
        statistic = float(it.deviation @ np.linalg.pinv(it.covariance) @ it.deviation)
        gap = float(np.linalg.norm(it.deviation))
        found.append((it.point.title, 3, statistic, gap))
    return tuple(
        Suspect(name, gap, gap / math.sqrt(statistic), probability, 'failed')
        for name, freedom, statistic, gap in found
        if name not in named
        and (probability := float(special().chdtrc(freedom, statistic))) < _FAILED
    )


def said(failed: Sequence[Suspect], unit: str) -> tuple[str, ...]:
    """Return in words what it means that checks fail."""
    return tuple(
        f'check failed: {it.name} differs by {with_unit(it.gap, unit)}, '
        f'{it.gap / it.sigma:.1f} standard deviations. Either it is wrong, or the scale and the '
        'coordinates are, by as much'
        for it in failed
    )


def with_unit(length: float, unit: str) -> str:
    """Return a length with its unit."""
    return f'{length:.3g} {unit}'.rstrip()
