"""Whether a lens is described by its model as far as the border of its images."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ahf_ros.network.camera import PARAMETERS, undistort
from ahf_ros.network.network import FloatArray, Network
from ahf_ros.network.solution import NetworkState, Solution

_BORDER = 0.8  # share of the image points that are nearer to the principal point
_FEWEST = 10  # image points at the border that do not fit
_OFTEN = 0.05, 5.0  # share of those at the border, and times that of the others
_AS_EQUIDISTANT = 0.02  # share of the distance from the principal point
_WIDE = 0.5  # rad off the axis, beyond which a fisheye lens differs from others


def unsuitable_lenses(solution: Solution) -> tuple[str, ...]:
    """Return warnings of lenses that their model does not describe."""
    return tuple(
        f'camera {solution.network.cameras[camera].name}: no model describes its lens at the '
        f'border: {often:.0%} of the image points further than {limit:.0f} px from the principal '
        f'point do not fit, and {rest:.1%} of the others. Take targets from nearer the middle, or '
        'images that were undistorted'
        for camera, limit, often, rest in _misfits(solution)
    )


def with_fisheye_lenses(solution: Solution) -> tuple[Network, NetworkState] | None:
    """Return the network whose lenses are equidistant where Brown's model fits only the middle.

    None where there are none. Calibrations that are kept fixed stay.
    """
    network, seen = solution.network, solution.network.observations
    views, calibrations = list(network.cameras), solution.state.calibrations.copy()
    for camera, *_ in _misfits(solution):
        rows = solution.state.used & (network.camera_of[seen.photograph] == camera)
        view = views[camera]
        if view.fixed or view.equidistant:
            continue
        if _is_equidistant(calibrations[camera], seen.xy[rows]):
            views[camera] = replace(view, equidistant=True)
            calibrations[camera, PARAMETERS.index('k1') :] = 0
    if tuple(views) == network.cameras:
        return None
    start = replace(solution.state, calibrations=calibrations)
    return replace(network, cameras=tuple(views)), start


def fisheye_lenses(network: Network, solution: Solution) -> tuple[str, ...]:
    """Return which lenses turned out to be equidistant ones."""
    given = {
        solution.network.cameras[found].name
        for found, usual in zip(solution.network.camera_of, network.camera_of, strict=True)
        if network.cameras[usual].equidistant
    }
    return tuple(
        f"camera {view.name}: its lens is an equidistant fisheye one. Brown's model does not "
        'describe it at the border of the images, so that of Kannala and Brandt is used'
        for view in solution.network.cameras
        if view.equidistant and view.name not in given
    )


def _misfits(solution: Solution) -> Iterator[tuple[int, float, float, float]]:
    """Yield cameras, the radius of their border in px, and shares of misfits beyond and inside."""
    network, seen = solution.network, solution.network.observations
    known = solution.oriented[seen.photograph] & solution.determined[seen.point]
    for camera in np.flatnonzero(solution.calibrated).tolist():
        rows = np.flatnonzero(known & (network.camera_of[seen.photograph] == camera))
        if not len(rows):
            continue
        radius = _radius(solution.state.calibrations[camera], seen.xy[rows])
        limit = float(np.quantile(radius, _BORDER))
        off, border = ~solution.state.used[rows], radius > limit
        often, rest = float(off[border].mean()), float(off[~border].mean())
        if off[border].sum() >= _FEWEST and often >= max(_OFTEN[0], _OFTEN[1] * rest):
            yield camera, limit, often, rest


def _radius(calibration: FloatArray, xy: FloatArray) -> FloatArray:
    """Return the distances (n,) of image points from the principal point in px."""
    return np.asarray(np.linalg.norm(xy - calibration[1:3], axis=1))


def _is_equidistant(calibration: FloatArray, xy: FloatArray) -> bool:
    """Return whether image points (n, 2) are about f times their angle off the principal point."""
    angle = np.arctan(np.linalg.norm(undistort(calibration, xy), axis=1))
    distance = _radius(calibration, xy) / calibration[0]
    wide = angle > _WIDE
    return bool(wide.any() and np.abs(distance[wide] / angle[wide] - 1).max() < _AS_EQUIDISTANT)
