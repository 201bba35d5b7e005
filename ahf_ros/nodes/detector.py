"""The node `detector`: images in, identified targets out."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from std_msgs.msg import Header

from ahf_ros import ending
from ahf_ros.nodes.answers import Answers
from ahf_ros.nodes.diagnostics import Diagnostics, Tally
from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.managed import ACTIVE, ManagedNode
from ahf_ros.nodes.parameters import ParameterSettings
from ahf_ros.nodes.pipeline import ImageJob, ImageMessage, Pipeline, Refused
from ahf_ros.nodes.process import LOG_PERIOD, run
from ahf_ros.nodes.requests import Requests
from ahf_ros.nodes.service_detector import ServiceDetector
from ahf_ros.nodes.settings import LOSSLESS, SERVICE, DetectorNodeSettings
from ahf_ros.nodes.stacking import HeldImage, Stacks, answer_stack, image_kind
from ahf_ros.nodes.topics import (
    IMAGE_TYPES,
    POINTS,
    camera_info_topic,
    declare_topics,
    image_topic,
)
from ahf_ros.nodes.waiting import Take, WaitingMessages
from ahf_ros.nodes.watch import Watch
from ahf_ros.nodes.worker import Worker
from ahf_ros.stream import Gathered, why_refused
from ahf_ros.text import printable

Result = TypeVar('Result')

DIAGNOSTICS_PERIOD = 1.0
"""Period of /diagnostics, s."""


class DetectorNode(ManagedNode):
    """Identifies the targets of the latest image, and of the next one in another thread.

    Parameters and services are answered meanwhile. Every valid image gets an answer, unless a
    newer one arrives before its turn. Invalid images are counted and logged.
    """

    def __init__(self) -> None:
        super().__init__('detector')
        self.listen(False)
        self._stopping = threading.Event()
        self._worker = Worker()
        self._waiting = WaitingMessages()
        self._tally = Tally()
        name = self.get_fully_qualified_name().lstrip('/')
        self._diagnostics = Diagnostics(f'{name}: identification', self._tally)

        self._watch = Watch(self, self._tally)
        declare_topics(self)
        self._answers = Answers(self, self._tally)
        self._diagnostic_array = self.publisher(DiagnosticArray, '/diagnostics', 10)
        # With use_sim_time, the node's clock stops when a replay stops.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DIAGNOSTICS_PERIOD, self._publish_diagnostics, clock=steady)
        self._images: Input | None = None
        self._subscribed = ('', '')
        self._stacks: Stacks | None = None
        self._offered = 0  # images that the job answers that was offered last
        self._service: ServiceDetector | None = None
        self._settings = ParameterSettings(self, DetectorNodeSettings, self._renew)
        self._configured = False
        Requests(self, self._worker, lambda: self._pipeline, self._attempt)
        self.begin(self._settings.on('managed'), self._settings.on('autostart'))

    def configure(self) -> None:
        """Check the settings and make the detector."""
        self._configured = True
        self._renew()

    def activate(self) -> None:
        """Subscribe to images, and answer those that wait."""
        self.listen(True)
        self._worker.resume()

    def deactivate(self) -> None:
        """Stop to receive and to answer images; those that wait are kept."""
        self.listen(False)
        self._worker.pause()

    def cleanup(self) -> None:
        """Give up detector, subscriptions and the images that wait."""
        self._configured = False
        self._worker.discard()
        self._waiting, self._offered = WaitingMessages(), 0
        if stacks := self._stacks:
            stacks.discard()
        if self._images:
            self.unsubscribe(self._images)
        self._answers.close()
        self._images = self._stacks = self._service = None
        self._subscribed = ('', '')
        if given_up := self._tally.give_up():
            self.get_logger().warning(f'{given_up} images that waited are given up')

    def close(self) -> None:
        """Interrupt the current identification."""
        self._stopping.set()
        ending.begin()
        self._worker.stop()

    def introduction(self) -> str:
        """Return the settings that matter most, and the topics."""
        if not self._configured:
            return f'the node is {self.state} and waits for the service ~/change_state'
        settings = self._settings.current
        names = {'answers': 'coded_targets', 'images': image_topic(self, settings.image_transport)}
        if settings.cloud.cloud:
            names['clouds'] = POINTS
        if settings.answers.undistort:
            names['calibration'] = camera_info_topic(self)
        topics = [f'{what} on {self.resolve_topic_name(it)}' for what, it in names.items()]
        return f'{settings.described()}, {", ".join(topics)}'

    def _renew(self) -> None:
        """Put the current parameters into force, unless the node is not configured."""
        if not self._configured:
            return
        settings = self._settings.current
        self._answers.renew(settings)
        self._renew_stacks(settings)
        self._pipeline = Pipeline(settings, self._stopping, self._service_detector(settings))
        if self._subscribed != (settings.image_transport, settings.queue):
            self._subscribed = (settings.image_transport, settings.queue)
            if self._images:
                self.unsubscribe(self._images)
            transport = settings.image_transport
            kind, topic = IMAGE_TYPES[transport], image_topic(self, transport)
            lossless = self._tally.lossless = settings.queue == LOSSLESS
            # The callback may wait for room in the queue and must not block the others.
            group = MutuallyExclusiveCallbackGroup()
            self._images = self.subscribe(kind, topic, self._on_image, group, lossless)

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
        if changed := self._tally.compare_kinds(image_kind(message)):
            self.get_logger().warning(changed, throttle_duration_sec=LOG_PERIOD)
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
                image = ImageJob(take, pipeline)
                job = partial(self._process, image, pipeline, received)
                self._submit(job, 1, image.prepare if pipeline.ahead else None)

    def _on_stack(self, stack: Gathered[HeldImage]) -> None:
        publish = partial(
            self._answers.publish, pipeline=self._pipeline, received=time.monotonic()
        )
        job = partial(answer_stack, stack, self._pipeline, self._attempt, publish)
        self._submit(partial(job, self._tally, self.get_logger()), stack.fresh)

    def _submit(
        self,
        job: Callable[[], None],
        images: int,
        prepare: Callable[[], None] | None = None,
    ) -> None:
        """Let the worker do a job that answers a number of images."""
        if self._pipeline.settings.queue == LOSSLESS:
            self._worker.append(job, prepare)
            return
        if self._worker.offer(job, prepare):
            self._tally.dropped += self._offered
        self._offered = images

    def _process(self, image: ImageJob, pipeline: Pipeline, received: float) -> None:
        """Identify the targets of an image and publish the results."""
        # In a lossless stream no image waits like this.
        if self._worker.waiting and image.outdated():
            self._tally.dropped += 1
            return
        with suppress(Refused):
            self._attempt(lambda: self._answers.publish(image.answer(), pipeline, received))

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
        except Exception as error:
            # No image may end the node, whatever it does to a detector.
            reason = why_refused(error)
            if not isinstance(error, ValueError):
                lines = traceback.format_exc().splitlines()
                self.get_logger().error('\n'.join(map(printable, lines)))
        self._tally.rejected += 1
        self._tally.reason = reason
        self.get_logger().warning(f'image refused: {reason}', throttle_duration_sec=LOG_PERIOD)
        raise Refused(reason)

    def _publish_diagnostics(self) -> None:
        # Before the counts, so that these are no older than the stamp.
        header = Header(stamp=self.get_clock().now().to_msg())
        state = self.state
        self._tally.inactive = '' if state == ACTIVE else state
        if self._images and state == ACTIVE:
            timeout = self._settings.current.image_timeout
            self._watch.look(self._images, timeout, self._answers.waiting())
        status = self._diagnostics.status(DIAGNOSTICS_PERIOD)
        self._diagnostic_array.publish(DiagnosticArray(header=header, status=[status]))


def main(arguments: list[str] | None = None) -> int:
    """Run the node."""
    return run(DetectorNode, arguments)
