"""Registered scans as messages: residuals, targets and clouds in the common frame."""

from __future__ import annotations

import numpy as np
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from ahf_ros.interchange.point_clouds import AXES, COVARIANCE
from ahf_ros.interchange.registration_files import in_common_frame
from ahf_ros.nodes.cloud_msg import cloud_message
from ahf_ros.orientation.transform import Transform
from ahf_ros.registration.field import Field, RegisteredScan
from ahf_ros.target import UNDECODED

_PLACE = [(name, '<f4') for name in AXES] + [('id', '<i4')]
_RESIDUAL = np.dtype([*_PLACE, *((name, '<f4') for name in ('dx', 'dy', 'dz', 'length'))])
_TARGET = np.dtype([*_PLACE, *((name, '<f4') for name in COVARIANCE)])


def residual_points(field: Field, scan: RegisteredScan, header: Header) -> PointCloud2:
    """Return one point for each target that the transform of a scan rests on.

    It has the place of the target in the field, its ID, and its residual: field minus scan.
    """
    points = _places(field, scan.common, _RESIDUAL)
    for axis, name in enumerate(('dx', 'dy', 'dz')):
        points[name] = scan.residuals[:, axis]
    points['length'] = np.linalg.norm(scan.residuals, axis=1)
    return cloud_message(points[None], header)


def field_points(field: Field, header: Header) -> PointCloud2:
    """Return one point for each target of a field, with its covariance."""
    points = _places(field, field.names, _TARGET)
    rows, columns = np.triu_indices(3)
    for name, values in zip(COVARIANCE, field.covariances[:, rows, columns].T, strict=True):
        points[name] = values
    return cloud_message(points[None], header)


def _places(field: Field, names: tuple[str, ...], kind: np.dtype) -> np.ndarray:
    """Return an array with place and ID of targets; an ID that is no number is `UNDECODED`."""
    points = np.zeros(len(names), kind)
    for axis, name in enumerate(AXES):
        points[name] = field.points[field.rows(names), axis]
    points['id'] = [int(it) if it.isdecimal() and len(it) < 10 else UNDECODED for it in names]
    return points


def moved_cloud(cloud: np.ndarray, transform: Transform, header: Header) -> PointCloud2:
    """Return an organised cloud in the frame of the header; missing points are NaN."""
    return cloud_message(in_common_frame(cloud, transform), header)
