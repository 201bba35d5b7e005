"""Organised point clouds of messages as arrays, from ROS or from a bag, without a copy.

`sensor_msgs_py.point_cloud2` is never used: it ignores padded rows (`row_step`), swaps the bytes
of the whole cloud if the byte order differs, and does not say what is wrong with a bad cloud.
"""

from typing import Any

import numpy as np

from ahf_ros.base.target import UNDECODED
from ahf_ros.base.text import shown
from ahf_ros.clouds.registration.scan import Scan
from ahf_ros.files.cloud_files import AXES
from ahf_ros.files.image_messages import check_rows

COVARIANCE = ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')
"""Fields of target points with the covariance of x, y and z."""

TARGET_POINT = np.dtype(
    [
        *((name, '<f4') for name in AXES),
        ('id', '<i4'),
        *((name, '<f4') for name in ('confidence', 'deviation', *COVARIANCE)),
    ]
)
"""A point of ~/target_points; the deviation is that of `ahf_ros.clouds.localisation.Positions`."""

FLOAT32, FLOAT64 = 7, 8
"""Accepted types of these fields, as numbered in sensor_msgs/PointField."""

NUMBERS = dict(enumerate(('i1', 'u1', 'i2', 'u2', 'i4', 'u4', 'f4', 'f8'), start=1))
"""Types of numbers, as numbered in sensor_msgs/PointField."""

_KINDS = {FLOAT32: 'f4', FLOAT64: 'f8'}


def organised_points(message: Any) -> np.ndarray:
    """Return the points of an organised sensor_msgs/PointCloud2, one per pixel of an image.

    It has fields x, y and z of float32 or float64 at any offsets, in either byte order; it may
    have other fields and padded points or rows (`point_step`, `row_step`). The result, of shape
    (height, width) and with the fields x, y and z, is a view of the data in its byte order.

    A ValueError names the field if the cloud is not organised, a field is missing or of another
    type, or the sizes are inconsistent.
    """
    for name, size in (('height', message.height), ('width', message.width)):
        if size < 2:
            raise ValueError(
                f'{name} is {size}, accepted is an integer of at least 2: an organised cloud'
            )
    row = message.width * message.point_step
    points = f'a row of {message.width} points of {message.point_step} bytes'
    check_rows(message, 'row_step', row, points)
    return np.ndarray(
        (message.height, message.width),
        _point_type(message),
        message.data,
        strides=(message.row_step, message.point_step),
    )


def whole_points(message: Any) -> np.ndarray:
    """Return the points of a sensor_msgs/PointCloud2 with all their fields, (height, width).

    The fields have single numbers of any type. The result is a view of the data. A ValueError
    names a field that is not accepted, or a size that is not consistent.
    """
    order = '>' if message.is_bigendian else '<'
    kinds = []
    for field in message.fields:
        kind = NUMBERS.get(field.datatype)
        if kind is None or field.count > 1:
            raise ValueError(
                f'field {shown(field.name)} has the datatype {field.datatype} and the count '
                f'{field.count}, accepted are 1 to 8 and 1'
            )
        if field.offset + int(kind[1:]) > message.point_step:
            raise ValueError(
                f'offset of {shown(field.name)} is {field.offset}, accepted is an integer of at '
                f'most point_step, {message.point_step}, minus {kind[1:]} bytes'
            )
        kinds.append(order + kind)
    names = [field.name for field in message.fields]
    if len(set(names)) < len(names):
        raise ValueError(f'fields are {shown(names)}, accepted is each name once')
    check_rows(message, 'row_step', message.width * message.point_step, 'a row of points')
    point = np.dtype(
        {
            'names': names,
            'formats': kinds,
            'offsets': [field.offset for field in message.fields],
            'itemsize': message.point_step,
        }
    )
    shape = message.height, message.width
    if not message.height * message.width:
        return np.zeros(shape, point)
    return np.ndarray(shape, point, message.data, strides=(message.row_step, message.point_step))


def target_scan(points: np.ndarray, minimum_confidence: float = 0.0) -> Scan:
    """Return the targets of an array with the fields of ~/target_points.

    Targets without an ID or a position, or of less confidence, are left out. A ValueError names
    fields that are missing, or a covariance that is none.
    """
    points = points.ravel()
    needed = (*AXES, 'id', *COVARIANCE)
    names = points.dtype.names or ()
    if missing := [name for name in needed if name not in names]:
        raise ValueError(
            f'target points have no {", ".join(missing)}, accepted are those with '
            f'{", ".join(needed)}'
        )
    xyz = np.stack([points[name].astype(float) for name in AXES], axis=-1)
    used = np.isfinite(xyz).all(axis=1) & (points['id'] != UNDECODED)
    if 'confidence' in names:
        used &= points['confidence'] >= minimum_confidence
    own = np.zeros((len(points), 3, 3))
    rows, columns = np.triu_indices(3)
    for row, column, name in zip(rows, columns, COVARIANCE, strict=True):
        own[:, row, column] = own[:, column, row] = points[name]
    return Scan(tuple(str(it) for it in points['id'][used]), xyz[used], own[used])


def _point_type(message: Any) -> np.dtype:
    """Return the type of a point, with fields for its coordinates only."""
    given = {field.name: field for field in message.fields}
    order = '>' if message.is_bigendian else '<'
    formats = []
    for name in AXES:
        if name not in given:
            names = ', '.join(map(repr, given)) or 'none'
            raise ValueError(f'fields are {names}, accepted are those with x, y and z')
        field = given[name]
        if field.datatype not in _KINDS:
            raise ValueError(
                f'datatype of {name} is {field.datatype}, '
                f'accepted is {FLOAT32} (FLOAT32) or {FLOAT64} (FLOAT64)'
            )
        kind = np.dtype(order + _KINDS[field.datatype])
        if field.offset + kind.itemsize > message.point_step:
            raise ValueError(
                f'offset of {name} is {field.offset}, accepted is an integer of at most '
                f'point_step, {message.point_step}, minus {kind.itemsize} bytes'
            )
        formats.append(kind)
    offsets = [given[name].offset for name in AXES]
    return np.dtype(
        {'names': AXES, 'formats': formats, 'offsets': offsets, 'itemsize': message.point_step}
    )
