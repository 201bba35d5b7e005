"""Arrays with fields as point clouds."""

from __future__ import annotations

import array
from collections.abc import Mapping
from typing import Any

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from ahf_ros.interchange.point_clouds import NUMBERS

_DATATYPES = {kind: number for number, kind in NUMBERS.items()}


def cloud_message(points: np.ndarray, header: Header) -> PointCloud2:
    """Return points (height, width) with fields as a message."""
    height, width = points.shape
    kinds: Mapping[str, Any] = points.dtype.fields or {}
    return PointCloud2(
        header=header,
        height=height,
        width=width,
        fields=[
            PointField(name=name, offset=entry[1], datatype=_DATATYPES[entry[0].str[1:]], count=1)
            for name, entry in kinds.items()
        ],
        is_bigendian=any(entry[0].str[0] == '>' for entry in kinds.values()),
        point_step=points.dtype.itemsize,
        row_step=width * points.dtype.itemsize,
        data=array.array('B', points.tobytes()),
        is_dense=bool(np.isfinite(points['z']).all()),
    )
