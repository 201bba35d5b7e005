"""The node `detector`: images in, identified targets out."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from functools import partial
from typing import TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import CompressedImage, Image, PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from visualization_msgs.msg import ImageMarker, MarkerArray

from ahf_ros.detectors.external.program import end_programs
from ahf_ros.drawing import draw
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.annotation_msg import target_annotations
from ahf_ros.nodes.cloud import TargetPoints
from ahf_ros.nodes.diagnostics import CloudTally, Diagnostics, Tally
from ahf_ros.nodes.image_msg import image_message
from ahf_ros.nodes.parameters import ParameterSettings
from ahf_ros.nodes.pipeline import STOPPING, ImageAnswer, ImageMessage, Pipeline, Refused
from ahf_ros.nodes.process import ProcessNode, run
from ahf_ros.nodes.service_detector import ServiceDetector
from ahf_ros.nodes.settings import LOSSLESS, SERVICE, DetectorNodeSettings
from ahf_ros.nodes.stacking import HeldImage, Stacks, answer_stack
from ahf_ros.nodes.waiting import Take, WaitingMessages
from ahf_ros.nodes.worker import Worker
from ahf_ros.sequence import Gathered
from ahf_ros.srv import Identify
from ahf_ros.text import printable, reason_of

Result = TypeVar('Result')

DIAGNOSTICS_PERIOD = 1.0
"""Period of /diagnostics, s."""

TOPICS = {'raw': (Image, 'image'), 'compressed': (CompressedImage, 'image/compressed')}
"""Type and topic of the images, by image transport."""

ANSWERS_KEPT = 1000
"""Depth of the publishers of answers, so that lost messages can be resent.

With a small depth, the next answer replaces one that a subscriber has not received yet.
"""

REQUESTS_KEPT = 1000
"""Requests to a service that may wait. The middleware drops more without an answer."""

_REASON = 2000  # characters of why an image is refused

LOG_PERIOD = 5.0
"""Minimum time between two log lines of the same kind about images, s."""


class DetectorNode(ProcessNode):
    """Identifies the targets of the latest image, one image at a time.

    Parameters and services are answered meanwhile. Every valid image gets an answer, unless a
    newer one arrives before its turn. Invalid images are counted and logged.
    """

    def __init__(self) -> None:
        super().__init__('detector')
        self._stopping = threading.Event()
        self._worker = Worker()
        self._waiting = WaitingMessages()
        self._tally = Tally()
        name = self.get_fully_qualified_name().lstrip('/')
        self._diagnostics = Diagnostics(f'{name}: identification', self._tally)

        self._targets = self.publisher(CodedTargetArray, 'coded_targets', ANSWERS_KEPT)
        self._debug_image = self.publisher(Image, '~/debug_image')
        self._filtered_image = self.publisher(Image, '~/filtered_image')
        self._annotations = self.publisher(ImageMarker, '~/annotations')
        self._target_points = self.publisher(PointCloud2, '~/target_points', ANSWERS_KEPT)
        self._target_labels = self.publisher(MarkerArray, '~/target_labels')
        self._diagnostic_array = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # With use_sim_time, the node's clock stops when a replay stops.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DIAGNOSTICS_PERIOD, self._publish_diagnostics, clock=steady)
        self._images: Subscription | None = None
        self._subscribed = ('', '')
        self._clouds: TargetPoints | None = None
        self._stacks: Stacks | None = None
        self._offered = 0  # images that the job answers that was offered last
        self._service: ServiceDetector | None = None
        self._settings = ParameterSettings(self, DetectorNodeSettings, self._renew)
        self._renew()
        requests = MutuallyExclusiveCallbackGroup()
        kept = QoSProfile(depth=REQUESTS_KEPT)
        for kind, name, callback in (
            (Identify, '~/identify', self._on_identify),
            (Trigger, '~/reset', self._on_reset),
        ):
            self.create_service(kind, name, callback, qos_profile=kept, callback_group=requests)

    def close(self) -> None:
        """Interrupt the current identification."""
        self._stopping.set()
        end_programs()
        self._worker.stop()

    def _renew(self) -> None:
        """Put the current parameters into force."""
        settings = self._settings.current
        self._renew_clouds(settings)
        self._renew_stacks(settings)
        self._pipeline = Pipeline(settings, self._stopping, self._service_detector(settings))
        if self._subscribed != (settings.image_transport, settings.queue):
            self._subscribed = (settings.image_transport, settings.queue)
            if self._images:
                self.destroy_subscription(self._images)
            kind, topic = TOPICS[settings.image_transport]
            lossless = settings.queue == LOSSLESS
            subscribe = self.subscribe_to_all if lossless else self.subscribe
            # The callback may wait for room in the queue and must not block the others.
            group = MutuallyExclusiveCallbackGroup()
            self._images = subscribe(kind, topic, self._on_image, group)

    def _renew_clouds(self, settings: DetectorNodeSettings) -> None:
        """Start or stop matching clouds with images."""
        if self._clouds and self._clouds.suits(settings):
            return
        clouds, self._clouds = self._clouds, None
        if clouds:
            clouds.close()
        if settings.cloud.cloud:
            self._tally.clouds = self._tally.clouds or CloudTally()
            self._clouds = TargetPoints(
                self, settings, self._tally.clouds, self._target_points, self._target_labels
            )

    def _renew_stacks(self, settings: DetectorNodeSettings) -> None:
        """Start or stop gathering images to stacks."""
        if self._stacks and self._stacks.suits(settings):
            return
        stacks, self._stacks = self._stacks, None
        if stacks:
            stacks.close('parameters changed')
        if settings.stacking.stack > 1:
            self._stacks = Stacks(self, settings, self._on_stack)

    def _service_detector(self, settings: DetectorNodeSettings) -> ServiceDetector | None:
        """Return the detector that calls a service, if the settings name it."""
        if settings.identification.detector != SERVICE:
            return None
        detection = settings.identification.detection
        wanted = settings.service, detection.family, detection.detector_timeout
        old = self._service
        if not old or (old.service, old.family, old.timeout) != wanted:
            self._service = ServiceDetector(self, *wanted, self._stopping)
        return self._service

    def _on_image(self, message: ImageMessage) -> None:
        self._tally.received += 1
        if backwards := self._tally.compare_stamps(message.header):
            self.get_logger().warning(backwards, throttle_duration_sec=LOG_PERIOD)
        pipeline, received = self._pipeline, time.monotonic()
        settings = pipeline.settings
        take: Take = lambda: message  # noqa: E731
        with suppress(Refused):
            if settings.queue == LOSSLESS:
                limit = settings.queue_memory * 2**20
                take = self._attempt(partial(self._waiting.put, message, limit))
            if stacks := self._stacks:
                stacks.add(HeldImage(take), message)
            else:
                self._submit(partial(self._process, take, pipeline, received), 1)

    def _on_stack(self, stack: Gathered[HeldImage]) -> None:
        publish = partial(self._publish, pipeline=self._pipeline, received=time.monotonic())
        job = partial(answer_stack, stack, self._pipeline, self._attempt, publish)
        self._submit(partial(job, self._tally, self.get_logger()), stack.fresh)

    def _submit(self, job: Callable[[], None], images: int) -> None:
        """Let the worker do a job that answers a number of images."""
        if self._pipeline.settings.queue == LOSSLESS:
            self._worker.append(job)
            return
        if self._worker.offer(job):
            self._tally.dropped += self._offered
        self._offered = images

    def _on_identify(
        self, request: Identify.Request, response: Identify.Response
    ) -> Identify.Response:
        pipeline = self._pipeline
        expected = request.expected or None
        job = partial(self._attempt, partial(pipeline.answer, request.image, expected))
        try:
            response.coded_targets = self._worker.call(job).message
            response.success = True
        except Refused as error:
            response.message = str(error)
        except CancelledError:
            response.message = STOPPING
        return response

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            self._worker.call(self._pipeline.reset)
            response.success = True
        except CancelledError:
            response.message = STOPPING
        return response

    def _process(self, take: Take, pipeline: Pipeline, received: float) -> None:
        """Identify the targets of an image and publish the results."""
        with suppress(Refused):
            self._attempt(lambda: self._answer(take(), pipeline, received))

    def _answer(self, message: ImageMessage, pipeline: Pipeline, received: float) -> None:
        self._publish(pipeline.answer(message), pipeline, received)

    def _publish(self, answer: ImageAnswer, pipeline: Pipeline, received: float) -> None:
        header = answer.message.header
        self._targets.publish(answer.message)
        self._tally.answered += answer.images
        self._tally.latency = time.monotonic() - received
        self._tally.last = answer.identification
        if clouds := self._clouds:
            clouds.locate(answer.message)
        if self._annotations.get_subscription_count():
            self._annotations.publish(target_annotations(answer.message))
        if self._debug_image.get_subscription_count():
            drawn = draw(answer.image, answer.identification)
            self._debug_image.publish(image_message(drawn, header))
        if self._filtered_image.get_subscription_count():
            filtered = pipeline.filtered(answer)
            self._filtered_image.publish(image_message(filtered, header))

    def _attempt(self, job: Callable[[], Result]) -> Result:
        """Return the result of a job on an image, or count and log its error.

        Raises
        ------
        Refused
            Whatever the job raises.
        """
        try:
            return job()
        except Refused:
            raise
        except ValueError as error:
            reason = printable(str(error), _REASON)
        except Exception as error:
            # No image may end the node, whatever it does to a detector.
            reason = reason_of(error)
            lines = traceback.format_exc().splitlines()
            self.get_logger().error('\n'.join(map(printable, lines)))
        self._tally.rejected += 1
        self._tally.reason = reason
        self.get_logger().warning(f'image refused: {reason}', throttle_duration_sec=LOG_PERIOD)
        raise Refused(reason)

    def _compare_types(self) -> None:
        """Report publishers of another type on the topic of the images."""
        kind, name = TOPICS[self._subscribed[0]]
        topic = self.resolve_topic_name(name)
        accepted = f'sensor_msgs/msg/{kind.__name__}'
        found = {it.topic_type for it in self.get_publishers_info_by_topic(topic)} - {accepted}
        self._tally.mistaken = ''
        if found:
            self._tally.mistaken = (
                f'{topic} is of type {", ".join(sorted(found))}, accepted is {accepted}'
            )
            self.get_logger().warning(self._tally.mistaken, throttle_duration_sec=LOG_PERIOD)

    def _publish_diagnostics(self) -> None:
        self._compare_types()
        status = self._diagnostics.status(DIAGNOSTICS_PERIOD)
        header = Header(stamp=self.get_clock().now().to_msg())
        self._diagnostic_array.publish(DiagnosticArray(header=header, status=[status]))


def main(arguments: list[str] | None = None) -> int:
    """Run the node."""
    return run(DetectorNode, arguments)
