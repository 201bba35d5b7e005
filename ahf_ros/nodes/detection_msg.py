"""Identified targets as vision_msgs/Detection2DArray, the general message for detections."""

from __future__ import annotations

from types import ModuleType

from ahf_ros.msg import CodedTarget, CodedTargetArray
from ahf_ros.target import UNDECODED


def target_detections(answer: CodedTargetArray, types: ModuleType) -> object:
    """Return the targets of an answer as detections, in their order.

    The box of a detection is that around the ellipse of the central dot, turned with it. The
    class of an object is the family of its code, and its ID is the ID of the target. A target that
    was not decoded has no hypothesis and an empty ID.

    Parameters
    ----------
    answer : CodedTargetArray
        Targets of one image.
    types : module
        The module `vision_msgs.msg`, version 4 or newer.

    Returns
    -------
    vision_msgs.msg.Detection2DArray
        With the header of the answer.
    """
    return types.Detection2DArray(
        header=answer.header,
        detections=[_detection(target, answer, types) for target in answer.targets],
    )


def _detection(target: CodedTarget, answer: CodedTargetArray, types: ModuleType) -> object:
    position = types.Point2D(x=target.x, y=target.y)
    detection = types.Detection2D(
        header=answer.header,
        bbox=types.BoundingBox2D(
            center=types.Pose2D(position=position, theta=target.angle),
            size_x=2 * target.semi_major,
            size_y=2 * target.semi_minor,
        ),
    )
    if target.id != UNDECODED:
        detection.id = str(target.id)
        hypothesis = types.ObjectHypothesis(class_id=target.family, score=target.confidence)
        detection.results = [types.ObjectHypothesisWithPose(hypothesis=hypothesis)]
    return detection
