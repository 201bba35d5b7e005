"""The node `pose`: where the camera of each image is among targets of known coordinates."""

import time
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.base.text import listed, printable
from ahf_ros.files.camera_info import Calibration, places_with_covariances
from ahf_ros.files.image_messages import nanoseconds
from ahf_ros.files.target_messages import identification_from, is_answered
from ahf_ros.msg import CodedTargetArray
from ahf_ros.network.files.coordinate_files import read_coordinates
from ahf_ros.network.points import blocks
from ahf_ros.network.pose import Pose
from ahf_ros.network.single_image import NamedPlaces, centre_covariances, known_targets, pose_of
from ahf_ros.nodes.diagnostics import PERIOD, PoseDiagnostics, PoseTally, publish_status
from ahf_ros.nodes.messages import (
    PosedTarget,
    detections_message,
    pose_message,
    target_transform,
    transform_message,
)
from ahf_ros.nodes.parameters import ParameterSettings
from ahf_ros.nodes.process import LOG_PERIOD, ProcessNode
from ahf_ros.nodes.settings import CAMERA, NONE, PoseNodeSettings
from ahf_ros.nodes.tf import Frames
from ahf_ros.nodes.topics import ANSWERS_KEPT, DETECTIONS
from ahf_ros.nodes.undistortion import Calibrations
from ahf_ros.nodes.watch import Expected, Silence, other_types, silence, topics_of_others

POSE = '~/pose'
"""Topic of the pose of the camera in the frame of the targets."""

_IMAGES = ('sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage')


class PoseNode(ProcessNode):
    """Publishes the pose of the camera for every image that determines one, and why not."""

    def __init__(self) -> None:
        super().__init__('pose')
        self._settings = ParameterSettings(self, PoseNodeSettings)
        settings = self._settings.current
        self._points = read_coordinates(settings.coordinates, settings.unit)
        self._rows = {name: row for row, name in enumerate(self._points.names)}
        self._own_covariances = blocks(self._points.covariance)
        self._tally = PoseTally()
        self._diagnostics = PoseDiagnostics(self._tally)
        self._calibrations = Calibrations()
        self._images_of_detector: tuple[str, ...] = ()
        self._poses = self.publisher(PoseWithCovarianceStamped, POSE, ANSWERS_KEPT)
        self._detections: tuple[Any, Any] | None = None
        if settings.detections:
            kinds: Any = import_module('vision_msgs.msg')
            publisher = self.publisher(kinds.Detection3DArray, DETECTIONS, ANSWERS_KEPT)
            self._detections = kinds, publisher
        wanted = settings.tf != NONE or settings.target_frames
        self._frames = Frames(self) if wanted else None
        self._silence = Silence(self, 'coded_targets')
        publish_status(self, 'pose', self._status)
        self._informed = False
        self._camera_info = self.subscribe(
            CameraInfo, 'camera_info', self._on_camera_info, MutuallyExclusiveCallbackGroup()
        )
        self._targets = self.subscribe(
            CodedTargetArray,
            'coded_targets',
            self._on_targets,
            MutuallyExclusiveCallbackGroup(),
            lossless=True,
        )

    def introduction(self) -> str:
        """Return how many targets are known, how far they extend, and the topics."""
        settings, points = self._settings.current, self._points
        extent = ' x '.join(f'{it:.3g}' for it in np.ptp(points.xyz, axis=0))
        names = {'targets': 'coded_targets', 'calibration': 'camera_info', 'poses': POSE}
        topics = [f'{what} on {self.resolve_topic_name(it)}' for what, it in names.items()]
        return (
            f'{len(points.names)} targets over {extent} m, '
            f'frame {settings.targets_frame}, tf {settings.tf}, {", ".join(topics)}'
        )

    def _on_camera_info(self, message: CameraInfo) -> None:
        self._informed = True
        self._calibrations.put(message)

    def _on_targets(self, message: CodedTargetArray) -> None:
        if not is_answered(message):  # the detector says why
            return
        begin = time.monotonic()
        tally, settings = self._tally, self._settings.current
        tally.received += 1
        if text := tally.compare_stamps(message.header):
            self.get_logger().warning(text, throttle_duration_sec=LOG_PERIOD)
        try:
            camera = self._camera(message, settings)
            targets = identification_from(message).targets
            pose = self._pose(targets, camera, settings)
        except ValueError as error:
            tally.refused += 1
            tally.reason = printable(str(error), 1000)
            logger = self.get_logger()
            logger.warning(f'no pose: {tally.reason}', throttle_duration_sec=LOG_PERIOD)
            return
        if pose.rejected:
            tally.wrong += 1
            tally.rejected = listed([f'{it.target}, {it.reason}' for it in pose.rejected], 4)
            logger = self.get_logger()
            text = f'targets left out: {tally.rejected}'
            logger.warning(text, throttle_duration_sec=LOG_PERIOD)
        tally.used, tally.sigma0 = len(pose.targets), pose.sigma0
        self._publish(pose, targets, message.header, settings)
        tally.latency = time.monotonic() - begin

    def _camera(self, message: CodedTargetArray, settings: PoseNodeSettings) -> Calibration:
        """Return the calibration of an image; a ValueError says why there is none."""
        header = message.header
        camera = self._calibrations.at(nanoseconds(header))
        if camera is None:
            topic = self.resolve_topic_name('camera_info')
            raise ValueError(f'no camera_info has come on {topic}')
        camera.check(header.frame_id, message.width, message.height)
        rectified = settings.camera_matrix == 'p'
        matrix = camera.projection if rectified else camera.matrix
        if not matrix[:2, 2].any():
            raise ValueError(
                f'{settings.camera_matrix} of camera_info has the principal point 0, 0, accepted '
                'is one in the image: a camera that is calibrated'
            )
        self._tally.rectified = self._mistaken_matrix(camera, rectified)
        return camera

    def _pose(
        self, targets: tuple[Target, ...], camera: Calibration, settings: PoseNodeSettings
    ) -> Pose:
        """Return the pose of an image; a ValueError says why there is none."""
        names, known, aside = known_targets(targets, self._rows)
        unknown = [
            f'{it.family}:{it.id}'
            for it in targets
            if it.id != UNDECODED
            and str(it.id) not in self._rows
            and f'{it.family}:{it.id}' not in self._rows
        ]
        self._tally.unknown = listed(unknown)
        if not known and unknown:
            raise ValueError(
                f'no target has known coordinates: seen are {listed(unknown)}, coordinates are of '
                f'{listed(self._points.names)}'
            )
        centres = np.array([(it.x, it.y) for it in known], float).reshape(-1, 2)
        covariances = centre_covariances(known, settings.centre_deviation)
        seen = places_with_covariances(camera, centres, covariances, settings.camera_matrix == 'p')
        pose = pose_of(NamedPlaces(names, *seen, aside), self._points)
        if pose.second:
            self._tally.ambiguous += 1
            if not settings.publish_ambiguous:
                raise ValueError(
                    f'two poses fit about as well, turned by {_turn(pose):.0f} deg: targets in '
                    'a plane, far away or seen from the front; publish_ambiguous publishes the '
                    'likelier one'
                )
        return pose

    def _publish(
        self, pose: Pose, targets: tuple[Target, ...], header: Header, settings: PoseNodeSettings
    ) -> None:
        of_targets = Header(stamp=header.stamp, frame_id=settings.targets_frame)
        self._poses.publish(pose_message(pose.camera, of_targets))
        self._tally.published += 1
        used = set(pose.targets)
        posed = []
        if settings.target_frames or self._detections:
            names, known, _ = known_targets(targets, self._rows)
            both = zip(names, known, strict=True)
            posed = [self._posed(pose, name, it) for name, it in both if name in used]
        if self._detections:
            kinds, publisher = self._detections
            publisher.publish(detections_message(posed, header, kinds))
        if self._frames:
            transforms = []
            if settings.tf == CAMERA:
                to_camera = pose.camera.inverse
                transforms.append(transform_message(to_camera, header, settings.targets_frame))
            elif settings.tf != NONE:
                transforms.append(transform_message(pose.camera, of_targets, header.frame_id))
            if settings.target_frames:
                transforms += [transform_message(it.transform, header, it.frame) for it in posed]
            self._frames.publish(transforms)
            self._tally.no_tf = self._frames.problem

    def _posed(self, pose: Pose, name: str, target: Target) -> PosedTarget:
        row = self._rows[name]
        transform = target_transform(
            pose.camera, self._points.xyz[row], self._own_covariances[row]
        )
        return PosedTarget(target.family, target.id, target.confidence, transform)

    def _mistaken_matrix(self, camera: Calibration, rectified: bool) -> str:
        """Return a message if images seem to follow the other matrix of camera_info."""
        read = self._images_of_detector
        if rectified:
            if camera.distortion.any() and any(name.endswith('image_raw') for name in read):
                return (
                    f'camera_matrix is p, for rectified images, but {read[0]} is not rectified: '
                    'set camera_matrix to k'
                )
            return ''
        scale = camera.matrix[0, 0]
        other = np.abs(camera.projection - camera.matrix).max() > 1e-6 * scale
        other |= np.abs(camera.rotation - np.eye(3)).max() > 1e-6
        if not camera.distortion.any() and other:
            return (
                'camera_info has no distortion, and p or r differ from k, as for rectified '
                'images, but camera_matrix is k: set it to p if they are'
            )
        named = [name for name in read if 'rect' in name.rpartition('/')[2]]
        if camera.distortion.any() and named:
            return (
                f'{named[0]} seems to be rectified, but camera_matrix is k, which distorts: set '
                'it to p'
            )
        return ''

    def _look(self) -> None:
        """Bring what depends on publishers and on time up to date."""
        tally, source, topics = self._tally, self._targets, partial(topics_of_others, self)
        publishers = source.publishers()
        tally.mistaken = other_types(source, publishers)
        tally.lost += source.losses.newly_lost()
        # The detector says whether images come, of which each gives a message.
        expected = Expected(self._settings.current.targets_timeout)
        tally.silent = self._silence.look(source, publishers, expected)
        tally.uncalibrated = ''
        if tally.received and not self._informed:
            source = self._camera_info
            why = silence(source, source.publishers(), topics)
            tally.uncalibrated = f'no camera_info: {why}'
        self._images_of_detector = images_heard(self, publishers)

    def _status(self) -> DiagnosticStatus:
        self._look()
        return self._diagnostics.status(PERIOD)


def images_heard(node: Node, publishers: Sequence[TopicEndpointInfo]) -> tuple[str, ...]:
    """Return the topics of images that the nodes of some publishers subscribe to, in order.

    A publisher may be known before its node is, and while that ends.
    """
    read = set()
    for it in publishers:
        if not it.node_namespace.startswith('/'):  # of a node that is not known yet
            continue
        with suppress(NodeNameNonExistentError):
            heard = node.get_subscriber_names_and_types_by_node(it.node_name, it.node_namespace)
            read |= {topic for topic, kinds in heard if kinds[0] in _IMAGES}
    return tuple(sorted(read))


def _turn(pose: Pose) -> float:
    """Return the angle between a pose and its second one, deg."""
    if pose.second is None:
        return 0.0
    return float(np.degrees(np.linalg.norm(pose.second.step_from(pose.camera)[3:])))
