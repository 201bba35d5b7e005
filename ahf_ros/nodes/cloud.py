"""Positions of the targets of an image in space, from the point cloud of the same shot."""

from __future__ import annotations

import threading
import time
from collections import deque
from operator import attrgetter
from typing import Any, NamedTuple

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from ahf_ros.interchange.image_messages import nanoseconds
from ahf_ros.interchange.point_clouds import organised_points
from ahf_ros.localisation import FULL, CloudGrid, positions
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.diagnostics import CloudTally
from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.process import LOG_PERIOD, ProcessNode
from ahf_ros.nodes.settings import LOSSLESS, DetectorNodeSettings
from ahf_ros.nodes.target_msg import target_labels, target_points
from ahf_ros.nodes.topics import ANSWERS_KEPT, POINTS, TARGET_LABELS, TARGET_POINTS

ANSWERS = 100
"""Maximum number of answers waiting for the cloud of their image."""

CLOUD, ANSWER = 0, 1
"""Sides of the matcher."""

_relevant = attrgetter('cloud', 'queue', 'queue_memory')


class _Message(NamedTuple):
    stamp: int
    item: Any
    size: int
    arrived: float


class Waiting(NamedTuple):
    """What waits for its match, of each of two topics."""

    counts: list[int]
    seconds: list[float]  # for how long the oldest has waited, s; 0 where there is none
    nearest: int  # smallest difference of two stamps since the last match, ns; 0 without any


class Matcher:
    """Pairs messages of two topics, whichever of them arrives first.

    The stamps of a match differ by at most `tolerance`, ns; the nearest message matches. Each
    topic keeps its order, so a match discards all messages that arrived before it on either topic.
    The messages of a topic that wait have together at most the size in `limits`; a single one may
    always wait. `unmatched` has counts of discarded messages of each topic, to continue.
    """

    def __init__(self, tolerance: int, limits: tuple[int, int], unmatched: list[int]) -> None:
        self._unmatched = unmatched
        self._tolerance = tolerance
        self._limits = limits
        self._waiting: tuple[deque[_Message], deque[_Message]] = (deque(), deque())
        self._nearest = 0
        self._lock = threading.Lock()

    def put(self, side: int, stamp: int, item: Any, size: int = 1) -> Any:
        """Return the match of a message of topic 0 or 1, or None and let the message wait.

        The stamp is in ns, the size in the unit of `limits`.
        """
        other = 1 - side
        own, others = self._waiting[side], self._waiting[other]
        with self._lock:
            apart = [abs(it.stamp - stamp) for it in others]
            nearest = min(apart, default=0)
            if apart and nearest <= self._tolerance:
                for _ in range(apart.index(nearest)):
                    self._discard(other)
                while own:
                    self._discard(side)
                self._nearest = 0
                return others.popleft().item
            if apart:
                self._nearest = min(self._nearest or nearest, nearest)
            own.append(_Message(stamp, item, size, time.monotonic()))
            while len(own) > 1 and sum(it.size for it in own) > self._limits[side]:
                self._discard(side)
        return None

    def waiting(self) -> Waiting:
        """Return what waits, and for how long."""
        now = time.monotonic()
        with self._lock:
            seconds = [now - it[0].arrived if it else 0.0 for it in self._waiting]
            return Waiting([len(it) for it in self._waiting], seconds, self._nearest)

    def _discard(self, side: int) -> None:
        self._waiting[side].popleft()
        self._unmatched[side] += 1


class TargetPoints:
    """Publishes the positions of targets as soon as an answer and its cloud are both there.

    Drivers of scanners give the image and the cloud of a shot the same stamp, and either may
    arrive first. A match discards everything that arrived before it; if too much waits, the oldest
    is discarded.
    """

    def __init__(
        self, node: ProcessNode, settings: DetectorNodeSettings, tally: CloudTally
    ) -> None:
        self._node = node
        self._settings = settings
        self._tally = tally
        tolerance = round(settings.cloud.cloud_tolerance * 1e9)
        limits = (settings.queue_memory * 2**20, ANSWERS)
        self._matcher = Matcher(tolerance, limits, tally.unmatched)
        self._publishing = threading.Lock()
        self._closed = False
        lossless = settings.queue == LOSSLESS
        group = MutuallyExclusiveCallbackGroup()
        self._clouds = node.subscribe(PointCloud2, POINTS, self._on_cloud, group, lossless)
        self._points = node.publisher(PointCloud2, TARGET_POINTS, ANSWERS_KEPT)
        self._labels = node.publisher(MarkerArray, TARGET_LABELS)

    def suits(self, settings: DetectorNodeSettings) -> bool:
        """Return whether other settings of the node would make no difference."""
        return _relevant(settings) == _relevant(self._settings)

    def close(self) -> None:
        """End the subscription and the publishers."""
        self._node.unsubscribe(self._clouds)
        with self._publishing:
            self._closed = True
        self._node.destroy_publisher(self._points)
        self._node.destroy_publisher(self._labels)

    def waiting(self) -> tuple[Input, Waiting]:
        """Return where clouds come from, and what waits for its match."""
        return self._clouds, self._matcher.waiting()

    def locate(self, answer: CodedTargetArray) -> None:
        """Publish the positions of the targets of an answer, now or when its cloud arrives."""
        cloud = self._matcher.put(ANSWER, nanoseconds(answer.header), answer)
        if cloud is not None:
            self._publish(answer, cloud)

    def _on_cloud(self, cloud: PointCloud2) -> None:
        self._tally.received += 1
        try:
            organised_points(cloud)
        except ValueError as error:
            self._refuse(str(error))
            return
        answer = self._matcher.put(CLOUD, nanoseconds(cloud.header), cloud, len(cloud.data))
        if answer is not None:
            self._publish(answer, cloud)

    def _publish(self, answer: CodedTargetArray, cloud: PointCloud2) -> None:
        grid, radius = self._settings.cloud.grid, self._settings.cloud.cloud_radius
        if not grid.fits((cloud.height, cloud.width), (answer.height, answer.width)):
            self._refuse(unfit(cloud, answer, grid))
            return
        found = positions(organised_points(cloud), answer.targets, radius, grid)
        header = Header(stamp=answer.header.stamp, frame_id=cloud.header.frame_id)
        with self._publishing:
            if self._closed:
                return
            self._points.publish(target_points(answer.targets, found, header))
            if self._labels.get_subscription_count():
                self._labels.publish(target_labels(answer.targets, found, header))
        self._tally.used += 1
        self._tally.positions = f'{found.known.sum()} of {len(answer.targets)}'

    def _refuse(self, reason: str) -> None:
        self._tally.rejected += 1
        self._tally.reason = reason
        logger = self._node.get_logger()
        logger.warning(f'cloud refused: {reason}', throttle_duration_sec=LOG_PERIOD)


def unfit(cloud: PointCloud2, answer: CodedTargetArray, grid: CloudGrid) -> str:
    """Return why a cloud does not fit its image, and what to set."""
    size, image = f'{cloud.width} x {cloud.height}', f'{answer.width} x {answer.height}'
    if grid == FULL:
        return (
            f'cloud has {size} points, accepted is {image}, the size of the image; for another '
            'one, set cloud_offset_x, cloud_offset_y and cloud_step'
        )
    return (
        f'cloud has {size} points, accepted are those that an image of {image} has room for from '
        f'x = {grid.offset_x:g}, y = {grid.offset_y:g} in steps of {grid.step:g} px'
    )
