"""Organised point clouds of messages as arrays, from ROS or from a bag, without a copy.

`sensor_msgs_py.point_cloud2` is never used: it ignores padded rows (`row_step`), swaps the bytes
of the whole cloud if the byte order differs, and does not say what is wrong with a bad cloud.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ahf_ros.interchange.image_messages import check_rows

AXES = ('x', 'y', 'z')
"""Fields that a cloud must have."""

COVARIANCE = ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')
"""Fields of target points with the covariance of x, y and z."""

FLOAT32, FLOAT64 = 7, 8
"""Accepted types of these fields, as numbered in sensor_msgs/PointField."""

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
