"""Photographs of a camera that were taken with another zoom or focus than the rest.

Each gets a camera of its own, which starts where the photograph alone fits. Afterwards cameras
whose focal lengths are the same to within their precision are one again.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from ahf_ros.base.text import counted
from ahf_ros.network.camera import pinhole
from ahf_ros.network.network import FloatArray, IntArray, Network
from ahf_ros.network.refinement import lengths_of, refine, spread_of
from ahf_ros.network.resection import FEWEST_POINTS, Resection, resections
from ahf_ros.network.solution import NetworkState, Solution
from ahf_ros.network.triples import LENS, STEPS, focal_steps
from ahf_ros.network.views import View

_ZOOMED = 0.01  # change of a photograph's focal length that is another zoom
_SUSPECT = 0.8  # share of a photograph's observations that agree, below which its zoom is tested
_LARGE_SPREAD = 3.0  # of residuals, in standard deviations, from which on all zooms are tested
_GROUPS = 0.03  # the same between groups of photographs, each with a lens of its own
_HALVINGS = 8  # of steps between focal lengths, to 0.06 %
_TRIED = 8  # photographs without a pose whose zoom is tested
_FITS = 6.0  # robust spread of a photograph, in those of the network, that its own zoom reaches
_SAME = 4.0  # standard deviations between focal lengths that may be one


def with_own_zooms(
    network: Network, views: Sequence[View], start: NetworkState, among: Sequence[int]
) -> tuple[Network, NetworkState] | None:
    """Return a network in which photographs of another zoom have a camera each, and its values.

    Those are tested of which a fifth disagrees, or all where residuals are large throughout, and
    of those `among` that have no pose a few. All of them get one. None where no zoom differs.
    """
    lengths, photograph = lengths_of(network, start), network.observations.photograph
    posed = np.isfinite(start.positions[:, 0])
    known = np.bincount(photograph[~np.isnan(lengths)], minlength=len(posed))
    agree = np.bincount(photograph[start.used], minlength=len(posed))
    suspect = posed & ((agree < _SUSPECT * known) | (spread_of(lengths) > _LARGE_SPREAD))
    for camera, view in enumerate(network.cameras):
        mine = posed & (network.camera_of == camera)
        if (
            view.fixed and 2 * suspect[mine].sum() > mine.sum()
        ):  # it is the calibration that is wrong
            suspect[mine] = False
    lenses, calibrations = start.calibrations[network.camera_of], start.calibrations.copy()
    if suspect.any():
        own = np.flatnonzero(suspect)
        divided, freed = _divided(network, start, own, lenses[own])
        for free in (('f',), *LENS):
            freed = refine(divided, freed, free)
        lenses[own] = freed.calibrations[len(network.cameras) :]
        for camera in np.unique(network.camera_of[own]):
            mine = lenses[posed & (network.camera_of == camera)]
            calibrations[camera] = np.median(mine, axis=0)
        start = replace(freed, calibrations=calibrations)
    other = np.abs(lenses[:, 0] / calibrations[network.camera_of, 0] - 1) > _ZOOMED
    rest = np.array([index for index in among if not posed[index]], int)
    most = sorted(rest, key=lambda index: -len(views[index].points))[:_TRIED]
    if other.any() or any(_is_zoomed(network, views[index], start) for index in most):
        own = np.union1d(np.flatnonzero(suspect), rest)
        lenses[rest] = calibrations[network.camera_of[rest]]
        return _divided(network, start, own, lenses[own])
    return None


def _divided(
    network: Network, start: NetworkState, own: IntArray, lenses: FloatArray
) -> tuple[Network, NetworkState]:
    """Return a network in which some photographs have a camera each, with these calibrations."""
    camera_of, usual = network.camera_of.copy(), network.camera_of[own]
    camera_of[own] = len(network.cameras) + np.arange(len(own))
    views = tuple(
        replace(
            network.cameras[camera],
            name=f'{network.cameras[camera].name} ({network.photographs[index]})',
            focal_length=None,
            calibration=None,
            fixed=False,
        )
        for index, camera in zip(own, usual, strict=True)
    )
    used = start.used | np.isin(network.observations.photograph, own)
    calibrations = np.concatenate([start.calibrations, lenses])
    return (
        replace(network, cameras=network.cameras + views, camera_of=camera_of),
        replace(start, calibrations=calibrations, used=used),
    )


def with_common_zooms(network: Network, solution: Solution) -> tuple[Network, NetworkState]:
    """Return a divided network whose cameras of one focal length are one again, and its values.

    `network` is the one that was not divided.
    """
    divided, start = solution.network, solution.state
    sigma = np.sqrt([covariance[0, 0] for covariance in solution.camera_covariances])
    one_of = np.arange(len(divided.cameras))
    for camera in range(len(network.cameras)):
        mine = np.unique(divided.camera_of[network.camera_of == camera])
        mine = mine[sigma[mine] > 0]
        order = mine[np.argsort(start.calibrations[mine, 0], kind='stable')]
        cluster: list[int] = []
        for each in order:
            precise = min(cluster, key=sigma.__getitem__, default=each)
            focal = start.calibrations[each, 0]
            apart = abs(focal - start.calibrations[precise, 0])
            near = apart < min(_SAME * np.hypot(sigma[each], sigma[precise]), _ZOOMED * focal)
            cluster = [*cluster, int(each)] if near else [int(each)]
            one_of[cluster] = min(cluster)
    used, camera_of = np.unique(one_of[divided.camera_of], return_inverse=True)
    cameras = tuple(divided.cameras[place] for place in used)
    return (
        replace(divided, cameras=cameras, camera_of=camera_of),
        replace(start, calibrations=start.calibrations[used]),
    )


def of_other_zooms(network: Network, solution: Solution) -> tuple[str, ...]:
    """Return warnings of photographs that got another camera than in the network."""
    own = solution.network
    names = [own.cameras[camera].name for camera in own.camera_of]
    usual = [network.cameras[camera].name for camera in network.camera_of]
    warnings = []
    for camera, view in enumerate(network.cameras):
        mine = solution.oriented & (network.camera_of == camera)
        other = np.flatnonzero(mine & (np.array(names) != np.array(usual)))
        if len(other):
            lengths = solution.state.calibrations[own.camera_of[mine], 0]
            cameras = counted(len(set(own.camera_of[other].tolist())), 'camera')
            warnings.append(
                f'camera {view.name}: {len(other)} of {mine.sum()} photographs, such as '
                f'{network.photographs[other[0]]}, have another focal length than the rest, or '
                f'than each other, and {cameras} of their own: from {lengths.min():.0f} to '
                f'{lengths.max():.0f} px. Without zoom or focus in between, coordinates are more '
                'precise'
            )
    return tuple(warnings)


def with_own_focal(
    network: Network, view: View, start: NetworkState, spread: float
) -> tuple[list[Resection], FloatArray]:
    """Return the poses of a photograph of an unknown zoom, and the calibration that fits best."""
    camera, seen = network.cameras[view.camera], np.isfinite(start.points[view.points, 0])
    lens = start.calibrations[view.camera]
    if not np.isfinite(lens[0]):
        lens = pinhole(max(camera.width, camera.height), camera.width, camera.height)

    @cache
    def fit(focal: float) -> tuple[list[Resection], FloatArray]:
        calibrations = start.calibrations.copy()
        calibrations[view.camera] = focal, *lens[1:]
        xy, sigma = view.normalised(calibrations)
        poses = resections(start.points[view.points[seen]], xy[seen], sigma[seen] * spread)
        return poses, calibrations[view.camera]

    def scale(focal: float) -> float:
        poses = fit(focal)[0]
        return poses[0].scale if poses else np.inf

    best = min(focal_steps(camera), key=scale)
    step = STEPS[1] / STEPS[0]
    for _ in range(_HALVINGS):
        step = np.sqrt(step)
        best = min((best / step, best, best * step), key=scale)
    return fit(best)


def _is_zoomed(network: Network, view: View, start: NetworkState) -> bool:
    """Return whether only another focal length than that of its camera fits a photograph."""
    seen = np.isfinite(start.points[view.points, 0])
    if not np.isfinite(start.calibrations[view.camera, 0]) or seen.sum() <= FEWEST_POINTS:
        return False
    spread = spread_of(lengths_of(network, start))
    poses, _ = with_own_focal(network, view, start, spread)
    xy, sigma = view.normalised(start.calibrations)
    usual = resections(start.points[view.points[seen]], xy[seen], sigma[seen] * spread)
    return bool(poses) and poses[0].scale < min([_FITS, *(it.scale / 3 for it in usual[:1])])


def zooms_of_groups(network: Network, solutions: Sequence[Solution]) -> tuple[str, ...]:
    """Return warnings of cameras whose focal length differs between groups of photographs."""
    warnings = []
    for view in network.cameras:
        lengths = [
            float(solution.state.calibrations[camera, 0])
            for solution in solutions
            for camera in np.unique(solution.network.camera_of[solution.oriented])
            if solution.network.cameras[camera].name == view.name
        ]
        if lengths and max(lengths) > (1 + _GROUPS) * min(lengths):
            text = ', '.join(f'{length:.0f}' for length in lengths)
            warnings.append(
                f'camera {view.name}: its focal length is {text} px in groups of photographs. '
                'Photographs of another zoom need a camera of their own'
            )
    return tuple(warnings)
