"""Positions of the targets of an image in space, from the point cloud of the same shot."""

import threading
from operator import attrgetter

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from ahf_ros.clouds.cloud_settings import CloudSettings
from ahf_ros.clouds.localisation import Positions
from ahf_ros.clouds.matching import ANSWER, ANSWERS, CLOUD, Matcher, Waiting
from ahf_ros.clouds.point_clouds import organised_points
from ahf_ros.clouds.scans import located
from ahf_ros.files.image_messages import nanoseconds
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.diagnostics import CloudTally
from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.messages import target_labels, target_points
from ahf_ros.nodes.process import LOG_PERIOD, ProcessNode
from ahf_ros.nodes.settings import LOSSLESS, DetectorNodeSettings
from ahf_ros.nodes.topics import ANSWERS_KEPT, POINTS, TARGET_LABELS, TARGET_POINTS

_relevant = attrgetter('cloud', 'queue', 'queue_memory')


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
        try:
            points, found = points_of(answer, cloud, self._settings.cloud)
        except ValueError as error:
            self._refuse(str(error))
            return
        with self._publishing:
            if self._closed:
                return
            self._points.publish(points)
            if self._labels.get_subscription_count():
                self._labels.publish(target_labels(answer.targets, found, points.header))
        self._tally.used += 1
        self._tally.positions = f'{found.known.sum()} of {len(answer.targets)}'

    def _refuse(self, reason: str) -> None:
        self._tally.rejected += 1
        self._tally.reason = reason
        logger = self._node.get_logger()
        logger.warning(f'cloud refused: {reason}', throttle_duration_sec=LOG_PERIOD)


def points_of(
    answer: CodedTargetArray, cloud: PointCloud2, settings: CloudSettings
) -> tuple[PointCloud2, Positions]:
    """Return the targets of an answer with their positions in a cloud, and the positions.

    A ValueError says why the cloud is not accepted.
    """
    shape = answer.height, answer.width
    found = located(organised_points(cloud), answer.targets, shape, settings)
    header = Header(stamp=answer.header.stamp, frame_id=cloud.header.frame_id)
    return target_points(answer.targets, found, header), found
