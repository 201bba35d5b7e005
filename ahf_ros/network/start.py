"""Approximate values of a whole network without knowing any: seeds of three photographs, growth.

A seed grows by resection of the photographs that see enough of its points and by triangulation of
the points that enough of its photographs see. Photographs that do not hang together with the rest
are oriented each group by itself.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from ahf_ros.network.camera import known_calibration
from ahf_ros.network.network import FloatArray, IntArray, Network
from ahf_ros.network.planar import mirrored
from ahf_ros.network.progress import stage
from ahf_ros.network.refinement import lengths_of, refine, spread_of
from ahf_ros.network.resection import ALIKE, BOUND, FEWEST_POINTS, Resection, resections
from ahf_ros.network.solution import NetworkState
from ahf_ros.network.triangulation import intersect
from ahf_ros.network.triples import WEAK, focal_sigma, known_calibrations, seeds, with_lens
from ahf_ros.network.views import View, views_of
from ahf_ros.network.zoom import with_own_focal, with_own_zooms

MOST_SEEDS = 5

MOST_DIVISIONS = 3
"""Times that photographs of other zooms get cameras of their own."""

GROWING = 5
"""Known points of a photograph that is added while points and lenses are still uncertain."""

BATCH = 4
"""One photograph for so many oriented ones, at least one, is added between two adjustments: the
values stay as good as after each single one, in a quarter of the time."""

FEWEST_PHOTOGRAPHS = 3
"""What two photographs say is checked by nothing."""

AGREES = 0.9
"""Share of observations that agree in a network that needs no other seed."""

ONE_MINIMUM = np.radians(0.5)
"""Networks most of whose photographs are turned against each other by less are the same."""


def starts(network: Network) -> list[tuple[Network, NetworkState]]:
    """Return approximate values of each connected group of photographs, the largest first.

    Photographs of another zoom have cameras of their own in its network. Groups without
    approximate values are left out. The same network gives the same values, bit for bit: what is
    sampled at random is sampled with fixed seeds.
    """
    views = views_of(network)
    remaining = [index for index, view in enumerate(views) if len(view.points) >= FEWEST_POINTS]
    found: list[tuple[Network, NetworkState]] = []
    while len(remaining) >= FEWEST_PHOTOGRAPHS:
        stage('start values', f'a beginning among {len(remaining)} photographs')
        largest = _largest(network, views, remaining)
        if largest is None:
            break
        divided, start = largest
        other, excess = reversal(divided, start)
        found.append((divided, other if excess < 0 else start))
        remaining = [index for index in remaining if np.isnan(start.positions[index, 0])]
    return found


def oriented(start: NetworkState) -> IntArray:
    """Return the indices of photographs that have a pose."""
    return np.flatnonzero(np.isfinite(start.positions[:, 0]))


def reversal(network: Network, start: NetworkState) -> tuple[NetworkState, float]:
    """Return the mirror image of a network, adjusted, and its chi-square less that of the network.

    Infinite where the mirror image does not exist, or is the network itself.
    """
    try:
        other = _adjusted(network, mirrored(start), rounds=15)
    except (ValueError, np.linalg.LinAlgError):
        return start, np.inf
    group = oriented(start)
    turns, others = (
        each.rotations[group[1:]] @ each.rotations[group[0]].T for each in (start, other)
    )
    cosines = (np.einsum('kij,kij->k', turns, others) - 1) / 2
    # Single photographs may be left behind where the others turn back.
    if not np.isfinite(cosines).all() or np.mean(cosines > np.cos(ONE_MINIMUM)) > 0.5:
        return start, np.inf
    lengths = [np.nan_to_num(lengths_of(network, each), nan=0.0) for each in (start, other)]
    spread = min(spread_of(each[each > 0]) for each in lengths)
    costs = [float(np.sum(np.minimum(each / spread, BOUND) ** 2)) for each in lengths]
    return other, costs[1] - costs[0]


def _largest(
    network: Network, views: Sequence[View], among: Sequence[int]
) -> tuple[Network, NetworkState] | None:
    """Return what grows largest of the best seeds, of several equally large ones the best.

    Where a second seed agrees about as many photographs, or one with zooms, others are not tried.
    """
    best: tuple[float, float] | None = None
    result: tuple[Network, NetworkState] | None = None
    for seed in islice(seeds(network, views, among), MOST_SEEDS):
        grown = _with_zooms(network, views, seed.state, among)
        if grown is None or len(oriented(grown[1])) < FEWEST_PHOTOGRAPHS:
            continue
        lengths, start = lengths_of(*grown), grown[1]
        number = len(oriented(start))
        rating = (-number, spread_of(lengths) / max(float(np.mean(start.used)), 1e-9))
        known = ~np.isnan(lengths)
        agrees = np.mean(start.used[known]) > AGREES
        again = best is not None and -best[0] == number
        if best is None or rating < best:
            best, result = rating, grown
        divided = len(grown[0].cameras) > len(network.cameras)
        if agrees and (again or divided or number == len(among)):
            break
    return result


def _with_zooms(
    network: Network, views: Sequence[View], start: NetworkState, among: Sequence[int]
) -> tuple[Network, NetworkState] | None:
    """Return what a seed reaches, in a network whose other zooms have cameras of their own."""
    grown = _grown(network, views, start, among)
    for _ in range(MOST_DIVISIONS):
        divided = with_own_zooms(network, views, grown, among) if grown is not None else None
        if divided is None:
            break
        network, views = divided[0], views_of(divided[0])
        grown = _grown(network, views, divided[1], among)
    return (network, grown) if grown is not None else None


def _grown(
    network: Network, views: Sequence[View], start: NetworkState, among: Sequence[int]
) -> NetworkState | None:
    """Return the values of all photographs and points that a seed reaches."""
    postponed: dict[int, int] = {}
    fewest = GROWING
    try:
        start = _adjusted(network, start)
        while True:
            stage('start values', f'{len(oriented(start))} of {len(among)} photographs')
            start = _intersected(network, views, start)
            chosen = _next(views, start, among, postponed, fewest)
            if not chosen and (fewest == FEWEST_POINTS or len(oriented(start)) == len(among)):
                break
            if not chosen:  # all others are there: what was doubtful may be certain by now
                start = _pruned(views, _adjusted(network, start, rounds=30), postponed, fewest)
                postponed.clear()
                fewest = FEWEST_POINTS
                continue
            spread = spread_of(lengths_of(network, start))
            added = 0
            for photograph in chosen:
                pose, calibration = _pose(network, views[photograph], start, spread, fewest)
                if pose is None:
                    postponed[photograph] = _known(views[photograph], start)
                    continue
                start = _with_pose(start, views[photograph], photograph, pose, calibration)
                added += 1
            if added:
                start = _pruned(views, _adjusted(network, start), postponed, fewest)
        start = _pruned(views, _adjusted(network, start, rounds=30), postponed, fewest)
        return _intersected(network, views, start)
    except (ValueError, np.linalg.LinAlgError):
        return None


def _pruned(
    views: Sequence[View], start: NetworkState, postponed: dict[int, int], fewest: int
) -> NetworkState:
    """Return the values without photographs most of whose points do not agree."""
    rotations, positions, used = start.rotations.copy(), start.positions.copy(), start.used.copy()
    for photograph in oriented(start):
        view = views[photograph]
        known = _known(view, start)
        if start.used[view.rows].sum() < max(fewest, known / 2):
            rotations[photograph], positions[photograph] = np.nan, np.nan
            used[view.rows] = False
            postponed[photograph] = known
    return replace(start, rotations=rotations, positions=positions, used=used)


def _known(view: View, start: NetworkState) -> int:
    """Return how many points of a photograph have coordinates."""
    return int(np.isfinite(start.points[view.points, 0]).sum())


def _next(
    views: Sequence[View],
    start: NetworkState,
    among: Sequence[int],
    postponed: dict[int, int],
    fewest: int,
) -> list[int]:
    """Return the photographs to orient next, those with most known points first.

    A photograph that was postponed comes again when more of its points are known.
    """
    known = {
        index: _known(views[index], start)
        for index in among
        if np.isnan(start.positions[index, 0])
    }
    able = [
        index
        for index, number in known.items()
        if number >= fewest and number > postponed.get(index, 0)
    ]
    able.sort(key=lambda index: (-known[index], index))
    return able[: max(1, len(oriented(start)) // BATCH)]


def _pose(
    network: Network, view: View, start: NetworkState, spread: float, fewest: int
) -> tuple[Resection | None, FloatArray]:
    """Return the pose of a photograph and its calibration; None while it is not certain.

    Where nothing is known of its camera, its focal length is searched.
    """
    calibration = start.calibrations[view.camera]
    seen = np.isfinite(start.points[view.points, 0])
    taken = np.isfinite(start.positions[network.camera_of == view.camera, 0])
    if taken.any() or np.isfinite(known_calibration(network.cameras[view.camera])[0]):
        xy, sigma = view.normalised(start.calibrations)
        poses = resections(start.points[view.points[seen]], xy[seen], sigma[seen] * spread)
    else:
        poses, calibration = with_own_focal(network, view, start, spread)
    if not poses or poses[0].agrees.sum() < max(fewest, seen.sum() / 2):
        return None, calibration
    doubtful = len(poses) > 1 and poses[1].chi_square < poses[0].chi_square + ALIKE
    return (None if doubtful else poses[0]), calibration


def _with_pose(
    start: NetworkState, view: View, photograph: int, pose: Resection, calibration: FloatArray
) -> NetworkState:
    """Return the values with one photograph more."""
    rotations, positions = start.rotations.copy(), start.positions.copy()
    calibrations, used = start.calibrations.copy(), start.used.copy()
    rotations[photograph], positions[photograph] = pose.rotation, pose.position
    calibrations[view.camera] = calibration
    seen = np.isfinite(start.points[view.points, 0])
    used[view.rows[seen]] = pose.agrees
    return replace(
        start, rotations=rotations, positions=positions, calibrations=calibrations, used=used
    )


def _intersected(network: Network, views: Sequence[View], start: NetworkState) -> NetworkState:
    """Return the values with every point that enough rays determine.

    Points on which their rays agree stay; others are intersected anew, and dropped if that fails.
    """
    observed = network.observations
    spread = spread_of(lengths_of(network, start))
    posed = np.isfinite(start.positions[observed.photograph, 0])
    rays = np.bincount(observed.point[posed], minlength=len(network.targets))
    agree = np.bincount(observed.point[posed & start.used], minlength=len(network.targets))
    settled = np.isfinite(start.points[:, 0]) & (agree >= 2) & (agree >= 0.7 * rays)
    wanted = np.flatnonzero(~settled & (rays >= 2))
    points, used = start.points.copy(), start.used.copy()
    points[~settled] = np.nan
    if not len(wanted):
        return replace(start, points=points)
    places = np.zeros((len(observed.xy), 2))
    sigmas = np.full(len(observed.xy), np.inf)
    for photograph in oriented(start):
        view = views[photograph]
        places[view.rows], sigmas[view.rows] = view.normalised(start.calibrations)
    posed &= np.isfinite(sigmas)
    for point in wanted:
        rows = np.flatnonzero(posed & (observed.point == point))
        images = observed.photograph[rows]
        met = intersect(
            start.rotations[images], start.positions[images], places[rows], spread * sigmas[rows]
        )
        used[rows] = False
        if met is not None:
            points[point] = met.xyz
            used[rows] = met.agrees
    return replace(start, points=points, used=used)


def _adjusted(network: Network, start: NetworkState, rounds: int = 8) -> NetworkState:
    """Return the values after a robust adjustment of what the photographs determine so far.

    Focal lengths that nobody gave are free; others, and the lens, when they become certain and
    residuals ask for them.
    """
    photographs = len(oriented(start))
    given = np.isfinite(known_calibrations(network)[:, 0])
    free: tuple[str, ...] = ()
    held = tuple(
        replace(camera, fixed=camera.fixed or bool(known))
        for camera, known in zip(network.cameras, given, strict=True)
    )
    if not given.all():
        free = ('f',)
    partly = replace(network, cameras=held)
    if free and photographs < 10 and focal_sigma(partly, start, free) > WEAK:
        free = ()
    start = refine(partly, start, free, rounds=rounds)
    return with_lens(network, start, rounds)[0]
