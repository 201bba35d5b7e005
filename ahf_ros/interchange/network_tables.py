"""What an adjusted network says beside its coordinates: calibrations, poses, residuals, checks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.interchange.camera_files import opencv_yaml, ros_yaml
from ahf_ros.interchange.files import csv_table
from ahf_ros.orientation.deviations import bar_deviations, control_deviations
from ahf_ros.orientation.solution import Solution
from ahf_ros.orientation.transform import Transform

Table = list[Sequence[object]]


def calibration_files(solution: Solution) -> dict[str, bytes]:
    """Return the calibration of each camera for ROS and for OpenCV, by the names of files."""
    files = {}
    views = solution.network.cameras
    for index, view in enumerate(views):
        calibration = solution.start.calibrations[index]
        if not np.isfinite(calibration).all():
            continue
        stem = 'camera' if len(views) == 1 else f'camera_{index + 1}'
        for suffix, write in (('ros', ros_yaml), ('opencv', opencv_yaml)):
            files[f'{stem}_{suffix}.yaml'] = write(
                *(view.name, view.width, view.height),
                calibration,
                solution.camera_covariances[index],
            )
    return files


def tables(solution: Solution) -> dict[str, bytes]:
    """Return poses, residuals and, where there are any, scale bars and control points as CSV."""
    found = {'poses.csv': _poses(solution), 'residuals.csv': _residuals(solution)}
    if bars := _bars(solution):
        found['scale_bars.csv'] = bars
    if control := _control(solution):
        found['control.csv'] = control
    return {name: csv_table(rows) for name, rows in found.items()}


def _poses(solution: Solution) -> Table:
    """Return poses as ROS has them: the camera's frame in the world, optical axes, x y z w."""
    network, values = solution.network, solution.start
    sigmas = [f'sigma_{it}' for it in ('x', 'y', 'z', 'rx', 'ry', 'rz')]
    rows: Table = [['image', 'camera', 'x', 'y', 'z', 'qx', 'qy', 'qz', 'qw', *sigmas]]
    for index in np.flatnonzero(solution.oriented):
        variances = np.diag(solution.pose_covariances[index])
        numbers = [*values.positions[index], *Transform(values.rotations[index].T).quaternion]
        numbers += list(np.sqrt(np.maximum(variances, 0)))
        camera = network.cameras[network.camera_of[index]].name
        rows.append([network.photographs[index], camera, *(f'{it:.10g}' for it in numbers)])
    return rows


def _residuals(solution: Solution) -> Table:
    """Return measured minus computed image points, empty where nothing could be computed."""
    network, seen = solution.network, solution.network.observations
    rows: Table = [['image', 'id', 'x', 'y', 'residual_x', 'residual_y', 'normalised', 'used']]
    for index, (photograph, point) in enumerate(zip(seen.photograph, seen.point, strict=True)):
        numbers = [*solution.residuals[index], solution.normalised[index]]
        rows.append(
            [
                network.photographs[photograph],
                network.targets[point],
                *(f'{value:.6f}' for value in seen.xy[index]),
                *(f'{value:.6g}' if np.isfinite(value) else '' for value in numbers),
                int(solution.start.used[index]),
            ]
        )
    return rows


def _bars(solution: Solution) -> Table:
    header = 'id_1 id_2 length sigma role computed deviation sigma_deviation'
    rows: Table = [header.split()]
    for it in bar_deviations(solution):
        numbers = [f'{value:.9g}' for value in (it.length, it.deviation, it.sigma)]
        role = 'check' if it.bar.check else 'control'
        rows.append([*it.bar.ends, it.bar.length, it.bar.sigma, role, *numbers])
    return rows if len(rows) > 1 else []


def _control(solution: Solution) -> Table:
    header = 'id x y z role deviation_x deviation_y deviation_z sigma_x sigma_y sigma_z'
    rows: Table = [header.split()]
    for it in control_deviations(solution):
        numbers = [f'{value:.9g}' for value in (*it.deviation, *it.sigma)]
        role = 'check' if it.point.check else 'control'
        rows.append([it.point.name, *it.point.xyz.tolist(), role, *numbers])
    return rows if len(rows) > 1 else []
