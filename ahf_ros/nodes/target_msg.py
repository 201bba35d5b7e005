"""Identified targets as messages of other packages: detections, outlines, points and labels.

The message of ROS 2 for outlines that a viewer draws over an image is
visualization_msgs/ImageMarker. A viewer shows one marker per topic, so that all outlines are lines
of one marker. Markers have no text: IDs are drawn into the debug image.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from types import ModuleType

import numpy as np
from geometry_msgs.msg import Point, Pose, Vector3
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import ImageMarker, Marker, MarkerArray

from ahf_ros.drawing.overlay import DECODED_COLOUR, DOUBTFUL_COLOUR, Colour
from ahf_ros.localisation import Positions, labelled
from ahf_ros.msg import CodedTarget, CodedTargetArray
from ahf_ros.nodes.cloud_msg import cloud_message
from ahf_ros.target import UNDECODED


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
