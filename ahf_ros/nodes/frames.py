"""Frames of scans on /tf_static, where the package tf2_msgs is there."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.callback_groups import CallbackGroup
from rclpy.qos import DurabilityPolicy, QoSProfile

from ahf_ros.nodes.process import ProcessNode
from ahf_ros.nodes.tf_parents import Parents

MISSING = (
    'tf is True and the package tf2_msgs is not there: no tf; ros-DISTRIBUTION-tf2-msgs '
    'installs it'
)
"""What is said where transforms cannot be published on tf."""


class StaticFrames:
    """Publishes transforms that replace those before, each to a frame without another parent."""

    def __init__(self, node: ProcessNode, group: CallbackGroup) -> None:
        kinds: Any = import_module('tf2_msgs.msg')
        self._type = kinds.TFMessage
        self._parents = Parents()
        self.problem = ''  # why the last transforms were not published; empty if they were
        # Late listeners get the last message, which has all transforms.
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._publisher = node.create_publisher(self._type, '/tf_static', kept)
        for topic in ('/tf', '/tf_static'):
            node.subscribe(self._type, topic, self._see, group, lossless=True)

    @staticmethod
    def available() -> bool:
        """Return whether the type of the messages is installed."""
        return find_spec('tf2_msgs') is not None

    def publish(self, transforms: Iterable[TransformStamped]) -> None:
        """Publish all transforms, but those to frames that have another parent."""
        good, self.problem = [], ''
        for it in transforms:
            if text := self._parents.refusal(it.header.frame_id, it.child_frame_id):
                self.problem = f'no tf: {text}; set scan_frame'
            else:
                good.append(it)
        self._publisher.publish(self._type(transforms=good))

    def _see(self, message: Any) -> None:
        for it in message.transforms:
            self._parents.add(it.header.frame_id, it.child_frame_id)
