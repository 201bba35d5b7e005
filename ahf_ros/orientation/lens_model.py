"""Whether Brown's model describes a lens as far as the border of its images."""

from __future__ import annotations

import numpy as np

from ahf_ros.orientation.camera import undistort
from ahf_ros.orientation.network import FloatArray
from ahf_ros.orientation.solution import Solution

_BORDER = 0.8  # share of the image points that are nearer to the principal point
_FEWEST = 10  # image points at the border that do not fit
_OFTEN = 0.05, 5.0  # share of those at the border, and times that of the others
_AS_EQUIDISTANT = 0.02  # share of the distance from the principal point
_WIDE = 0.5  # rad off the axis, beyond which a fisheye lens differs from others


def unsuitable_lenses(solution: Solution) -> tuple[str, ...]:
    """Return warnings of lenses that Brown's model does not describe, with the one that would."""
    network, seen = solution.network, solution.network.observations
    known = solution.oriented[seen.photograph] & solution.determined[seen.point]
    warnings = []
    for camera in np.flatnonzero(solution.calibrated).tolist():
        calibration = solution.start.calibrations[camera]
        rows = np.flatnonzero(known & (network.camera_of[seen.photograph] == camera))
        radius = np.linalg.norm(seen.xy[rows] - calibration[1:3], axis=1)
        if not len(rows):
            continue
        limit = float(np.quantile(radius, _BORDER))
        off, border = ~solution.start.used[rows], radius > limit
        often, rest = float(off[border].mean()), float(off[~border].mean())
        if off[border].sum() < _FEWEST or often < max(_OFTEN[0], _OFTEN[1] * rest):
            continue
        model = 'Take targets from nearer the middle, or images that were undistorted'
        if _is_equidistant(calibration, seen.xy[rows[~off]]):
            model = (
                'It is an equidistant fisheye lens: undistort the images with that model (OpenCV '
                'fisheye, Kalibr equidistant), and identify again'
            )
        warnings.append(
            f"camera {network.cameras[camera].name}: Brown's model does not describe its lens at "
            f'the border: {often:.0%} of the image points further than {limit:.0f} px from the '
            f'principal point do not fit, and {rest:.1%} of the others. {model}'
        )
    return tuple(warnings)


def _is_equidistant(calibration: FloatArray, xy: FloatArray) -> bool:
    """Return whether image points (n, 2) are about f times their angle off the principal point."""
    angle = np.arctan(np.linalg.norm(undistort(calibration, xy), axis=1))
    distance = np.linalg.norm(xy - calibration[1:3], axis=1) / calibration[0]
    wide = angle > _WIDE
    return bool(wide.any() and np.abs(distance[wide] / angle[wide] - 1).max() < _AS_EQUIDISTANT)
