"""Poses of a camera and of its targets as messages of other packages."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import NamedTuple

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
from std_msgs.msg import Header

from ahf_ros.orientation.transform import Transform


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
