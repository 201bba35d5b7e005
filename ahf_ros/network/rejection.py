"""Observations are taken off and on again, one by one, until the tests agree with the adjustment.

Then each one that is off gets its reason: the place of another target, a second place of its own,
or none that is known. Single rays cannot tell which of two places of an ID is wrong, and a point
between both fits none. So the rays of an ID are split into groups that meet, largest first,
whatever the adjustment thought of each.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ahf_ros.network import camera, image_points
from ahf_ros.network.image_points import Layout
from ahf_ros.network.least_squares import Knowledge, Precision, minimise, of_computed, precision
from ahf_ros.network.network import FloatArray, Network, Rejection, rejected
from ahf_ros.network.progress import stage
from ahf_ros.network.solution import NetworkState
from ahf_ros.network.testing import (
    CRITICAL,
    SIGNIFICANCE,
    Tails,
    UnitWeight,
    normalised,
    special,
    tails,
    unit_weight,
    worst,
)
from ahf_ros.network.triangulation import SMALLEST_ANGLE, directions

_MOST_PAIRS = 400  # of rays that are tried, spread evenly
_ROUNDS_OF_PLACES = 3  # of intersection and choice of rays


_ROUNDS = 60  # of tests; each takes off one observation of a photograph and a target at most
_SUSPECT = (
    0.25  # share of a target's rays that disagree, from which on a second place is looked for
)
Mask = NDArray[np.bool_]
LayOut = Callable[[NetworkState], Layout]
"""Lays out the used observations of a state."""


class Place(NamedTuple):
    """A point (3,) where rays of an ID meet, and the rows of the layout that do so."""

    point: FloatArray
    rows: NDArray[np.int64]


def places(
    layout: Layout, state: NetworkState, rows: NDArray[np.int64], tolerance: float
) -> list[Place]:
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
    layout: Layout, state: NetworkState, rows: NDArray[np.int64], tolerance: float
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
    lengths = image_points.lengths_at(layout, state, np.repeat(rows, len(points)), every)
    met = lengths.reshape(len(rows), -1) < tolerance
    best = int(met.sum(axis=0).argmax())
    point, chosen = points[best], met[:, best]
    for _ in range(_ROUNDS_OF_PLACES):
        if chosen.sum() < 2:
            return None
        point = _intersections(centres[None, chosen], towards[None, chosen])[0]
        again = image_points.lengths_at(layout, state, rows, np.tile(point, (len(rows), 1)))
        chosen = again < tolerance
    return Place(point, rows[chosen]) if chosen.sum() > 1 else None


def _rays(
    layout: Layout, state: NetworkState, rows: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    """Return the centres (n, 3) and directions (n, 3) of the rays of rows of a layout."""
    photographs = layout.photographs[layout.photograph[rows]]
    calibrations = state.calibrations[layout.camera[rows]]
    ideal = camera.undistort(
        calibrations, layout.xy[rows], layout.backward, layout.equidistant[layout.camera[rows]]
    )
    towards = directions(state.rotations[photographs], np.nan_to_num(ideal))
    return state.positions[photographs], towards


def _intersections(centres: FloatArray, towards: FloatArray) -> FloatArray:
    """Return the points (g, 3) nearest to groups of rays from centres (g, n, 3)."""
    across = np.eye(3) - towards[..., :, None] * towards[..., None, :]
    right = (across @ centres[..., None]).sum(axis=1)
    return np.linalg.solve(across.sum(axis=1), right)[:, :, 0]


@dataclass(frozen=True)
class Adjusted:
    """An adjustment: its layout, values and precision for unit weights, and how it was tested.

    `every` is the layout of all observations between its photographs and points, `lengths` their
    normalised residuals, and `share` (m,) how many coordinates of each the unknowns explain.
    """

    layout: Layout
    state: NetworkState
    knowledge: Knowledge
    precision: Precision
    every: Layout
    used: Mask
    lengths: FloatArray
    share: FloatArray
    converged: bool

    @property
    def unit(self) -> UnitWeight:
        """The variance of unit weight of what was measured, with its test."""
        measured = self.knowledge(self.state).measured
        known = ((measured.rows @ self.precision.rest) * measured.rows).sum(axis=1)
        lengths = image_points.whitened_lengths(self.layout, self.state)
        redundancy = (2 - self.share[self.used]).sum() + (1 - known / measured.variances).sum()
        return unit_weight(float((lengths**2).sum()) + measured.cost, round(redundancy))

    @property
    def tails(self) -> Tails:
        """The distribution of the normalised residuals of used observations."""
        return tails(self.lengths[self.used])


def adjusted(
    network: Network, state: NetworkState, lay_out: LayOut, known: Callable[[Layout], Knowledge]
) -> Adjusted:
    """Return the least-squares adjustment of the used observations, with tests of all."""
    layout = lay_out(state)
    knowledge = known(layout)
    state, converged = minimise(layout, state, knowledge)
    covariances = precision(layout, state, knowledge)
    every = image_points.extended(network, layout)
    used = np.isin(every.observations, layout.observations)
    design = image_points.linearise(every, state)
    computed = of_computed(every, design, covariances)
    lengths = normalised(every, state, design, computed, used)
    share = np.trace(computed, axis1=1, axis2=2)
    return Adjusted(layout, state, knowledge, covariances, every, used, lengths, share, converged)


def tested(
    network: Network, state: NetworkState, lay_out: LayOut, known: Callable[[Layout], Knowledge]
) -> tuple[Adjusted, float]:
    """Return the adjustment after Baarda's tests, and the residual from which on one fails them.

    Residuals are tested with unit weights, or where 1 is not plausible with the variance that
    they have, and the worst of each photograph and target is off first. An observation comes on
    again once.
    """
    returned = np.zeros(len(network.observations.xy), dtype=bool)
    seen = np.isin(
        network.observations.photograph, np.flatnonzero(np.isfinite(state.positions[:, 0]))
    )
    for number in range(_ROUNDS):
        stage('test of image points', f'round {number + 1}, {(seen & ~state.used).sum()} left out')
        result = adjusted(network, state, lay_out, known)
        every, lengths = result.every, result.lengths
        critical = CRITICAL * (1.0 if result.unit.plausible else result.tails.deviation)
        off = worst(every, np.where(lengths > critical, lengths, 0), result.used)
        on = ~result.used & (lengths < critical) & ~returned[every.observations]
        if not (off.any() or on.any()):
            break
        returned[every.observations[on]] = True
        used = np.zeros(len(returned), dtype=bool)
        used[every.observations[(result.used & ~off) | on]] = True
        state = replace(result.state, used=used)
    return result, critical


def relocated(
    network: Network, state: NetworkState, layout: Layout, tolerance: float
) -> NetworkState:
    """Return values in which each suspect target is where most of its rays meet.

    Suspect is a target of which a quarter of the rays disagrees: it may lie between two places, or
    at the lesser one.
    """
    everything = np.ones(len(network.observations.xy), dtype=bool)
    wider = replace(layout, points=np.arange(len(network.targets)))
    every = image_points.extended(network, wider)
    points, used = state.points.copy(), state.used & everything
    agrees = state.used[every.observations]
    rays = np.bincount(every.point, minlength=len(points))
    wrong = np.bincount(every.point[~agrees], minlength=len(points))
    for target in np.flatnonzero((wrong >= 2) & (wrong >= _SUSPECT * rays)):
        rows = np.flatnonzero(every.point == target)
        found = places(every, state, rows, tolerance)
        if found and len(found[0].rows) > rays[target] - wrong[target]:
            points[target] = found[0].point
            used[every.observations[rows]] = np.isin(rows, found[0].rows)
    return replace(state, points=points, used=used)


def rejections(
    network: Network, result: Adjusted, critical: float
) -> tuple[tuple[Rejection, ...], tuple[str, ...]]:
    """Return what is off with its reason, and warnings of targets at two places."""
    every, state = result.every, result.state
    reasons: dict[int, str] = {}
    warnings = []
    off = np.flatnonzero(~result.used)
    targets, wrong = np.unique(every.point[off], return_counts=True)
    level = SIGNIFICANCE / max(int((wrong > 1).sum()), 1)
    for target in targets:
        rows = off[every.point[off] == target]
        for place in places(every, state, rows, critical):
            if _by_chance(every, state, place, rows) > level:
                continue
            moved = place.point - state.points[every.points[target]]
            name = network.targets[every.points[target]]
            distance = f'{np.linalg.norm(moved):.4g} {network.unit}'.strip()
            reasons.update(
                (int(row), f'same ID at two places: a second one {distance} away')
                for row in place.rows
            )
            kept = int((result.used & (every.point == target)).sum())
            warnings.append(
                f'target {name} is at two places, {distance} apart: seen at the one that is kept '
                f'in {kept} photographs, at the other in {len(place.rows)}'
            )
    for row in off:
        other = _other_target(every, state, int(row), critical)
        if other is not None:
            reasons[int(row)] = f'wrong ID: the place of target {network.targets[other]}'
    usual, few = 'does not fit the other photographs', 'in fewer than two photographs that agree'
    left_out = [
        rejected(network, int(observation), reasons.get(row, usual), float(result.lengths[row]))
        for row, observation in zip(off.tolist(), every.observations[off], strict=True)
    ]
    left_out += [rejected(network, int(place), few) for place in _unchecked(network, result)]
    return tuple(left_out), tuple(warnings)


def _by_chance(every: Layout, state: NetworkState, place: Place, rows: NDArray[np.int64]) -> float:
    """Return how often some of a target's wrong rays meet so well at one place by chance.

    A shift of the target explains three of the coordinates of their residuals, and more than three
    of any that are wrong by chance only if they come from another place: an F-test, made for each
    choice of as many rays.
    """
    free = 2 * len(place.rows) - 3
    targets = state.points[every.points[every.point[place.rows]]]
    here, there = (
        float((image_points.lengths_at(every, state, place.rows, points) ** 2).sum())
        for points in (targets, np.tile(place.point, (len(place.rows), 1)))
    )
    ratio = (here - there) / 3 / max(there / free, np.finfo(float).tiny)
    choices = math.comb(len(rows), len(place.rows))
    return choices * float(special().fdtrc(3, free, max(ratio, 0.0)))


def _other_target(every: Layout, state: NetworkState, row: int, tolerance: float) -> int | None:
    """Return the index of another target whose image is where a row was measured, if any."""
    points = state.points[every.points]
    rows = np.full(len(points), row)
    lengths = image_points.lengths_at(every, state, rows, points)
    lengths[every.point[row]] = np.inf
    nearest = int(lengths.argmin())
    return int(every.points[nearest]) if lengths[nearest] < tolerance else None


def _unchecked(network: Network, result: Adjusted) -> NDArray[np.int64]:
    """Return observations in adjusted photographs of targets that have too few rays."""
    observations = network.observations
    inside = np.isin(observations.photograph, result.every.photographs)
    return np.flatnonzero(inside & ~np.isin(observations.point, result.every.points))
