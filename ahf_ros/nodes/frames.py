"""Frames of scans on /tf_static, where the package tf2_msgs is there."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from ahf_ros.text import printable

MISSING = (
    'tf is True and the package tf2_msgs is not there: no tf; ros-DISTRIBUTION-tf2-msgs '
    'installs it'
)
"""What is said where transforms cannot be published on tf."""

_FRAMES = 10_000  # of others that are remembered


class Parents:
    """The parents that others give to frames."""

    def __init__(self) -> None:
        self._parents: dict[str, str] = {}

    def see(self, transforms: Iterable[TransformStamped]) -> None:
        """Remember the transforms of a message."""
        for it in transforms:
            if len(self._parents) < _FRAMES:
                self._parents[it.child_frame_id.lstrip('/')] = it.header.frame_id.lstrip('/')

    def refusal(self, child: str, parent: str) -> str:
        """Return why a frame cannot have a parent; empty if it can."""
        other = self._parents.get(child, parent)
        if other == parent:
            return ''
        return (
            f'frame {child} has the parent {printable(other)} by tf, accepted is only '
            f'{parent}: its transform is not published on tf; set scan_frame'
        )


class StaticFrames:
    """Publishes transforms that replace those before, each to a frame without another parent."""

    def __init__(self, node: Node, group: CallbackGroup) -> None:
        types = import_module('tf2_msgs.msg')
        self._type = types.TFMessage
        self._parents = Parents()
        self.problem = ''
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._publisher = node.create_publisher(self._type, '/tf_static', kept)
        every = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for topic, profile in (('/tf', QoSProfile(depth=100)), ('/tf_static', every)):
            node.create_subscription(self._type, topic, self._see, profile, callback_group=group)

    def _see(self, message: Any) -> None:
        self._parents.see(message.transforms)

    @staticmethod
    def available() -> bool:
        """Return whether the type of the messages is installed."""
        return find_spec('tf2_msgs') is not None

    def publish(self, transforms: Iterable[TransformStamped]) -> None:
        """Publish all transforms, but those to frames that have another parent."""
        good, self.problem = [], ''
        for it in transforms:
            if text := self._parents.refusal(it.child_frame_id, it.header.frame_id):
                self.problem = text
            else:
                good.append(it)
        self._publisher.publish(self._type(transforms=good))
