"""Everything that a node publishes about an image that it has identified."""

from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import NamedTuple

from rclpy.publisher import Publisher
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from visualization_msgs.msg import ImageMarker

from ahf_ros.clouds.matching import Waiting
from ahf_ros.identification.stream import Answer
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.cloud import TargetPoints
from ahf_ros.nodes.diagnostics import ANSWER, SEARCH, CloudTally, Stages, Tally
from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.messages import (
    apriltag_detections,
    image_message,
    target_annotations,
    target_detections,
)
from ahf_ros.nodes.pipeline import Pipeline
from ahf_ros.nodes.process import ProcessNode
from ahf_ros.nodes.settings import PACKAGES, DetectorNodeSettings
from ahf_ros.nodes.topics import ANSWERS_KEPT, APRILTAG_DETECTIONS, CODED_TARGETS, DETECTIONS
from ahf_ros.nodes.undistortion import UndistortedTargets
from ahf_ros.views.drawing.overlay import draw


class _Form(NamedTuple):
    """A form of answers in messages of another package."""

    setting: str
    kind: str
    topic: str
    made: Callable[[CodedTargetArray, ModuleType], object]


_FORMS = (
    _Form('detections', 'Detection2DArray', DETECTIONS, target_detections),
    _Form(
        'apriltag_detections', 'AprilTagDetectionArray', APRILTAG_DETECTIONS, apriltag_detections
    ),
)


class Answers:
    """Publishes an identification in every form that is asked for."""

    def __init__(self, node: ProcessNode, tally: Tally) -> None:
        self._node = node
        self._tally = tally
        self._targets = node.publisher(CodedTargetArray, CODED_TARGETS, ANSWERS_KEPT)
        self._debug_image = node.publisher(Image, '~/debug_image')
        self._filtered_image = node.publisher(Image, '~/filtered_image')
        self._annotations = node.publisher(ImageMarker, '~/annotations')
        self._clouds: TargetPoints | None = None
        self._forms: dict[str, tuple[ModuleType, Publisher]] = {}  # by the name of their topic
        self._wanted: tuple[_Form, ...] = ()
        self._undistorted: UndistortedTargets | None = None

    def renew(self, settings: DetectorNodeSettings) -> None:
        """Put settings into force: start or stop what they ask for."""
        if not (self._clouds and self._clouds.suits(settings)):
            self._close_clouds()
            if settings.cloud.cloud:
                self._tally.clouds = self._tally.clouds or CloudTally()
                self._clouds = TargetPoints(self._node, settings, self._tally.clouds)
        # A publisher stays once it is there: the answer that is being published may need it.
        self._wanted = tuple(it for it in _FORMS if getattr(settings.answers, it.setting))
        for form in self._wanted:
            if form.topic not in self._forms:
                types = import_module(f'{PACKAGES[form.setting]}.msg')
                kind = getattr(types, form.kind)
                publisher = self._node.publisher(kind, form.topic, ANSWERS_KEPT)
                self._forms[form.topic] = types, publisher
        if settings.answers.undistort and not self._undistorted:
            self._undistorted = UndistortedTargets(self._node, self._tally)
        if self._undistorted:
            self._undistorted.listen(settings.answers.undistort)

    def give_up(self, message: CodedTargetArray) -> None:
        """Publish that an image was not identified, to those who wait for its stamp."""
        self._targets.publish(message)

    def waiting(self) -> tuple[Input, Waiting] | None:
        """Return where clouds come from and what waits for its match, None without clouds."""
        clouds = self._clouds
        return clouds.waiting() if clouds else None

    def close(self) -> None:
        """Stop everything that settings ask for, and forget what waits for its cloud."""
        self._close_clouds()
        if self._undistorted:
            self._undistorted.listen(False)

    def _close_clouds(self) -> None:
        clouds, self._clouds = self._clouds, None
        if clouds:
            clouds.close()

    def publish(self, answer: Answer[Header], pipeline: Pipeline, stages: Stages) -> None:
        """Publish an answer of a pipeline, and count how long it took."""
        message, found = pipeline.message(answer), answer.identification
        self._targets.publish(message)
        stages.end(ANSWER)
        self._tally.settled = answer.settled
        self._tally.answered += answer.fresh
        self._tally.last = found
        pipeline.adviser.see(answer.stack.images[0], found.count)
        pipeline.shortfall.see(found)
        lines = pipeline.shortfall.line, *pipeline.adviser.lines
        self._tally.advice = '; '.join(filter(None, lines))
        if clouds := self._clouds:
            clouds.locate(message)
        for form in self._wanted:
            types, publisher = self._forms[form.topic]
            publisher.publish(form.made(message, types))
        if self._undistorted:
            self._undistorted.publish(message, found)
        if self._annotations.get_subscription_count():
            self._annotations.publish(target_annotations(message))
        if self._debug_image.get_subscription_count():
            drawn = draw(answer.image, found)
            self._debug_image.publish(image_message(drawn, message.header))
        if self._filtered_image.get_subscription_count():
            filtered = pipeline.filtered(answer)
            self._filtered_image.publish(image_message(filtered, message.header))
        stages.end('other topics')
        stages.spent[SEARCH] = pipeline.stream.searched
        self._tally.times = stages.added(self._tally.times)
