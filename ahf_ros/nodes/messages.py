"""Images, clouds, targets, poses and registered scans as messages of other packages.

The message of ROS 2 for outlines that a viewer draws over an image is
visualization_msgs/ImageMarker. A viewer shows one marker per topic, so that all outlines are lines
of one marker. Markers have no text: IDs are drawn into the debug image.
"""

import array
import math
import sys
from collections.abc import Mapping, Sequence
from itertools import pairwise
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    TransformStamped,
    Vector3,
)
from geometry_msgs.msg import Transform as TransformMessage
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import ImageMarker, Marker, MarkerArray

from ahf_ros.base.target import UNDECODED
from ahf_ros.clouds.localisation import Positions, labelled
from ahf_ros.clouds.point_clouds import COVARIANCE, NUMBERS
from ahf_ros.clouds.registration.field import Field, RegisteredScan
from ahf_ros.files.cloud_files import AXES
from ahf_ros.files.target_messages import has_corners
from ahf_ros.msg import CodedTarget, CodedTargetArray
from ahf_ros.network.transform import Transform
from ahf_ros.prints.square import library_name
from ahf_ros.views.drawing.overlay import DECODED_COLOUR, DOUBTFUL_COLOUR, Colour

_DATATYPES = {kind: number for number, kind in NUMBERS.items()}
_PLACE = [(name, '<f4') for name in AXES] + [('id', '<i4')]
_RESIDUAL = np.dtype([*_PLACE, *((name, '<f4') for name in ('dx', 'dy', 'dz', 'length'))])
_TARGET = np.dtype([*_PLACE, *((name, '<f4') for name in COVARIANCE)])


def target_detections(answer: CodedTargetArray, types: ModuleType) -> object:
    """Return the targets of an answer as detections, in their order.

    They are a `vision_msgs.msg.Detection2DArray` with the header of the answer; `types` is the
    module `vision_msgs.msg`, version 4 or newer. The box of a detection is that around the ellipse
    of the central dot, turned with it. The class of an object is the family of its code, and its
    ID is the ID of the target. A target that was not decoded has no hypothesis and an empty ID.
    """
    detections = []
    for target in answer.targets:
        position = types.Point2D(x=target.x, y=target.y)
        box = types.BoundingBox2D(
            center=types.Pose2D(position=position, theta=target.angle),
            size_x=2 * target.semi_major,
            size_y=2 * target.semi_minor,
        )
        detection = types.Detection2D(header=answer.header, bbox=box)
        if target.id != UNDECODED:
            detection.id = str(target.id)
            hypothesis = types.ObjectHypothesis(class_id=target.family, score=target.confidence)
            detection.results = [types.ObjectHypothesisWithPose(hypothesis=hypothesis)]
        detections.append(detection)
    return types.Detection2DArray(header=answer.header, detections=detections)


def apriltag_detections(answer: CodedTargetArray, types: ModuleType) -> object:
    """Return the square markers of an answer as apriltag_ros publishes them, in their order.

    They are an `apriltag_msgs.msg.AprilTagDetectionArray` with the header of the answer; `types`
    is the module `apriltag_msgs.msg`, version 2 or newer. A tag has the name that its own library
    gives the family. Coordinates are those of the answer: the AprilTag library, for which (0, 0)
    is a corner of the first pixel, has half a pixel more. Cells that nobody looked at count as
    right, with a margin of 0.
    """
    detections = []
    for target in answer.targets:
        if target.id == UNDECODED or not has_corners(target):
            continue
        known = math.isfinite(target.hamming)
        detections.append(
            types.AprilTagDetection(
                family=library_name(target.family),
                id=target.id,
                hamming=round(target.hamming) if known else 0,
                goodness=0.0,
                decision_margin=target.decision_margin if known else 0.0,
                centre=types.Point(x=target.x, y=target.y),
                corners=[types.Point(x=x, y=y) for x, y in target.corners.reshape(4, 2).tolist()],
                homography=target.homography,
            )
        )
    return types.AprilTagDetectionArray(header=answer.header, detections=detections)


def target_annotations(answer: CodedTargetArray) -> ImageMarker:
    """Return the outlines of dots as lines of one marker, whose width is by the size of the image.

    In viewers, (0, 0) is the corner of the first pixel, half a pixel from its centre.
    """
    turn = np.linspace(0, 2 * math.pi, 25)
    marker = ImageMarker(
        header=answer.header,
        ns='targets',
        type=ImageMarker.LINE_LIST,
        action=ImageMarker.ADD,
        scale=max(1.0, math.hypot(answer.height, answer.width) / 2400),
        outline_color=_rgba(DECODED_COLOUR),
    )
    points, colours = [], []
    for target in answer.targets:
        along, across = target.semi_major * np.cos(turn), target.semi_minor * np.sin(turn)
        cosine, sine = math.cos(target.angle), math.sin(target.angle)
        x = target.x + along * cosine - across * sine + 0.5
        y = target.y + along * sine + across * cosine + 0.5
        corners = [Point(x=x, y=y) for x, y in zip(x.tolist(), y.tolist(), strict=True)]
        points += [end for side in pairwise(corners) for end in side]
        colours += [_colour(target)] * (len(corners) - 1)
    marker.points = points
    marker.outline_colors = colours
    return marker


def _colour(target: CodedTarget) -> ColorRGBA:
    return _rgba(DOUBTFUL_COLOUR if target.id == UNDECODED else DECODED_COLOUR)


def _rgba(colour: Colour) -> ColorRGBA:
    blue, green, red = colour
    return ColorRGBA(r=red / 255, g=green / 255, b=blue / 255, a=1.0)


def target_points(targets: Sequence[CodedTarget], found: Positions, header: Header) -> PointCloud2:
    """Return a cloud with one point per target, in their order; NaN if it has no position.

    The header names the coordinate frame of the positions.
    """
    return cloud_message(labelled(targets, found)[None], header)


def target_labels(targets: Sequence[CodedTarget], found: Positions, header: Header) -> MarkerArray:
    """Return the IDs of targets as text at their positions, which replaces all earlier text."""
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    for number in np.flatnonzero(found.known).tolist():
        target = targets[number]
        x, y, z = found.points[number].tolist()
        height = 3 * target.semi_major * float(found.spacings[number])  # three radii of the dot
        markers.append(
            Marker(
                header=header,
                ns='id',
                id=number,
                type=Marker.TEXT_VIEW_FACING,
                action=Marker.ADD,
                pose=Pose(position=Point(x=x, y=y, z=z)),
                scale=Vector3(z=height),
                color=_colour(target),
                text='?' if target.id == UNDECODED else str(target.id),
            )
        )
    return MarkerArray(markers=markers)


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


def image_message(image: np.ndarray, header: Header) -> Image:
    """Return the message of an image, uint8 or, where it is gray, uint16.

    Gray, shape (height, width), is sent as mono8 or mono16; blue, green, red, (height, width, 3),
    as bgr8.
    """
    height, width = image.shape[:2]
    gray = 'mono8' if image.dtype == np.uint8 else 'mono16'
    encoding, channels = (gray, 1) if image.ndim == 2 else ('bgr8', 3)
    # An ndarray assigned to `data` is checked value by value; an array of bytes is taken as it is.
    data = array.array('B', bytes(image.nbytes))
    np.frombuffer(data, image.dtype).reshape(image.shape)[:] = image
    return Image(
        header=header,
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=sys.byteorder == 'big',
        step=width * channels * image.itemsize,
        data=data,
    )


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


class PosedTarget(NamedTuple):
    """A target that is used, with its transform to the frame of the camera."""

    family: str
    id: int
    confidence: float
    transform: Transform

    @property
    def frame(self) -> str:
        """Name of its frame, as apriltag_ros has it."""
        return f'{self.family}:{self.id}'


def target_transform(camera: Transform, xyz: np.ndarray, covariance: np.ndarray) -> Transform:
    """Return the transform from a target, with the axes of the field, to the camera's frame.

    `camera` leads from the frame of the camera to that of the field. The covariance holds the
    errors of the pose and those of the coordinates (3, 3), as if they were independent.
    """
    whole = np.zeros((6, 6))
    whole[:3, :3] = covariance
    return camera.inverse @ Transform(translation=xyz, covariance=whole)


def pose_with_covariance(of: Transform) -> PoseWithCovariance:
    """Return a transform as the pose of one frame in another one."""
    return PoseWithCovariance(
        pose=Pose(position=Point(**_named(of)), orientation=_quaternion(of)),
        covariance=of.covariance.ravel(),
    )


def pose_message(of: Transform, header: Header) -> PoseWithCovarianceStamped:
    """Return a transform as the pose of one frame in that of the header."""
    return PoseWithCovarianceStamped(header=header, pose=pose_with_covariance(of))


def transform_message(of: Transform, header: Header, child: str) -> TransformStamped:
    """Return a transform for tf, from the child frame to that of the header."""
    moved = TransformMessage(translation=Vector3(**_named(of)), rotation=_quaternion(of))
    return TransformStamped(header=header, child_frame_id=child, transform=moved)


def detections_message(
    targets: Sequence[PosedTarget], header: Header, types: ModuleType
) -> object:
    """Return targets with their poses in the frame of the header, that of the camera.

    It is a `vision_msgs.msg.Detection3DArray`; `types` is the module `vision_msgs.msg`, version 4
    or newer. The class is the family of the code. The boxes have no size.
    """
    detections = []
    for target in targets:
        posed = pose_with_covariance(target.transform)
        hypothesis = types.ObjectHypothesis(class_id=target.family, score=target.confidence)
        result = types.ObjectHypothesisWithPose(hypothesis=hypothesis, pose=posed)
        box = types.BoundingBox3D(center=posed.pose, size=Vector3())
        detections.append(
            types.Detection3D(header=header, results=[result], bbox=box, id=str(target.id))
        )
    return types.Detection3DArray(header=header, detections=detections)


def _named(of: Transform) -> dict[str, float]:
    return dict(zip('xyz', of.translation.tolist(), strict=True))


def _quaternion(of: Transform) -> Quaternion:
    x, y, z, w = of.quaternion.tolist()
    return Quaternion(x=x, y=y, z=z, w=w)
