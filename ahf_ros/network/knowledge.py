"""What is known beside image points: scale bars, control points, and the datum as conditions.

Bars and control points are observations with variances. A covariance is split along its axes:
directions without variance are constraints. What they leave open of the seven movements of the
network is held by inner constraints [1]_.

References
----------
.. [1] Förstner & Wrobel, Photogrammetric Computer Vision, Springer 2016, 4.5 and 15.4.
"""

from dataclasses import dataclass

import numpy as np

from ahf_ros.network.calibration import usual
from ahf_ros.network.datum import Datum, movements
from ahf_ros.network.image_points import Layout
from ahf_ros.network.least_squares import Conditions, Knowledge
from ahf_ros.network.network import ControlPoint, FloatArray, IntArray, Network, ScaleBar
from ahf_ros.network.solution import NetworkState

_NO_VARIANCE = 1e-14  # of a direction, relative to the largest of the point
_DETERMINED = (
    1e-6  # singular value of a movement that conditions determine, relative to the largest
)
_NOTHING = np.zeros(0, int), np.zeros(0), np.zeros(0)


@dataclass(frozen=True)
class Known:
    """Bars and control points of a layout, and what holds the frame.

    `ends` (b, 2) and `control` (c,) are compact indices of points; `in_datum` those that hold the
    frame by inner constraints; `fixed` (origin, on the x axis, in the plane z = 0) that hold it
    instead, if any. `lenses` are columns, values and standard deviations of what is usual of them.
    """

    bars: tuple[ScaleBar, ...]
    ends: IntArray
    control: tuple[ControlPoint, ...]
    controlled: IntArray
    in_datum: IntArray
    fixed: IntArray | None
    lenses: tuple[IntArray, FloatArray, FloatArray]


def gathered(
    network: Network,
    layout: Layout,
    datum: Datum,
    lenses: FloatArray | None = None,
    *,
    checks: bool = False,
) -> Known:
    """Return what the adjustment of a layout uses of bars and control points in a datum.

    With approximate calibrations, `lenses`, what is usual of them is known as well; with
    `checks`, they are there, too.
    """
    index = {network.targets[target]: place for place, target in enumerate(layout.points)}
    bars = tuple(
        bar
        for bar in network.bars
        if (checks or not bar.check) and all(end in index for end in bar.ends)
    )
    control: tuple[ControlPoint, ...] = ()
    if kind(network, datum) == 'control':
        control = tuple(
            point
            for point in network.control
            if (checks or not point.check) and point.name in index
        )
    return Known(
        bars,
        np.array([[index[end] for end in bar.ends] for bar in bars], dtype=int).reshape(-1, 2),
        control,
        np.array([index[point.name] for point in control], dtype=int),
        np.array([index[name] for name in datum.targets or index if name in index], dtype=int),
        np.array([index[name] for name in datum.targets]) if datum.kind == 'fixed' else None,
        usual(network, layout, lenses) if lenses is not None else _NOTHING,
    )


def kind(network: Network, datum: Datum) -> str:
    """Return the datum's kind, chosen by whether there are control points where it is None."""
    used = any(not point.check for point in network.control)
    return datum.kind or ('control' if used else 'inner')


def knowledge(layout: Layout, known: Known) -> Knowledge:
    """Return the conditions of bars, control points and datum as a function of the values."""

    def conditions(state: NetworkState) -> Conditions:
        points = state.points[layout.points]
        parts = [of_bars(known, points), of_control(known, points)]
        parts.append(_of_datum(known, points, np.concatenate([part[0] for part in parts])))
        rows, gaps, variances = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        columns, middles, sigmas = known.lenses
        wide = np.zeros((len(rows) + len(columns), layout.unknowns))
        wide[: len(rows), : rows.shape[1]] = rows
        wide[len(rows) + np.arange(len(columns)), columns] = 1
        beside = middles - state.calibrations[layout.free][columns - 3 * len(layout.points)]
        return Conditions(
            wide,
            np.concatenate([gaps, beside]),
            np.concatenate([variances, sigmas**2]),
            usual=len(columns),
        )

    return conditions


def of_bars(known: Known, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return rows, gaps and variances of scale bars at points (n, 3)."""
    first, second = known.ends.T
    difference = points[second] - points[first]
    distance = np.linalg.norm(difference, axis=1)
    rows = np.zeros((len(known.bars), *points.shape))
    bar = np.arange(len(known.bars))
    rows[bar, second] = difference / distance[:, None]
    rows[bar, first] = -rows[bar, second]
    lengths = np.array([bar.length for bar in known.bars])
    variances = np.array([bar.sigma for bar in known.bars]) ** 2
    return rows.reshape(len(rows), points.size), lengths - distance, variances


def of_control(known: Known, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return rows, gaps and variances of control points along the axes of their covariances."""
    rows = np.zeros((len(known.control), 3, *points.shape))
    gaps = np.zeros((len(known.control), 3))
    variances = np.zeros((len(known.control), 3))
    for number, (point, place) in enumerate(zip(known.control, known.controlled, strict=True)):
        size, axes = np.linalg.eigh(point.covariance)
        variances[number] = np.where(size > _NO_VARIANCE * size.max(), size, 0)
        rows[number, :, place] = axes.T
        gaps[number] = axes.T @ (point.xyz - points[place])
    return rows.reshape(-1, points.size), gaps.reshape(-1), variances.reshape(-1)


def _of_datum(
    known: Known, points: FloatArray, conditions: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return exact rows that hold the movements which the conditions' rows leave open."""
    free = movements(points)
    determined = conditions @ free
    _, sizes, axes = np.linalg.svd(determined if len(determined) else np.zeros((1, 7)))
    rank = int((sizes > _DETERMINED * max(sizes[0], _DETERMINED)).sum())
    if known.fixed is not None:
        rows, gaps = _fixed(known.fixed, points, 7 - rank)
    else:
        weights = np.zeros(len(points))
        weights[known.in_datum] = 1
        rows = axes[rank:] @ (free * np.repeat(weights, 3)[:, None]).T
        gaps = np.zeros(len(rows))
    return rows, gaps, np.zeros(len(rows))


def _fixed(targets: IntArray, points: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return rows and gaps of the origin, an x axis and the plane z = 0, and of the scale."""
    first, second, third = targets
    pairs = [(first, 0), (first, 1), (first, 2), (second, 1), (second, 2), (third, 2), (second, 0)]
    rows = np.zeros((count, *points.shape))
    gaps = np.zeros(count)
    for row, (target, axis) in enumerate(pairs[:count]):
        rows[row, target, axis] = 1
        gaps[row] = -points[target, axis] if row < 6 else 0
    return rows.reshape(count, points.size), gaps
