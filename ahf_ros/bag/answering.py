"""From a recorded image to the messages about it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from rosbags.interfaces import Connection

from ahf_ros import ending
from ahf_ros.bag.definitions import (
    CODED_TARGETS,
    COMPRESSED_IMAGE,
    IMAGE,
    message_types,
    typestore,
)
from ahf_ros.bag.journal import Entry, Output
from ahf_ros.bag.source import Source
from ahf_ros.detectors import create_detector
from ahf_ros.detectors.contract import Unavailable
from ahf_ros.drawing.overlay import draw
from ahf_ros.imaging.image import check_image
from ahf_ros.interchange.image_messages import decode_compressed, decode_image, nanoseconds
from ahf_ros.interchange.target_messages import coded_target_array
from ahf_ros.sequence import Gathered, Window, identify_parts
from ahf_ros.session import create_identifier
from ahf_ros.session_settings import IdentificationSettings, StackSettings
from ahf_ros.target import Identification
from ahf_ros.text import printable, reason_of

_REASON = 2000  # characters of why an image is refused

DECODERS = {IMAGE: decode_image, COMPRESSED_IMAGE: decode_compressed}


@dataclass(frozen=True, slots=True)
class AnswerTopics:
    """Where the answers to the images of a topic go.

    Attributes
    ----------
    targets : str
        Topic of the coded targets.
    debug_image : str
        Topic of the annotated images; empty where there are none.
    """

    targets: str
    debug_image: str

    @property
    def types(self) -> dict[str, str]:
        """The topics and their types."""
        types = {self.targets: CODED_TARGETS}
        return types | {self.debug_image: COMPRESSED_IMAGE} if self.debug_image else types


@dataclass(frozen=True, slots=True, eq=False)
class _Held:
    """A decoded image that belongs to a stack."""

    header: Any
    image: np.ndarray


class Answering:
    """Identifies the images of each topic as a node of its own would.

    A stack is answered with the header of its last image.

    Parameters
    ----------
    source : Source
        That the images come from.
    topics : mapping of str to AnswerTopics
        By the topic of the images.
    settings : IdentificationSettings
    stacking : StackSettings
        Which images are identified together.
    """

    def __init__(
        self,
        source: Source,
        topics: Mapping[str, AnswerTopics],
        settings: IdentificationSettings,
        stacking: StackSettings,
    ) -> None:
        detector = create_detector(settings.detector, settings=settings.detection)
        self._source = source
        self._topics = topics
        self._family = detector.family
        self._identifiers = {
            topic: create_identifier(detector=detector, settings=settings, interrupt=ending.check)
            for topic in topics
        }
        self._stacking = stacking
        self._windows: dict[str, Window[_Held]] = {topic: Window(stacking) for topic in topics}
        self._store = typestore()
        self._types = message_types(self._store)

    def answer(
        self, connection: Connection, timestamp: int, data: bytes, last: bool
    ) -> tuple[Entry, list[Output]]:
        """Return what becomes of an image, and the messages about it.

        Parameters
        ----------
        connection : rosbags.interfaces.Connection
        timestamp : int
            Time of recording, ns.
        data : bytes
            The message.
        last : bool
            Whether no image follows; then all stacks end.
        """
        topic = connection.topic
        answers: list[Output] = []
        reasons: list[str] = []
        notes: list[str] = []
        gathered: list[tuple[str, Gathered[_Held]]] = []
        with _refused(reasons):
            gathered = [(topic, stack) for stack in self._add(connection, data)]
        if last:
            for name, window in self._windows.items():
                gathered += [(name, stack) for stack in window.end('no image follows')]
        for name, stack in gathered:
            if stack.reason:
                notes.append(f'a stack of {stack.reason}')
            with _refused(reasons):
                answers += self._messages(name, stack, notes)
        memory = self._identifiers[topic].memory
        return Entry(topic, timestamp, memory, '; '.join(reasons), '; '.join(notes)), answers

    def resume(self, entry: Entry, connection: Connection, data: bytes) -> None:
        """Go on as if an image had just been answered."""
        self._identifiers[entry.topic].memory = entry.memory
        if self._stacking.stack > 1:
            with _refused([]):
                self._add(connection, data)

    def _add(self, connection: Connection, data: bytes) -> list[Gathered[_Held]]:
        """Add an image to the window of its topic, and return the stacks that this completes."""
        received = self._source.deserialize(connection, data)
        image = DECODERS[connection.msgtype](received)
        if self._stacking.stack > 1:
            check_image(image)
        height, width = image.shape
        coding = getattr(received, 'encoding', '') or received.format
        header = self._header(received)
        window = self._windows[connection.topic]
        kind = f'{width} x {height} px, {coding}'
        return window.add(_Held(header, image), kind, nanoseconds(header))

    def _messages(self, topic: str, gathered: Gathered[_Held], notes: list[str]) -> list[Output]:
        """Return the messages about a stack, and note where it was split."""
        answers: list[Output] = []
        images = [held.image for held in gathered.items]
        parts = identify_parts(
            self._identifiers[topic], images, self._stacking, fresh=gathered.fresh
        )
        for part, stack, identified in parts:
            if part.split:
                notes.append(f'a stack is split: {part.split}')
            # Without the duration, runs are byte-identical.
            found = replace(identified, filter=replace(identified.filter, duration=0.0))
            header = gathered.items[part.images[-1]].header
            message = coded_target_array(found, self._family, stack.shape, header, self._types)
            topics = self._topics[topic]
            answers.append(self._serialized(topics.targets, CODED_TARGETS, message))
            if topics.debug_image:
                drawn = self._drawn(stack.combined(found.combination), found, header)
                answers.append(self._serialized(topics.debug_image, COMPRESSED_IMAGE, drawn))
        return answers

    def _serialized(self, topic: str, kind: str, message: Any) -> Output:
        return topic, bytes(self._store.serialize_cdr(message, kind))

    def _header(self, received: Any) -> Any:
        """Return the header of an image, which in ROS 1 has one more field."""
        types = self._store.types
        stamp = received.header.stamp
        time = types['builtin_interfaces/msg/Time'](sec=stamp.sec, nanosec=stamp.nanosec)
        frame = received.header.frame_id
        return types['std_msgs/msg/Header'](stamp=time, frame_id=frame)

    def _drawn(self, image: np.ndarray, found: Identification, header: Any) -> Any:
        _, encoded = cv2.imencode('.jpg', draw(image, found))
        return self._store.types[COMPRESSED_IMAGE](
            header=header, format='bgr8; jpeg compressed bgr8', data=encoded.ravel()
        )


@contextmanager
def _refused(reasons: list[str]) -> Iterator[None]:
    """Note why an image or a stack is refused, whatever it does to a detector."""
    try:
        yield
    except Unavailable:
        raise  # it is not the fault of the image; another run may find the detector
    except ValueError as error:
        reasons.append(printable(str(error), _REASON))
    except Exception as error:
        reasons.append(reason_of(error))
