"""Frames on /tf or /tf_static: each has one parent, and no frame is its own ancestor (REP 105)."""

from collections.abc import Iterable
from importlib import import_module
from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.qos import DurabilityPolicy, QoSProfile

from ahf_ros.nodes.process import LOG_PERIOD, ProcessNode

PACKAGE = 'tf2_msgs'
"""Package of the messages, which may not be there."""

TF_KEPT = 100
"""Depth of /tf, as tf2_ros has it."""


class Parents:
    """The parents of frames, as tf has them; a contradiction to what a node publishes stays."""

    def __init__(self) -> None:
        self._parents: dict[str, set[str]] = {}

    def add(self, parent: str, child: str) -> None:
        """Remember a transform that somebody publishes."""
        self._parents.setdefault(child.lstrip('/'), set()).add(parent.lstrip('/'))

    def refusal(self, parent: str, child: str) -> str:
        """Return why a transform may not be published; empty if it may."""
        if not (parent and child):
            return 'the images have no frame_id, accepted is the frame of the camera'
        if parent == child:
            return f'{child!r} is the frame of both camera and targets, accepted are two names'
        if others := sorted(self._parents.get(child, set()) - {parent}):
            return f'{child!r} has the parent {others[0]!r} already, accepted is one parent'
        if child in self._ancestors(parent):
            return f'{child!r} is an ancestor of {parent!r} already, accepted is no loop'
        return ''

    def _ancestors(self, frame: str) -> set[str]:
        found: set[str] = set()
        waiting = [frame]
        while waiting:
            new = self._parents.get(waiting.pop(), set()) - found
            found |= new
            waiting += new
        return found


class Frames:
    """Publishes transforms, but for those whose frames would get two parents or a loop.

    Static ones replace those before, so that late listeners get all of them.
    """

    def __init__(self, node: ProcessNode, static: bool = False, remedy: str = '') -> None:
        self.problem = ''  # why some of the last transforms were not published
        self._node, self._static = node, static
        self._remedy = f'; {remedy}' if remedy else ''
        self._parents = Parents()
        self._type: Any = import_module(f'{PACKAGE}.msg').TFMessage
        if static:
            kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self._publisher = node.create_publisher(self._type, '/tf_static', kept)
        else:
            self._publisher = node.publisher(self._type, '/tf', TF_KEPT)
        group = MutuallyExclusiveCallbackGroup()
        for topic in ('/tf', '/tf_static'):
            node.subscribe(self._type, topic, self._see, group, lossless=True)

    def publish(self, transforms: Iterable[TransformStamped]) -> None:
        """Publish all transforms at once, and log which cannot be."""
        accepted, self.problem = [], ''
        for it in transforms:
            parent, child = it.header.frame_id, it.child_frame_id
            if text := self._parents.refusal(parent, child):
                self.problem = f'no tf: {text}{self._remedy}'
            else:
                self._parents.add(parent, child)
                accepted.append(it)
        if self.problem:
            self._node.get_logger().warning(self.problem, throttle_duration_sec=LOG_PERIOD)
        if accepted or self._static:
            self._publisher.publish(self._type(transforms=accepted))

    def _see(self, message: Any) -> None:
        for it in message.transforms:
            self._parents.add(it.header.frame_id, it.child_frame_id)
