"""Centres of targets without the distortion of the lens, from the calibration of the camera."""

import bisect
import threading
from copy import copy
from dataclasses import replace
from typing import NamedTuple

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

from ahf_ros import msg
from ahf_ros.base.target import Identification
from ahf_ros.files.camera_info import Calibration, calibration, undistorted_targets
from ahf_ros.files.image_messages import nanoseconds
from ahf_ros.files.target_messages import coded_target_array
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.diagnostics import Tally
from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.process import LOG_PERIOD, ProcessNode
from ahf_ros.nodes.topics import ANSWERS_KEPT, UNDISTORTED, camera_info_topic

CHANGES = 1000
"""Maximum number of different calibrations that are remembered."""


class _Change(NamedTuple):
    stamp: int
    message: CameraInfo  # without its stamp
    calibration: Calibration | str  # or why it is not accepted


class Calibrations:
    """The calibrations of a camera in the order of their stamps; thread-safe.

    Drivers send one with every image, nearly always the same. So only changes are kept, and an
    image that waited for long still finds the calibration of its time.
    """

    def __init__(self) -> None:
        self._changes: list[_Change] = []
        self._lock = threading.Lock()

    def put(self, message: CameraInfo) -> None:
        """Remember the calibration of a message, or why it is not accepted."""
        stamp = nanoseconds(message.header)
        unstamped = copy(message)
        unstamped.header = Header(frame_id=message.header.frame_id)
        with self._lock:
            place = bisect.bisect(self._changes, stamp, key=lambda change: change.stamp)
            if place and self._changes[place - 1].message == unstamped:
                return
            try:
                found: Calibration | str = calibration(message)
            except ValueError as error:
                found = str(error)
            self._changes.insert(place, _Change(stamp, unstamped, found))
            del self._changes[:-CHANGES]

    def at(self, stamp: int) -> Calibration | None:
        """Return the calibration at a time, ns: the last one before, or else the first one after.

        Raises a ValueError if it was not accepted.
        """
        with self._lock:
            if not self._changes:
                return None
            place = bisect.bisect(self._changes, stamp, key=lambda change: change.stamp)
            found = self._changes[max(0, place - 1)].calibration
        if isinstance(found, str):
            raise ValueError(found)
        return found


class UndistortedTargets:
    """Publishes answers once more, with centres as a camera without distortion would see them."""

    def __init__(self, node: ProcessNode, tally: Tally) -> None:
        self._node = node
        self._tally = tally
        self._publisher = node.publisher(CodedTargetArray, UNDISTORTED, ANSWERS_KEPT)
        self._calibrations = Calibrations()
        self._topic = camera_info_topic(node)
        self._subscription: Input | None = None

    def listen(self, wanted: bool) -> None:
        """Subscribe to calibrations, or end the subscription."""
        if wanted and not self._subscription:
            group = MutuallyExclusiveCallbackGroup()
            self._subscription = self._node.subscribe(
                CameraInfo, self._topic, self._calibrations.put, group
            )
        elif self._subscription and not wanted:
            self._node.unsubscribe(self._subscription)
            self._subscription = None
            self._tally.uncalibrated = ''

    def publish(self, answer: CodedTargetArray, identification: Identification) -> None:
        """Publish the undistorted targets of an answer, or report why that is impossible."""
        if not self._subscription:
            return
        header, size = answer.header, (answer.height, answer.width)
        try:
            camera = self._calibrations.at(nanoseconds(header))
            if camera is None:
                topic = self._node.resolve_topic_name(self._topic)
                raise ValueError(f'no camera_info has come on {topic}')
            camera.check(header.frame_id, answer.width, answer.height)
        except ValueError as error:
            self._tally.uncalibrated = f'targets are not undistorted: {error}'
            logger = self._node.get_logger()
            logger.warning(self._tally.uncalibrated, throttle_duration_sec=LOG_PERIOD)
            return
        self._tally.uncalibrated = ''
        targets = undistorted_targets(camera, identification.targets)
        moved = replace(identification, targets=targets)
        self._publisher.publish(coded_target_array(moved, answer.family, size, header, msg))
