"""Poses of a robot as a table, and the mounting of cameras as files that ROS reads."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.base.opening import reader
from ahf_ros.files.files import text_of
from ahf_ros.files.tables import Row, one_of, read_by_image, read_table
from ahf_ros.network.camera import rotation_matrices
from ahf_ros.network.network import FloatArray
from ahf_ros.network.transform import Transform, rotation_vector

MOUNTING_FILE = 'mounting.json'
LAUNCH_FILE = 'static_transforms.launch.yaml'

_QUATERNION = ('qx', 'qy', 'qz', 'qw')
_VECTOR = ('rx', 'ry', 'rz')
_UNIT = 1e-3  # deviation from 1 of the length of a rounded quaternion
_LARGEST_VECTOR = 2 * np.pi


@reader('a table of poses in CSV')
def read_robot_poses(path: str | Path) -> dict[str, Transform]:
    """Return the pose of the hand in the frame of the base at each image.

    The table has image, x, y, z and a quaternion qx, qy, qz, qw or a rotation vector rx, ry, rz in
    rad. Lengths are in the unit of the table.
    """
    columns, rows = read_table(path, ('image', 'x', 'y', 'z'))
    if one_of(path, columns, [_QUATERNION, _VECTOR]) < 0:
        raise ValueError(
            f'{path} has no rotations, accepted are qx, qy, qz, qw, or rx, ry, rz in rad'
        )
    turn = _by_quaternion if 'qx' in columns else _by_vector
    poses: dict[str, Transform] = {}
    for row in rows:
        name = row.text('image')
        if name in poses:
            raise ValueError(f'{row.where}: {name} is there twice, accepted is one row an image')
        rotation = rotation_matrices(turn(row)[None])[0]
        poses[name] = Transform(rotation, np.array([row.number(axis) for axis in 'xyz']))
    return poses


def _by_quaternion(row: Row) -> FloatArray:
    values = np.array([row.number(name) for name in _QUATERNION])
    length = float(np.linalg.norm(values))
    if abs(length - 1) > _UNIT:
        raise ValueError(f'{row.where}: the quaternion has the length {length:.6g}, accepted is 1')
    return rotation_vector(values / length)


def _by_vector(row: Row) -> FloatArray:
    vector = np.array([row.number(name) for name in _VECTOR])
    if np.linalg.norm(vector) > _LARGEST_VECTOR:
        raise ValueError(
            f'{row.where}: the rotation vector has the length {np.linalg.norm(vector):.4g}, '
            'accepted is one in rad, up to 2 pi'
        )
    return vector


def read_stations(path: str | Path) -> dict[str, str]:
    """Return the station of each image: those of one station were taken at the same time."""
    return read_by_image(path, 'station')


def frame_name(text: str) -> str:
    """Return a text as the name of a frame: letters, digits and underscores, a letter first."""
    name = re.sub(r'\W+', '_', text, flags=re.ASCII).strip('_')
    return name if name[:1].isalpha() else f'camera_{name}'.strip('_')


def transform_record(parent: str, child: str, pose: Transform) -> dict[str, Any]:
    """Return a static transform as an entry of mounting.json, in metres."""
    return {
        'parent': parent,
        'child': child,
        'translation': pose.translation.tolist(),
        'rotation': pose.quaternion.tolist(),
        'covariance': pose.covariance.tolist(),
    }


def mounting_files(record: dict[str, Any]) -> dict[str, bytes]:
    """Return mounting.json and a launch file of its transforms, by the names of the files."""
    lines = ['launch:']
    for transform in record['transforms']:
        numbers = [*transform['translation'], *transform['rotation']]
        names = ('x', 'y', 'z', 'qx', 'qy', 'qz', 'qw')
        values = [f'--{name} {value:.12g}' for name, value in zip(names, numbers, strict=True)]
        parent, child = transform['parent'], transform['child']
        lines += [
            '- node:',
            '    pkg: tf2_ros',
            '    exec: static_transform_publisher',
            f'    name: {parent}_to_{child}',
            f'    args: "{" ".join(values)} --frame-id {parent} --child-frame-id {child}"',
        ]
    return {
        MOUNTING_FILE: json.dumps(record, indent=1, allow_nan=False).encode() + b'\n',
        LAUNCH_FILE: text_of(lines),
    }
