"""Positions of targets as messages: a point cloud with IDs, and text markers for RViz."""

from __future__ import annotations

import array
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point, Pose, Vector3
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from ahf_ros.localisation import Positions
from ahf_ros.msg import CodedTarget
from ahf_ros.nodes.annotation_msg import target_colour
from ahf_ros.target import UNDECODED

POINT_FIELDS = {
    'x': PointField.FLOAT32,
    'y': PointField.FLOAT32,
    'z': PointField.FLOAT32,
    'id': PointField.INT32,
    'confidence': PointField.FLOAT32,
    'deviation': PointField.FLOAT32,
}
"""Fields of a point of the cloud; the last one is the deviation of `Positions`."""

_KINDS = {PointField.FLOAT32: '<f4', PointField.INT32: '<i4'}
_POINT_TYPE = np.dtype([(name, _KINDS[datatype]) for name, datatype in POINT_FIELDS.items()])
_LABEL_HEIGHT = 3.0  # of the letters, in radii of the dot


def target_points(targets: Sequence[CodedTarget], found: Positions, header: Header) -> PointCloud2:
    """Return a cloud with one point per target, in their order; NaN if it has no position.

    Parameters
    ----------
    targets : sequence of CodedTarget
        Targets of one image.
    found : Positions
        Their positions.
    header : std_msgs.msg.Header
        Header with the coordinate frame of the positions.
    """
    points = np.empty(len(targets), _POINT_TYPE)
    for axis, name in enumerate('xyz'):
        points[name] = found.points[:, axis]
    points['id'] = [target.id for target in targets]
    points['confidence'] = [target.confidence for target in targets]
    points['deviation'] = found.deviations
    fields = [
        PointField(name=name, offset=4 * number, datatype=datatype, count=1)
        for number, (name, datatype) in enumerate(POINT_FIELDS.items())
    ]
    return PointCloud2(
        header=header,
        height=1,
        width=len(points),
        fields=fields,
        point_step=_POINT_TYPE.itemsize,
        row_step=points.nbytes,
        data=array.array('B', points.tobytes()),
        is_dense=bool(found.known.all()),
    )


def target_labels(targets: Sequence[CodedTarget], found: Positions, header: Header) -> MarkerArray:
    """Return the IDs of targets as text at their positions, which replaces all earlier text.

    Parameters
    ----------
    targets, found, header
        As for `target_points`.
    """
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    for number in np.flatnonzero(found.known).tolist():
        target = targets[number]
        x, y, z = found.points[number].tolist()
        height = _LABEL_HEIGHT * target.semi_major * float(found.spacings[number])
        markers.append(
            Marker(
                header=header,
                ns='id',
                id=number,
                type=Marker.TEXT_VIEW_FACING,
                action=Marker.ADD,
                pose=Pose(position=Point(x=x, y=y, z=z)),
                scale=Vector3(z=height),
                color=ColorRGBA(**target_colour(target)),
                text='?' if target.id == UNDECODED else str(target.id),
            )
        )
    return MarkerArray(markers=markers)
