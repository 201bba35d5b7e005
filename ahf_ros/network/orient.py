"""From image points and IDs to coordinates, and in words why where that is not possible."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.text import counted, listed
from ahf_ros.network.adjustment import adjust
from ahf_ros.network.calibration import UNDETERMINED
from ahf_ros.network.datum import Datum
from ahf_ros.network.lens_model import fisheye_lenses, unsuitable_lenses, with_fisheye_lenses
from ahf_ros.network.network import FloatArray, IntArray, Network, once_a_photograph
from ahf_ros.network.planar import principal_axes
from ahf_ros.network.progress import Watcher, watched
from ahf_ros.network.resection import FEWEST_POINTS, at_one_place
from ahf_ros.network.similarity import in_principal_axes
from ahf_ros.network.solution import NetworkState, Solution
from ahf_ros.network.start import FEWEST_PHOTOGRAPHS, oriented, reversal, starts
from ahf_ros.network.triples import FEWEST_COMMON, known_calibrations
from ahf_ros.network.views import views_of
from ahf_ros.network.zoom import of_other_zooms, with_common_zooms, zooms_of_groups

LINE = 0.01
"""Targets are on a line where their spread across it is less than this share of that along it."""

CONTRADICTING = 0.6
"""Share of observations that must agree for a network to be believed.

Those of its targets in photographs that could not be oriented disagree.
"""

WORSE = 1.1
"""Ratio of sigma0 from which on cameras of about one focal length are not one."""

NAMED = 8
"""Photographs or targets that a message names."""

TILT = (
    'take some that are tilted by 30 to 45 degrees from different sides, and roll the camera by '
    '90 degrees for some'
)


def orient(
    network: Network,
    datum: Datum | None = None,
    release: tuple[str, ...] | None = None,
    test: bool = True,
    *,
    keep_suspects: bool = False,
    progress: Watcher | None = None,
) -> list[Solution]:
    """Orient photographs and compute targets without any approximate values, and adjust them.

    Parameters
    ----------
    network : Network
        What was observed and is known. A target that is twice in a photograph is set aside there.
    datum : Datum, optional
        The frame of the coordinates, as for `adjust`.
    release : tuple of str, optional
        Parameters of the cameras that are estimated, as for `adjust`.
    test : bool
        Whether wrong observations are found and left out.
    keep_suspects : bool
        Whether bars and control points that contradict the photographs are used, as for `adjust`.
    progress : callable, optional
        Is called with each step, an `ahf_ros.network.progress.Progress`: stages, photographs
        and iterations.

    Returns
    -------
    list of Solution
        One for each group of photographs that hang together, the largest first. Their warnings say
        which photographs and targets are in none, and why.

    Raises
    ------
    ValueError
        If nothing can be oriented, or what fits is not the only thing that fits. The message says
        why and what to photograph.

    Examples
    --------
    >>> import cv2
    >>> from ahf_ros.network.camera import pinhole, project
    >>> from ahf_ros.network.network import CameraView, Observations
    >>> source = np.random.default_rng(1)
    >>> points, turns = source.uniform(-1, 1, (20, 3)), source.uniform(-0.5, 0.5, (6, 3))
    >>> rotations = [cv2.Rodrigues(turn + (0, 0, roll))[0] for roll, turn in enumerate(turns)]
    >>> lens = pinhole(1500.0, 1600, 1200)
    >>> xy = np.concatenate([project(lens, it, -5 * it[2], points) for it in rotations])
    >>> photograph, point = np.divmod(np.arange(len(xy)), len(points))
    >>> seen = Observations(photograph, point, xy, np.tile(1e-4 * np.eye(2), (len(xy), 1, 1)))
    >>> cameras = (CameraView('camera', 1600, 1200),)
    >>> names = tuple('123456'), tuple('ABCDEFGHIJKLMNOPQRST')
    >>> network = Network(names[0], np.zeros(6, int), cameras, names[1], seen)
    >>> (solution,) = orient(network)
    >>> round(float(solution.state.calibrations[0, 0]), 2), solution.covariance_of_points.shape
    (1500.0, (60, 60))
    """
    with one_blas_thread(), watched(progress):
        return _oriented(
            once_a_photograph(network),
            partial(adjust, datum=datum, release=release, test=test, keep_suspects=keep_suspects),
        )


def _oriented(
    network: Network, adjusted: Callable[[Network, NetworkState], Solution]
) -> list[Solution]:
    """Return the solutions of a network in which a target is once in a photograph."""
    _check(network)
    refused: list[str] = []
    solutions: list[Solution] = []
    for divided, start in starts(network):
        start = in_principal_axes(start)
        reason = _ambiguous(divided, start)
        if reason is None:
            solution = adjusted(divided, start)
            if len(divided.cameras) > len(network.cameras):
                common = adjusted(*with_common_zooms(network, solution))
                solution = common if common.sigma0 < WORSE * solution.sigma0 else solution
            if (fisheye := with_fisheye_lenses(solution)) is not None:
                other = adjusted(*fisheye)
                solution = (
                    other if other.state.used.sum() > solution.state.used.sum() else solution
                )
            reason = _doubtful(solution)
        if reason is None:
            warnings = solution.warnings + unsuitable_lenses(solution)
            warnings += of_other_zooms(network, solution) + fisheye_lenses(network, solution)
            solutions.append(replace(solution, warnings=warnings))
        else:
            refused.append(reason)
    if not solutions:
        raise ValueError(refused[0] if refused else _why_not(network))
    left = _left_out(network, solutions)
    first = solutions[0]
    return [
        replace(
            first,
            warnings=first.warnings + tuple(refused) + left + zooms_of_groups(network, solutions),
        ),
        *solutions[1:],
    ]


def _check(network: Network) -> None:
    """Raise `ValueError` where too little was observed for anything."""
    seen = np.bincount(network.observations.point, minlength=len(network.targets))
    targets = int(np.sum(seen > 1))
    photographs = len(np.unique(network.observations.photograph))
    needed = f'expected {FEWEST_COMMON} or more that three photographs have in common'
    if not targets:
        raise ValueError(f'targets: no ID is seen in two photographs, {needed}')
    if photographs < FEWEST_PHOTOGRAPHS:
        raise ValueError(
            f'photographs: {photographs} with targets, expected three or more: what two say is '
            'checked by nothing. Take more from other directions'
        )
    if targets < FEWEST_COMMON:
        raise ValueError(f'targets: {targets} in two or more photographs, {needed}')
    if all(_in_line(view.xy) for view in views_of(network) if len(view.points) > 2):
        raise ValueError(
            'targets: all of them lie on a line, which determines no pose. Put some beside it'
        )


def _in_line(xy: FloatArray) -> bool:
    """Return whether image points (n, 2) lie on a line, most of them."""
    for _ in range(2):
        spread, axes = principal_axes(xy)
        across = np.abs((xy - np.median(xy, axis=0)) @ axes[1])
        xy = xy[across <= 6 * np.median(across) + 1e-9]
        if len(xy) < 3:
            return True
    spread, _ = principal_axes(xy)
    return bool(spread[1] < LINE * spread[0])


def _why_not(network: Network) -> str:
    """Return why no three photographs have approximate values."""
    views = views_of(network)
    able = [index for index, view in enumerate(views) if len(view.points) >= FEWEST_COMMON]
    sets = {index: set(views[index].points.tolist()) for index in able[:60]}
    pairs = {pair: len(sets[pair[0]] & sets[pair[1]]) for pair in combinations(sets, 2)}
    most = max(pairs.values(), default=0)
    if most < FEWEST_COMMON:
        named = ''
        if most:
            a, b = max(pairs, key=lambda pair: pairs[pair])
            named = f' ({network.photographs[a]} and {network.photographs[b]})'
        return (
            f'photographs: no two have more than {counted(most, "target")} in common{named}, '
            f'expected {FEWEST_COMMON} or more in three. Take photographs that overlap'
        )
    if not np.isfinite(known_calibrations(network)[:, 0]).any():
        return (
            'focal length: no three photographs agree with any from 0.5 to 4 image widths. '
            f'Give a calibration or a focal length, or more photographs: {TILT}'
        )
    return (
        'photographs: no three of them determine each other. Take photographs of the same targets '
        'from directions that are 20 to 90 degrees apart'
    )


def _ambiguous(network: Network, start: NetworkState) -> str | None:
    """Return in words that the network's mirror image fits as well, None if it does not."""
    if reversal(network, start)[1] > 2.0:
        return None
    return (
        f'photographs: {_names(network.photographs, oriented(start))} fit two arrangements, which '
        'are mirror images of each other, equally well. Take some from nearer, with a shorter '
        'focal length, or from directions that differ more'
    )


def _doubtful(solution: Solution) -> str | None:
    """Return in words why an adjusted network is not believed, None if it is."""
    network, start = solution.network, solution.state
    photographs = oriented(start)
    names = _names(network.photographs, photographs)
    if len(photographs) < FEWEST_PHOTOGRAPHS:
        return (
            f'photographs: only {names or "none"} agree with each other, expected '
            f'{FEWEST_PHOTOGRAPHS} or more. Take more from other directions'
        )
    known = known_calibrations(network)[:, 0]
    cameras, taken = np.unique(network.camera_of[photographs], return_counts=True)
    for camera in cameras[taken >= min(FEWEST_PHOTOGRAPHS, taken.max())]:
        sigma = np.sqrt(solution.camera_covariances[camera][0, 0])
        focal = start.calibrations[camera, 0]
        if not np.isfinite(known[camera]) and not 0 < sigma < UNDETERMINED * focal:
            return (
                f'camera {network.cameras[camera].name}: its focal length cannot be determined '
                f'from {names}, which look in about the same direction. Give a calibration or a '
                f'focal length, or {TILT}'
            )
    observed = network.observations
    belongs = np.isfinite(start.points[observed.point, 0])
    share = float(np.mean(start.used[belongs])) if belongs.any() else 0.0
    if share < CONTRADICTING:
        return (
            f'photographs: only {share:.0%} of the observations of what {names} show agree with '
            f'each other, expected {CONTRADICTING:.0%} or more. Check IDs, cameras and whether '
            'targets moved'
        )
    return None


def _left_out(network: Network, solutions: Sequence[Solution]) -> tuple[str, ...]:
    """Return warnings of photographs that are in no solution."""
    posed = np.zeros(len(network.photographs), dtype=bool)
    placed = np.zeros(len(network.targets), dtype=bool)
    for solution in solutions:
        posed[oriented(solution.state)] = True
        placed |= np.isfinite(solution.state.points[:, 0])
    views = views_of(network)
    few, narrow, alike = [], [], []
    start = solutions[0].state
    for index in np.flatnonzero(~posed).tolist():
        seen = np.isfinite(start.points[views[index].points, 0])
        if seen.sum() < FEWEST_POINTS:
            few.append(index)
        elif at_one_place(views[index].xy[seen], views[index].sigma[seen]):
            narrow.append(index)
        else:
            alike.append(index)
    warnings = []
    if few:
        warnings.append(
            f'{_names(network.photographs, few)}: not oriented, fewer than {FEWEST_POINTS} '
            'targets with coordinates. Take photographs between them and the others'
        )
    if narrow:
        warnings.append(
            f'{_names(network.photographs, narrow)}: not oriented, all targets are at one place '
            'in the image. Check the identification'
        )
    if alike:
        warnings.append(
            f'{_names(network.photographs, alike)}: not oriented, no pose fits well or two fit '
            'alike. Check their IDs, and take others that are tilted or from nearer'
        )
    seen = np.bincount(network.observations.point, minlength=len(network.targets)) > 0
    if lost := np.flatnonzero(~placed & seen).tolist():
        warnings.append(
            f'targets {_names(network.targets, lost)}: no coordinates, fewer than two rays that '
            'agree and meet under 5 degrees or more. Take more photographs of them'
        )
    return tuple(warnings)


def _names(names: Sequence[str], indices: Sequence[int] | IntArray) -> str:
    """Return some of the names, and how many there are more."""
    return listed([names[index] for index in indices], NAMED)
