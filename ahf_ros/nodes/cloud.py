"""Positions of the targets of an image in space, from the point cloud of the same shot."""

from __future__ import annotations

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.publisher import Publisher
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from ahf_ros.interchange.point_clouds import organised_points
from ahf_ros.localisation import positions
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.diagnostics import CloudTally
from ahf_ros.nodes.matching import Matcher
from ahf_ros.nodes.point_msg import target_labels, target_points
from ahf_ros.nodes.process import ProcessNode
from ahf_ros.nodes.settings import LOSSLESS, DetectorNodeSettings

ANSWERS = 100
"""Maximum number of answers waiting for the cloud of their image."""

LOG_PERIOD = 5.0
"""Minimum time between two log lines about refused clouds, s."""

CLOUD, ANSWER = 0, 1
"""Sides of the matcher."""


class TargetPoints:
    """Publishes the positions of targets as soon as an answer and its cloud are both there.

    Drivers of scanners give the image and the cloud of a shot the same stamp, and either may
    arrive first. A match discards everything that arrived before it; if too much waits, the oldest
    is discarded.

    Parameters
    ----------
    node : ProcessNode
        Subscribes to `points`.
    settings : DetectorNodeSettings
        Settings of the node.
    tally : CloudTally
        Counts to continue.
    points, labels : rclpy.publisher.Publisher
        Publishers of sensor_msgs/PointCloud2 and of visualization_msgs/MarkerArray.
    """

    def __init__(
        self,
        node: ProcessNode,
        settings: DetectorNodeSettings,
        tally: CloudTally,
        points: Publisher,
        labels: Publisher,
    ) -> None:
        self._node = node
        self._settings = _relevant(settings)
        self._radius = settings.cloud.cloud_radius
        self._tally = tally
        self._points = points
        self._labels = labels
        tolerance = round(settings.cloud.cloud_tolerance * 1e9)
        limits = (settings.queue_memory * 2**20, ANSWERS)
        self._matcher = Matcher(tolerance, limits, tally.unmatched)
        subscribe = node.subscribe_to_all if settings.queue == LOSSLESS else node.subscribe
        group = MutuallyExclusiveCallbackGroup()
        self._clouds = subscribe(PointCloud2, 'points', self._on_cloud, group)

    def suits(self, settings: DetectorNodeSettings) -> bool:
        """Return whether other settings of the node would make no difference."""
        return _relevant(settings) == self._settings

    def close(self) -> None:
        """End the subscription."""
        self._node.destroy_subscription(self._clouds)

    def locate(self, answer: CodedTargetArray) -> None:
        """Publish the positions of the targets of an answer, now or when its cloud arrives."""
        cloud = self._matcher.put(ANSWER, _nanoseconds(answer.header), answer)
        if cloud is not None:
            self._publish(answer, cloud)

    def _on_cloud(self, cloud: PointCloud2) -> None:
        self._tally.received += 1
        try:
            organised_points(cloud)
        except ValueError as error:
            self._refuse(str(error))
            return
        answer = self._matcher.put(CLOUD, _nanoseconds(cloud.header), cloud, len(cloud.data))
        if answer is not None:
            self._publish(answer, cloud)

    def _publish(self, answer: CodedTargetArray, cloud: PointCloud2) -> None:
        if (cloud.width, cloud.height) != (answer.width, answer.height):
            self._refuse(
                f'cloud has {cloud.width} x {cloud.height} points, '
                f'accepted is {answer.width} x {answer.height}, the size of the image'
            )
            return
        found = positions(organised_points(cloud), answer.targets, self._radius)
        header = Header(stamp=answer.header.stamp, frame_id=cloud.header.frame_id)
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


def _relevant(settings: DetectorNodeSettings) -> tuple[object, ...]:
    return settings.cloud, settings.queue, settings.queue_memory


def _nanoseconds(header: Header) -> int:
    return int(header.stamp.sec * 10**9 + header.stamp.nanosec)
