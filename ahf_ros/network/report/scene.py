"""A network as numbers for the view that turns: targets, ellipsoids, photographs, known ones."""

from typing import Any

import numpy as np

from ahf_ros.network.network import FloatArray
from ahf_ros.network.report.coordinates import CONFIDENCE, round_number
from ahf_ros.network.report.figures import axes_of
from ahf_ros.network.solution import Solution
from ahf_ros.network.strength import semi_axes

_ELLIPSOID = 0.04  # of the extent of the targets: size that the median ellipsoid is enlarged to
_DIGITS = 6  # of the extent: a millionth of it is no pixel
_DIRECTION = 4  # decimals of a direction, at least
_ROWS, _COLUMNS = np.triu_indices(3)


def scene(solution: Solution) -> dict[str, Any]:
    """Return what a view of a network in space draws, ready for JSON.

    Coordinates are along the axes of the views from above and from the side, about the middle of
    the targets. `spreads` are covariances xx, xy, xz, yy, yz, zz of ellipsoids that hold 95 %, and
    are `enlarged`; `photographs` have a place, and directions forward and to the right. Ends of
    bars and control points are indices of targets, with 1 for checks.
    """
    axes, names = axes_of(solution)
    network, known, posed = solution.network, solution.determined, solution.oriented
    places = solution.state.points[known] @ axes.T
    middle = (places.min(axis=0) + places.max(axis=0)) / 2 if len(places) else np.zeros(3)
    extent = float(np.ptp(places, axis=0).max(initial=0)) or 1.0
    largest = CONFIDENCE * semi_axes(solution)[known, 0]
    sizes = largest[largest > 0]
    enlarged = round_number(_ELLIPSOID * extent / float(np.median(sizes))) if len(sizes) else 1.0
    spreads = (CONFIDENCE * enlarged) ** 2 * (axes @ solution.point_covariances[known] @ axes.T)
    turns = solution.state.rotations[posed]
    cameras = solution.state.positions[posed] @ axes.T - middle
    directions = np.concatenate((cameras, turns[:, 2] @ axes.T, turns[:, 0] @ axes.T), axis=1)
    targets = [network.targets[index] for index in np.flatnonzero(known)]
    index = {name: place for place, name in enumerate(targets)}
    return {
        'axes': names,
        'unit': network.unit,
        'enlarged': enlarged,
        'targets': targets,
        'places': _short(places - middle, extent),
        'spreads': _short(
            spreads[:, _ROWS, _COLUMNS], float(np.abs(spreads).max(initial=0)) or 1.0
        ),
        'photographs': [network.photographs[it] for it in np.flatnonzero(posed)],
        'cameras': _short(directions, extent),
        'bars': [
            [*(index[end] for end in bar.ends), int(bar.check)]
            for bar in network.bars
            if all(end in index for end in bar.ends)
        ],
        'control': [[index[it.name], int(it.check)] for it in network.control if it.name in index],
    }


def _short(values: FloatArray, extent: float) -> list[list[float]]:
    """Return numbers without the digits that nobody sees."""
    digits = max(_DIGITS - 1 - int(np.floor(np.log10(extent))), _DIRECTION)
    return np.round(values, digits).tolist()
