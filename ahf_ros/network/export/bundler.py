"""Adjusted networks as Bundler writes them, for photographs that were undistorted [1]_.

Bundler has neither a principal point nor tangential distortion. Its file is therefore of ideal
photographs: image points are those of a camera without distortion whose principal point is in the
middle, and both coefficients are zero. Image points count from the middle, x right and y up; the
frame of a camera has y up and z backwards.

References
----------
.. [1] Snavely, Bundler v0.4 User's Manual, 2009.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from ahf_ros.files.files import csv_table, text_of
from ahf_ros.network.camera import undistort
from ahf_ros.network.export.adjusted import Seen, by_target, file_name, lens_of, numbers, oriented
from ahf_ros.network.network import FloatArray
from ahf_ros.network.solution import Solution

_COLOUR = '255 255 255'
_AXES = np.diag([1.0, -1.0, -1.0])  # of our frame of the camera in Bundler's


def bundler_files(solution: Solution) -> dict[str, bytes]:
    """Return cameras and points, the list of photographs, and the IDs of the points.

    A ValueError names a photograph with a blank in its name, at which readers split.
    """
    start, network = solution.state, solution.network
    posed, tracks = oriented(solution), by_target(solution)
    names = [file_name(solution, number) for number in posed]
    if blank := next((name for name in names if len(name.split()) != 1), ''):
        raise ValueError(f'bundler splits at blanks, accepted is a name without: {blank!r}')
    place = {number: index for index, number in enumerate(posed)}
    lines = ['# Bundle file v0.3', f'{len(posed)} {len(tracks)}']
    for number in posed:
        rotation = _AXES @ start.rotations[number]
        focal = lens_of(solution, int(network.camera_of[number])).fy
        lines += [f'{focal:.15g} 0 0', *(numbers(row) for row in rotation)]
        lines.append(numbers(-rotation @ start.positions[number]))
    every = [it for seen in tracks.values() for it in seen]
    ideal = iter(_ideal(solution, every).tolist())
    keys: Counter[int] = Counter()
    for target, seen in tracks.items():
        views = []
        for it, (x, y) in zip(seen, ideal, strict=False):
            views.append(f'{place[it.photograph]} {keys[it.photograph]} {x:.6f} {y:.6f}')
            keys[it.photograph] += 1
        lines += [numbers(start.points[target]), _COLOUR, ' '.join([str(len(views)), *views])]
    labels = [(row, network.targets[target]) for row, target in enumerate(tracks)]
    return {
        'bundle.out': text_of(lines),
        'list.txt': text_of(names),
        'bundle_labels.csv': csv_table([('point', 'id'), *labels]),
    }


def _ideal(solution: Solution, seen: Sequence[Seen]) -> FloatArray:
    """Return image points (n, 2) without distortion, px from the middle, y up."""
    cameras = solution.network.camera_of[[it.photograph for it in seen]]
    calibrations = solution.state.calibrations[cameras]
    places = undistort(calibrations, np.array([it.xy for it in seen]).reshape(-1, 2))
    return np.asarray(calibrations[:, :1] * places * (1, -1))
