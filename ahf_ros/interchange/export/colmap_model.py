"""Adjusted networks as a model of COLMAP in text: cameras.txt, images.txt, points3D.txt.

COLMAP has (0, 0) at the corner of the first pixel, so that 0.5 is added. Its models have no shear,
and its points no names: `point_labels.csv` has those.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.interchange.files import csv_table
from ahf_ros.orientation.camera import PARAMETERS
from ahf_ros.orientation.solution import Solution
from ahf_ros.orientation.transform import Transform

_SHIFT = 0.5
_GRAY = '128 128 128'


def colmap_model_files(solution: Solution) -> dict[str, bytes]:
    """Return the model, whose identifiers are places in the network from 1 on.

    A ValueError is raised if the name of a photograph does not print.
    """
    points_of = _points_of_images(solution)
    labels = [
        (index + 1, name)
        for index, name in enumerate(solution.network.targets)
        if solution.determined[index]
    ]
    return {
        'cameras.txt': _text(_cameras(solution)),
        'images.txt': _text(_images(solution, points_of)),
        'points3D.txt': _text(_points(solution, points_of)),
        'point_labels.csv': csv_table([('point3D_id', 'id'), *labels]),
    }


def _text(lines: list[str]) -> bytes:
    return ''.join(f'{line}\n' for line in lines).encode()


def _points_of_images(solution: Solution) -> list[list[int]]:
    """Return the used observations of each photograph with a pose, in their order."""
    network, values = solution.network, solution.start
    lists: list[list[int]] = [[] for _ in network.photographs]
    known = values.used & solution.determined[network.observations.point]
    for row in np.flatnonzero(known):
        lists[network.observations.photograph[row]].append(int(row))
    return lists


def _cameras(solution: Solution) -> list[str]:
    """Return cameras of the model FULL_OPENCV, without its denominator."""
    lines = ['# CAMERA_ID, MODEL, WIDTH, HEIGHT, fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6']
    for index, view in enumerate(solution.network.cameras):
        if not solution.calibrated[index]:
            continue
        value = dict(zip(PARAMETERS, solution.start.calibrations[index].tolist(), strict=True))
        fx = value['f'] * (1 + value['affinity'])
        numbers = [fx, value['f'], value['cx'] + _SHIFT, value['cy'] + _SHIFT]
        numbers += [value[name] for name in ('k1', 'k2', 'p1', 'p2', 'k3')] + [0.0] * 3
        text = ' '.join(f'{number:.15g}' for number in numbers)
        lines.append(f'{index + 1} FULL_OPENCV {view.width} {view.height} {text}')
    return lines


def _images(solution: Solution, points_of: list[list[int]]) -> list[str]:
    """Return poses from world to camera, and the image points below each of them."""
    network, values = solution.network, solution.start
    lines = ['# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME, then X, Y, POINT3D_ID']
    for index in np.flatnonzero(solution.oriented):
        name = network.photographs[index]
        if not name.isprintable():
            raise ValueError(f'image is {name!r}, accepted is a name that prints')
        rotation = values.rotations[index]
        x, y, z, w = Transform(rotation).quaternion
        numbers = [w, x, y, z, *(-rotation @ values.positions[index])]
        text = ' '.join(f'{number:.15g}' for number in numbers)
        lines.append(f'{index + 1} {text} {network.camera_of[index] + 1} {name}')
        seen = network.observations
        points = [
            f'{seen.xy[row, 0] + _SHIFT:.6f} {seen.xy[row, 1] + _SHIFT:.6f} {seen.point[row] + 1}'
            for row in points_of[index]
        ]
        lines.append(' '.join(points))
    return lines


def _points(solution: Solution, points_of: list[list[int]]) -> list[str]:
    """Return targets with their mean residual in px and the image points that show them."""
    network, values = solution.network, solution.start
    tracks: list[list[tuple[int, int, float]]] = [[] for _ in network.targets]
    for image in np.flatnonzero(solution.oriented):
        for place, row in enumerate(points_of[image]):
            error = float(np.hypot(*solution.residuals[row]))
            tracks[network.observations.point[row]].append((int(image) + 1, place, error))
    lines = ['# POINT3D_ID, X, Y, Z, R, G, B, ERROR, then IMAGE_ID, POINT2D_IDX']
    for index, track in enumerate(tracks):
        if track and solution.determined[index]:
            xyz = ' '.join(f'{value:.15g}' for value in values.points[index])
            mean = np.mean([it[2] for it in track])
            pairs = ' '.join(f'{image} {place}' for image, place, _ in track)
            lines.append(f'{index + 1} {xyz} {_GRAY} {mean:.6g} {pairs}')
    return lines
