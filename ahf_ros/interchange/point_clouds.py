"""Organised clouds of messages as arrays, from ROS or from a bag, without a copy.

`sensor_msgs_py.point_cloud2` is not used, also where it is installed: it does not know padded rows
(`row_step`), it swaps the bytes of a whole cloud of the other byte order, and it does not say what
is wrong with a cloud that it cannot read.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ahf_ros.interchange.fields import check_rows

AXES = ('x', 'y', 'z')
"""The fields that a cloud must have."""

FLOAT32, FLOAT64 = 7, 8
"""Their types, as sensor_msgs/PointField numbers them."""

_KINDS = {FLOAT32: 'f4', FLOAT64: 'f8'}


def organised_points(message: Any) -> np.ndarray:
    """Return the points of an organised cloud, which belong to the pixels of an image.

    Parameters
    ----------
    message : sensor_msgs/PointCloud2
        With fields x, y and z of float32 or float64; in either byte order, with any other fields,
        at any offsets; points and rows may be padded (`point_step`, `row_step`).

    Returns
    -------
    ndarray of shape (height, width), with the fields x, y and z
        A view of the data of the message, not a copy, in the byte order of the message.

    Raises
    ------
    ValueError
        If the cloud is not organised, a field is missing or of another type, or the sizes do not
        fit together; the message names the field, its value and what is accepted.
    """
    if message.height < 2:
        raise ValueError(
            f'height is {message.height}, accepted is an integer of at least 2: an organised cloud'
        )
    if message.width < 2:
        raise ValueError(f'width is {message.width}, accepted is an integer of at least 2')
    kind = _point_type(message)
    row = message.width * message.point_step
    points = f'a row of {message.width} points of {message.point_step} bytes'
    check_rows(message, 'row_step', row, points)
    return np.ndarray(
        (message.height, message.width),
        kind,
        message.data,
        strides=(message.row_step, message.point_step),
    )


def _point_type(message: Any) -> np.dtype:
    """Return the type of a point, of which only the coordinates are named."""
    fields = {field.name: field for field in message.fields}
    order = '>' if message.is_bigendian else '<'
    formats, offsets = [], []
    for name in AXES:
        if name not in fields:
            told = ', '.join(map(repr, fields)) or 'none'
            raise ValueError(f'fields are {told}, accepted are those with x, y and z')
        field = fields[name]
        if field.datatype not in _KINDS:
            raise ValueError(
                f'datatype of {name} is {field.datatype}, '
                f'accepted is {FLOAT32} (FLOAT32) or {FLOAT64} (FLOAT64)'
            )
        size = np.dtype(_KINDS[field.datatype]).itemsize
        if field.offset + size > message.point_step:
            raise ValueError(
                f'offset of {name} is {field.offset}, accepted is an integer of at most '
                f'point_step, {message.point_step}, less {size} bytes'
            )
        formats.append(order + _KINDS[field.datatype])
        offsets.append(field.offset)
    return np.dtype(
        {
            'names': AXES,
            'formats': formats,
            'offsets': offsets,
            'itemsize': message.point_step,
        }
    )
