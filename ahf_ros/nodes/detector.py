"""The node `detector`: images in, identified targets out."""

import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.lifecycle.node import LifecycleNodeMixin
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger

from ahf_ros.base import ending
from ahf_ros.base.text import printable
from ahf_ros.clouds.point_clouds import organised_points
from ahf_ros.nodes.answers import Answers
from ahf_ros.nodes.cloud import points_of
from ahf_ros.nodes.diagnostics import PERIOD, Diagnostics, Tally, publish_status
from ahf_ros.nodes.image_queue import ImageQueue, Worker
from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.parameters import ParameterSettings
from ahf_ros.nodes.patience import TRIGGERED
from ahf_ros.nodes.pipeline import STOPPING, Pipeline
from ahf_ros.nodes.process import ProcessNode, release_memory
from ahf_ros.nodes.service_detector import ServiceDetector
from ahf_ros.nodes.settings import (
    FFMPEG,
    IMAGE_TRANSPORTS,
    LOSSLESS,
    SERVICE,
    DetectorNodeSettings,
)
from ahf_ros.nodes.topics import (
    CODED_TARGETS,
    LOSSLESS_SUBSCRIPTION,
    POINTS,
    SUBSCRIPTION,
    camera_info_topic,
    declare_topics,
    image_topic,
    image_type,
)
from ahf_ros.nodes.video import Video
from ahf_ros.nodes.watch import Expected, Watch
from ahf_ros.srv import Identify

ACTIVE = 'active'
"""State of a node that works."""

NO_ANSWERS = '/diagnostics', '/parameter_events'
"""Topics that are published without images."""

MATCHING = 0.25
"""Time within which a node notices who subscribes to answers, s."""

IDLE = 3.0
"""Time without an image after which a node gives back the memory that it keeps for the next, s."""

REQUESTS_KEPT = 1000
"""Requests to a service that may wait. The middleware drops more without an answer."""


class DetectorNode(ProcessNode, LifecycleNodeMixin):
    """Identifies the targets of images, and answers parameters and services meanwhile.

    Every valid image gets an answer, unless a newer one arrives before its turn. Invalid images
    are counted and logged. Requests are answered one at a time, while the node is active.

    Where it is managed, others configure, activate, deactivate and clean it up, by the states and
    services of ROS 2 (design.ros2.org/articles/node_lifecycle.html).
    """

    def __init__(self) -> None:
        super().__init__('detector')
        self.listen(False)
        self._active = False
        self._rested = (False, False)
        self._matching = threading.Lock()
        self._no_answers = {self.resolve_topic_name(it) for it in NO_ANSWERS}
        self._stopping = threading.Event()
        self._worker = Worker()
        self._tally = Tally()
        self._diagnostics = Diagnostics(self._tally)
        self._watch = Watch(self, self._tally)
        declare_topics(self)
        self._answers = Answers(self, self._tally)
        self._queue = ImageQueue(self, self._worker, self._answers, self._tally)
        publish_status(self, 'identification', self._status)
        self._images: Input | None = None
        self._subscribed = ('', '')
        self._service: ServiceDetector | None = None
        self._settings = ParameterSettings(self, DetectorNodeSettings, self._renew)
        self._configured = False
        group, kept = MutuallyExclusiveCallbackGroup(), QoSProfile(depth=REQUESTS_KEPT)
        for kind, service, answer in (
            (Identify, '~/identify', self._identify),
            (Trigger, '~/reset', self._reset),
        ):
            respond = partial(self._respond, answer)
            self.create_service(kind, service, respond, qos_profile=kept, callback_group=group)
        self._managed = False
        self._begin()
        self._matcher = threading.Thread(target=self._look_for_subscribers, daemon=True)
        self._matcher.start()

    def _begin(self) -> None:
        """Configure and activate, or let others do it. Raises a ValueError if it cannot."""
        if not self._settings.on('managed'):
            self.configure()
            self.activate()
            return
        steps = {
            'configure': self.configure,
            'activate': self.activate,
            'deactivate': self.deactivate,
            'cleanup': self.cleanup,
            'shutdown': self.cleanup,
            'error': self.cleanup,  # after a step that failed unexpectedly
        }
        for name, work in steps.items():
            setattr(self, f'on_{name}', partial(self._step, name, work))
        LifecycleNodeMixin.__init__(self, callback_group=MutuallyExclusiveCallbackGroup())
        self._managed = True
        service = self._service_change_state
        service.callback = partial(self._change_state, service.callback)
        succeeded = TransitionCallbackReturn.SUCCESS
        if self._settings.on('autostart') and self.trigger_configure() == succeeded:
            self.trigger_activate()

    @property
    def state(self) -> str:
        """State of a managed node; one that is not managed is always active."""
        return self._state_machine.current_state[1] if self._managed else ACTIVE

    def _step(
        self, name: str, work: Callable[[], None], _: LifecycleState
    ) -> TransitionCallbackReturn:
        """Take a step of the lifecycle, and log why it fails, of which rclpy says nothing."""
        try:
            work()
        except ValueError as error:
            self.get_logger().error(f'{name} fails: {printable(str(error))}')
            return TransitionCallbackReturn.FAILURE
        except Exception:
            lines = traceback.format_exc().splitlines()
            self.get_logger().error('\n'.join(map(printable, lines)))
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def _change_state(self, change: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        """Refuse an impossible transition, where an error of rcl would end the node."""
        before = self.state
        try:
            return change(request, response)
        except RuntimeError:
            what = printable(request.transition.label or str(request.transition.id))
            self.get_logger().error(f'transition {what} is not possible: state is {before}')
            response.success = False
            return response

    def configure(self) -> None:
        """Check the settings and make the detector."""
        self._configured = True
        try:
            self._renew()
        except ValueError:
            self.cleanup()
            raise

    def activate(self) -> None:
        """Subscribe to images, and answer those that wait."""
        self._active = True
        self._listen_if_asked()
        self._worker.resume()

    def deactivate(self) -> None:
        """Stop to receive and to answer images; those that wait are kept."""
        self._active = False
        self._listen_if_asked()
        self._worker.pause()

    def _listen_if_asked(self) -> None:
        """Receive images as long as the node is active and somebody asks for answers."""
        with self._matching:
            self.listen(self._active and self._asked())

    def _look_for_subscribers(self) -> None:
        """Take note of who begins or ceases to ask for answers, until the node stops.

        No events of publishers say so: with them, a publisher that is destroyed while its
        subscribers go may wait for ever in Fast DDS.
        """
        while not self._stopping.wait(MATCHING):
            self._listen_if_asked()

    def _asked(self) -> bool:
        """Return whether anybody subscribes to answers, or they are kept for those who will."""
        kept = DurabilityPolicy.TRANSIENT_LOCAL
        for it in self.publishers:
            with suppress(InvalidHandle):  # it has been destroyed meanwhile
                asked = it.get_subscription_count() or it.qos_profile.durability == kept
                if asked and it.topic_name not in self._no_answers:
                    return True
        return self._settings.on('always')

    def cleanup(self) -> None:
        """Give up detector, subscriptions and the images that wait."""
        self.deactivate()
        self._configured = False
        self._queue.discard()
        if self._images:
            self.unsubscribe(self._images)
        self._answers.close()
        self._images = self._service = None
        self._subscribed = ('', '')
        if given_up := self._tally.give_up():
            self.get_logger().warning(f'{given_up} images that waited are given up')

    def close(self) -> None:
        """Interrupt the current identification."""
        self._stopping.set()
        self._matcher.join()
        ending.begin()
        self._worker.stop()
        self._queue.give_up(STOPPING)

    def introduction(self) -> str:
        """Return the settings that matter most, and the topics."""
        if not self._configured:
            return f'the node is {self.state} and waits for the service ~/change_state'
        settings = self._settings.current
        names = {'answers': CODED_TARGETS, 'images': image_topic(self, settings.image_transport)}
        if settings.cloud.cloud:
            names['clouds'] = POINTS
        if settings.answers.undistort:
            names['calibration'] = camera_info_topic(self)
        topics = [f'{what} on {self.resolve_topic_name(it)}' for what, it in names.items()]
        return f'{settings.described()}, {", ".join(topics)}'

    def ineffective(self, arguments: Sequence[str]) -> Iterator[str]:
        """Yield a message for each argument and parameter that has no effect on the node."""
        yield from super().ineffective(arguments)
        try:
            settings = self._settings.current
        except ValueError:  # which the step `configure` will say
            return
        yield from settings.ineffective()
        unused, used = f'.{LOSSLESS_SUBSCRIPTION}.', f'.{SUBSCRIPTION}.'
        if settings.queue == LOSSLESS:
            unused, used = used, unused
        topics = *(image_topic(self, it) for it in IMAGE_TRANSPORTS), POINTS
        begins = [f'qos_overrides.{self.resolve_topic_name(it)}{unused}' for it in topics]
        for name in self._parameter_overrides:
            instead = name.replace(unused, used)
            if name.startswith(tuple(begins)) and instead not in self._parameter_overrides:
                yield f'{name} has no effect: queue is {settings.queue}, which needs {instead}'

    def _renew(self) -> None:
        """Put the current parameters into force, unless the node is not configured."""
        if not self._configured:
            return
        settings = self._settings.current
        self._answers.renew(settings)
        detector = self._service_detector(settings)
        self._queue.renew(Pipeline(settings, self._stopping, detector))
        transport = settings.image_transport
        if self._subscribed != (transport, settings.queue):
            self._subscribed = (transport, settings.queue)
            if self._images:
                self.unsubscribe(self._images)
            kind, topic = image_type(transport), image_topic(self, transport)
            put = Video(self._queue).put if transport == FFMPEG else self._queue.put
            lossless = self._tally.lossless = settings.queue == LOSSLESS
            # The callback may write to the disk and must not block the others.
            group = MutuallyExclusiveCallbackGroup()
            self._images = self.subscribe(kind, topic, put, group, lossless)

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

    def _respond(self, answer: Callable[[Any, Any], None], request: Any, response: Any) -> Any:
        """Answer a request while the node is active."""
        if self.state != ACTIVE:
            response.message = f'the node is {self.state}, accepted is {ACTIVE}'
            return response
        try:
            answer(request, response)
            response.success = True
        except ValueError as error:
            response.message = str(error)
        except CancelledError:
            response.message = STOPPING
        return response

    def _identify(self, request: Identify.Request, response: Identify.Response) -> None:
        cloud, settings = request.cloud, self._settings.current.cloud
        located = bool(cloud.width or len(cloud.data))
        if located:
            organised_points(cloud)
        job = partial(self._queue.identify, request.image, request.expected or None)
        answer = response.coded_targets = self._worker.call(job)
        if located:
            response.target_points, _ = points_of(answer, cloud, settings)

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> None:
        self._worker.call(self._queue.pipeline.stream.reset)

    def _status(self) -> DiagnosticStatus:
        state = self.state
        self._tally.inactive = '' if state == ACTIVE else state
        if self._images and state == ACTIVE:
            settings = self._settings.current
            self._tally.unasked = not self._listening
            # Of what is not subscribed to, nothing is expected.
            acquisition = settings.acquisition if self._listening else TRIGGERED
            expected = Expected(settings.image_timeout, acquisition, self._worker.busy)
            self._watch.look(self._images, expected, self._answers.waiting())
            self._rest(time.monotonic() - self._images.arrived > IDLE and not expected.busy)
        return self._diagnostics.status(PERIOD)

    def _rest(self, idle: bool) -> None:
        """Give memory back once the node has become idle, or nobody asks for answers any more."""
        before, self._rested = self._rested, (idle, self._listening)
        if idle and self._rested != before:
            release_memory()
