"""One ID at two places: a target that was moved, or two targets with one ID.

Single rays cannot tell which of two places is wrong, and a point between both fits none. So the
rays of an ID are split into groups that meet, largest first, whatever the adjustment thought of
each.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ahf_ros.orientation import camera, normals
from ahf_ros.orientation.network import FloatArray
from ahf_ros.orientation.normals import Layout
from ahf_ros.orientation.solution import Start
from ahf_ros.orientation.triangulation import SMALLEST_ANGLE, directions

_MOST_PAIRS = 400  # of rays that are tried, spread evenly
_ROUNDS = 3  # of intersection and choice of rays


class Place(NamedTuple):
    """A point (3,) where rays of an ID meet, and the rows of the layout that do so."""

    point: FloatArray
    rows: NDArray[np.int64]


def places(layout: Layout, state: Start, rows: NDArray[np.int64], tolerance: float) -> list[Place]:
    """Return where the rays of rows of a layout meet within a tolerance in standard deviations.

    Two rays or more make a place; each ray is used once.
    """
    found: list[Place] = []
    while len(rows) > 1:
        place = _largest(layout, state, rows, tolerance)
        if place is None:
            break
        found.append(place)
        rows = np.setdiff1d(rows, place.rows)
    return found


def _largest(
    layout: Layout, state: Start, rows: NDArray[np.int64], tolerance: float
) -> Place | None:
    """Return the place where most rays meet, by trying all pairs of them, or many."""
    pairs = np.array(list(combinations(range(len(rows)), 2)))
    pairs = pairs[np.unique(np.linspace(0, len(pairs) - 1, _MOST_PAIRS).astype(int))]
    centres, towards = _rays(layout, state, rows)
    cosines = (towards[pairs[:, 0]] * towards[pairs[:, 1]]).sum(axis=1)
    pairs = pairs[cosines < np.cos(SMALLEST_ANGLE)]
    if not len(pairs):
        return None
    points = _intersections(centres[pairs], towards[pairs])
    every = np.tile(points, (len(rows), 1))
    lengths = normals.lengths_at(layout, state, np.repeat(rows, len(points)), every)
    met = lengths.reshape(len(rows), -1) < tolerance
    best = int(met.sum(axis=0).argmax())
    point, chosen = points[best], met[:, best]
    for _ in range(_ROUNDS):
        if chosen.sum() < 2:
            return None
        point = _intersections(centres[None, chosen], towards[None, chosen])[0]
        again = normals.lengths_at(layout, state, rows, np.tile(point, (len(rows), 1)))
        chosen = again < tolerance
    return Place(point, rows[chosen]) if chosen.sum() > 1 else None


def _rays(layout: Layout, state: Start, rows: NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
    """Return the centres (n, 3) and directions (n, 3) of the rays of rows of a layout."""
    photographs = layout.photographs[layout.photograph[rows]]
    calibrations = state.calibrations[layout.camera[rows]]
    ideal = camera.undistort(calibrations, layout.xy[rows], layout.backward)
    towards = directions(state.rotations[photographs], np.nan_to_num(ideal))
    return state.positions[photographs], towards


def _intersections(centres: FloatArray, towards: FloatArray) -> FloatArray:
    """Return the points (g, 3) nearest to groups of rays from centres (g, n, 3)."""
    across = np.eye(3) - towards[..., :, None] * towards[..., None, :]
    right = (across @ centres[..., None]).sum(axis=1)
    return np.linalg.solve(across.sum(axis=1), right)[:, :, 0]
