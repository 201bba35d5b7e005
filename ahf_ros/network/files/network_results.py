"""Adjusted networks as files: network.json, tables, and the covariance of all points."""

from __future__ import annotations

import io
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.base.opening import LARGEST, Most, inside, parsed_json, read_text, reader
from ahf_ros.base.target_check import MAXIMUM_ID, checked_integer, checked_number
from ahf_ros.base.text import shown
from ahf_ros.base.writing import check_set, complete, write_set
from ahf_ros.files.arrays import read_arrays
from ahf_ros.files.files import csv_table
from ahf_ros.network.camera import EQUIDISTANT, PARAMETERS, parameters_of
from ahf_ros.network.deviations import bar_deviations, control_deviations
from ahf_ros.network.files.camera_files import FISHEYE, opencv_yaml, ros_yaml
from ahf_ros.network.network import CameraView, FloatArray, IntArray, Rejection
from ahf_ros.network.points import MeasuredPoints, blocks, standard_deviations
from ahf_ros.network.solution import Solution
from ahf_ros.network.strength import rays_of
from ahf_ros.network.transform import Transform

NETWORK_FILE = 'network.json'
POINTS_FILE = 'points.csv'
COVARIANCE_FILE = 'covariance_of_points.npz'

DISTORTION = (('k1', 'k2', 'k3', 'p1', 'p2', 'shear'), ('k1', 'k2', 'k3', 'k4', 'shear'))
"""Parameters of lenses in network.json, Brown's and equidistant; affinity is that of fx to fy."""


Table = list[Sequence[object]]


@dataclass(frozen=True)
class OrientedNetwork:
    """What `read_network` reads: measured points, and the cameras and photographs behind them.

    Arrays are as those of `ahf_ros.network.solution.Solution`, of oriented photographs only.
    """

    points: MeasuredPoints
    rays: IntArray
    cameras: tuple[CameraView, ...]
    calibrations: FloatArray
    camera_covariances: tuple[FloatArray, ...]
    photographs: tuple[str, ...]
    camera_of: IntArray
    rotations: FloatArray
    positions: FloatArray
    pose_covariances: FloatArray
    rejected: tuple[Rejection, ...]
    warnings: tuple[str, ...]


def write_network(
    folder: str | Path, solution: Solution, beside: Mapping[str, bytes] | None = None
) -> tuple[Path, ...]:
    """Write an adjusted network to a folder as a set of files, and return the paths.

    These are network.json, points.csv and the covariance of all points; calibrations, poses,
    residuals and checks; and what is `beside` them. Photographs and targets that could not be
    determined are left out, and named in the warnings. A ValueError is raised for a solution with
    backward distortion.
    """
    solution.check_forward()
    network, values = solution.network, solution.state
    points, rays = solution.measured_points, rays_of(solution)[solution.determined]
    record = {
        'sigma0': points.sigma0,
        'redundancy': points.redundancy,
        'unit': network.unit,
        'cameras': _cameras(solution),
        'images': [
            {
                'image': network.photographs[index],
                'camera': network.cameras[network.camera_of[index]].name,
                'rotation': values.rotations[index].tolist(),
                'position': values.positions[index].tolist(),
                'covariance': solution.pose_covariances[index].tolist(),
            }
            for index in np.flatnonzero(solution.oriented)
        ],
        'points': [
            {'id': name, **dict(zip('xyz', point, strict=True)), 'rays': int(number)}
            for name, point, number in zip(points.names, points.xyz.tolist(), rays, strict=True)
        ],
        'covariance_of_points': COVARIANCE_FILE,
        'rejected': [
            {
                'image': it.photograph,
                'id': it.target,
                'reason': it.reason,
                'normalised_residual': it.normalised_residual,
            }
            for it in rejections(solution)
        ],
        'warnings': [*solution.warnings, *_left_out(solution)],
    }
    files = {POINTS_FILE: _points_table(points, rays), COVARIANCE_FILE: _archive(points)}
    files |= calibration_files(solution) | tables(solution) | dict(beside or {})
    return write_set(folder, NETWORK_FILE, record, files.items())


def rejections(solution: Solution) -> list[Rejection]:
    """Return what was set aside from the start, and what the adjustment rejected."""
    aside = [it for it in solution.network.set_aside if it not in solution.rejected]
    return [*aside, *solution.rejected]


def _cameras(solution: Solution) -> list[dict[str, Any]]:
    cameras = []
    for index in np.flatnonzero(solution.calibrated):
        view, calibration = solution.network.cameras[index], solution.state.calibrations[index]
        value = dict(zip(parameters_of(view), calibration.tolist(), strict=True))
        cameras.append(
            {
                'name': view.name,
                'width': view.width,
                'height': view.height,
                'fx': value['f'] * (1 + value['affinity']),
                'fy': value['f'],
                'cx': value['cx'],
                'cy': value['cy'],
                'distortion_model': 'equidistant' if view.equidistant else 'plumb_bob',
                'distortion': {name: value[name] for name in DISTORTION[view.equidistant]},
                'covariance': solution.camera_covariances[index].tolist(),
            }
        )
    return cameras


def _left_out(solution: Solution) -> list[str]:
    """Return which photographs and targets the solution has no values for."""
    network = solution.network
    return [
        f'{what}: {", ".join(names[index] for index in np.flatnonzero(~known))}'
        for what, names, known in (
            ('photographs without a pose', network.photographs, solution.oriented),
            ('targets without coordinates', network.targets, solution.determined),
        )
        if not known.all()
    ]


def _points_table(points: MeasuredPoints, rays: IntArray) -> bytes:
    """Return coordinates, their standard deviations, rays and covariances of each point."""
    header = 'id x y z sigma_x sigma_y sigma_z rays covariance_xy covariance_xz covariance_yz'
    table: list[Sequence[object]] = [header.split()]
    own = blocks(points.covariance)
    for index, (name, block) in enumerate(zip(points.names, own, strict=True)):
        sigma = standard_deviations(block)
        mixed = [f'{value:.9g}' for value in block[np.triu_indices(3, 1)]]
        place = [f'{value:.12g}' for value in points.xyz[index]]
        table.append([name, *place, *(f'{it:.9g}' for it in sigma), int(rays[index]), *mixed])
    return csv_table(table)


def _archive(points: MeasuredPoints) -> bytes:
    """Return an npz of the IDs and the covariance, in whose order of x, y and z they are.

    `scaled` says whether it, like those of network.json, is multiplied by the square of sigma0.
    """
    file = io.BytesIO()
    np.savez_compressed(
        file,
        ids=np.array(points.names, str),
        covariance=points.covariance,
        scaled=np.array(points.scaled),
    )
    return file.getvalue()


@reader('what ahf orient of this version writes')
def read_network(folder: str | Path) -> OrientedNetwork:
    """Return the network that `ahf orient` wrote to a folder, or whose network.json is named.

    A ValueError names what is missing, damaged, or of another version or run.
    """
    path = inside(Path(folder), NETWORK_FILE) if Path(folder).is_dir() else Path(folder)
    complete(path.parent)
    content = parsed_json(read_text(path, Most.JSON), str(path))
    record = _Record(content, str(path))
    points = record.rows('points')
    check_set(path, content)
    names = tuple(it.text('id') for it in points)
    if twice := [name for name, number in Counter(names).items() if number > 1]:
        raise ValueError(f'{path}: points have {twice[0]!r} twice, accepted is one point an id')
    cameras = record.rows('cameras')
    images = record.rows('images')
    numbers = {it.text('name'): index for index, it in enumerate(cameras)}
    for it in images:
        if it.text('camera') not in numbers:
            raise ValueError(f'{it.where}: camera is {shown(it.text("camera"))}, not in cameras')
    xyz = _stacked([[it.number(axis) for axis in 'xyz'] for it in points], (3,))
    archive = inside(path.parent, record.text('covariance_of_points'))
    covariance, scaled = _covariance_of(archive, names)
    sigma0, redundancy = record.number('sigma0'), record.integer('redundancy')
    unit = record.text('unit')
    measured = MeasuredPoints(names, xyz, covariance, sigma0, redundancy, unit, scaled)
    return OrientedNetwork(
        points=measured,
        rays=np.array([it.integer('rays') for it in points], np.int64),
        cameras=tuple(
            CameraView(
                it.text('name'),
                it.integer('width'),
                it.integer('height'),
                equidistant=_is_equidistant(it),
            )
            for it in cameras
        ),
        calibrations=_stacked([_calibration(it) for it in cameras], (len(PARAMETERS),)),
        camera_covariances=tuple(
            it.matrix('covariance', (len(PARAMETERS), len(PARAMETERS))) for it in cameras
        ),
        photographs=tuple(it.text('image') for it in images),
        camera_of=np.array([numbers[it.text('camera')] for it in images], np.int64),
        rotations=_stacked([it.matrix('rotation', (3, 3)) for it in images], (3, 3)),
        positions=_stacked([it.matrix('position', (3,)) for it in images], (3,)),
        pose_covariances=_stacked([it.matrix('covariance', (6, 6)) for it in images], (6, 6)),
        rejected=tuple(_rejection(it) for it in record.rows('rejected')),
        warnings=tuple(str(it) for it in record.value('warnings', list)),
    )


def _is_equidistant(camera: _Record) -> bool:
    return camera.content.get('distortion_model') in FISHEYE


def _calibration(camera: _Record) -> list[float]:
    distortion, fisheye = camera.record('distortion'), _is_equidistant(camera)
    value = {'': 0.0} | {name: distortion.number(name) for name in DISTORTION[fisheye]}
    value |= {name: camera.number(name) for name in ('cx', 'cy')}
    value['f'] = camera.number('fy')
    if not value['f'] > 0:
        raise ValueError(f'{camera.where}: fy is {value["f"]:g}, accepted is a number above 0')
    value['affinity'] = camera.number('fx') / value['f'] - 1
    return [value[name] for name in (EQUIDISTANT if fisheye else PARAMETERS)]


def _rejection(item: _Record) -> Rejection:
    residual = item.content.get('normalised_residual')
    return Rejection(
        photograph=item.text('image'),
        target=item.text('id'),
        xy=(math.nan, math.nan),
        reason=item.text('reason'),
        normalised_residual=None if residual is None else item.number('normalised_residual'),
    )


def _stacked(rows: Sequence[Any], shape: tuple[int, ...]) -> FloatArray:
    return np.array(rows, float).reshape(len(rows), *shape)


def _covariance_of(path: Path, names: tuple[str, ...]) -> tuple[FloatArray, bool]:
    """Return the covariance of the points of these names in their order, and if it is scaled."""
    size = 3 * len(names)
    shapes = {'ids': ('U', (len(names),)), 'covariance': ('f', (size, size)), 'scaled': ('b', ())}
    found = read_arrays(path, shapes)
    place = {name: index for index, name in enumerate(found['ids'].tolist())}
    if place.keys() != set(names):
        raise ValueError(f'{path} is of other points, accepted are those of {NETWORK_FILE}')
    covariance = found['covariance'].astype(float)
    rows = np.array([3 * place[name] + axis for name in names for axis in range(3)], int)
    return covariance[np.ix_(rows, rows)], bool(found['scaled'])


@dataclass(frozen=True)
class _Record:
    """An object of network.json, whose fields are checked where they are read."""

    content: Any
    where: str

    def value(self, name: str, kind: type) -> Any:
        if not isinstance(self.content, dict) or name not in self.content:
            raise ValueError(
                f'{self.where} has no {name!r}, accepted is what ahf orient of this version writes'
            )
        value = self.content[name]
        if not isinstance(value, kind):
            raise ValueError(f'{self.where}: {name} is {shown(value)}, accepted is a {kind}')
        return value

    def text(self, name: str) -> str:
        return self.value(name, str)

    def number(self, name: str) -> float:
        value = self.value(name, object)
        return checked_number(value, f'{self.where}: {name}', -LARGEST, LARGEST)

    def integer(self, name: str) -> int:
        return checked_integer(self.value(name, object), f'{self.where}: {name}', 0, MAXIMUM_ID)

    def record(self, name: str) -> _Record:
        return _Record(self.value(name, dict), f'{self.where}: {name}')

    def rows(self, name: str) -> list[_Record]:
        return [
            _Record(it, f'{self.where}: {name} {number}')
            for number, it in enumerate(self.value(name, list), start=1)
        ]

    def matrix(self, name: str, shape: tuple[int, ...]) -> FloatArray:
        value = self.value(name, list)
        try:
            matrix = np.array(value, float)
        except (TypeError, ValueError, OverflowError):
            matrix = np.full(shape, math.nan)
        if matrix.shape != shape or not (np.abs(matrix) <= LARGEST).all():
            raise ValueError(
                f'{self.where}: {name} is {shown(value)}, accepted are finite numbers in the '
                f'shape {shape}'
            )
        return matrix


def calibration_files(solution: Solution) -> dict[str, bytes]:
    """Return the calibration of each camera for ROS and for OpenCV, by the names of files."""
    files = {}
    views = solution.network.cameras
    for index, view in enumerate(views):
        calibration = solution.state.calibrations[index]
        if not np.isfinite(calibration).all():
            continue
        stem = 'camera' if len(views) == 1 else f'camera_{index + 1}'
        for suffix, write in (('ros', ros_yaml), ('opencv', opencv_yaml)):
            covariance = solution.camera_covariances[index]
            files[f'{stem}_{suffix}.yaml'] = write(view, calibration, covariance)
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
    network, values = solution.network, solution.state
    sigmas = [f'sigma_{it}' for it in ('x', 'y', 'z', 'rx', 'ry', 'rz')]
    rows: Table = [['image', 'camera', 'x', 'y', 'z', 'qx', 'qy', 'qz', 'qw', *sigmas]]
    for index in np.flatnonzero(solution.oriented):
        numbers = [*values.positions[index], *Transform(values.rotations[index].T).quaternion]
        numbers += list(standard_deviations(solution.pose_covariances[index]))
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
                int(solution.state.used[index]),
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
