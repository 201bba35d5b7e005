"""From a recorded image to the messages about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from rosbags.interfaces import Connection

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
from ahf_ros.drawing import draw
from ahf_ros.interchange.image_messages import decode_compressed, decode_image
from ahf_ros.interchange.target_messages import coded_target_array
from ahf_ros.session import IdentificationSettings, create_identifier
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


class Answering:
    """Identifies the images of each topic as a node of its own would.

    Parameters
    ----------
    source : Source
        That the images come from.
    topics : mapping of str to AnswerTopics
        By the topic of the images.
    settings : IdentificationSettings
    """

    def __init__(
        self,
        source: Source,
        topics: Mapping[str, AnswerTopics],
        settings: IdentificationSettings,
    ) -> None:
        detector = create_detector(settings.detector, settings.detection)
        self._source = source
        self._topics = topics
        self._family = detector.family
        self._identifiers = {topic: create_identifier(settings, detector) for topic in topics}
        self._store = typestore()
        self._types = message_types(self._store)

    def answer(
        self, connection: Connection, timestamp: int, data: bytes
    ) -> tuple[Entry, list[Output]]:
        """Return what becomes of an image, and the messages about it."""
        topic = connection.topic
        answers: list[Output] = []
        reason = ''
        try:
            answers = self._messages(connection, data)
        except Unavailable:
            raise  # it is not the fault of the image; another run may find the detector
        except ValueError as error:
            reason = printable(str(error), _REASON)
        except Exception as error:
            # The others go on, whatever an image does to a decoder or a detector.
            reason = reason_of(error)
        memory = self._identifiers[topic].memory
        return Entry(topic, timestamp, memory, reason), answers

    def resume(self, entry: Entry) -> None:
        """Go on as if an image had just been answered."""
        self._identifiers[entry.topic].memory = entry.memory

    def _messages(self, connection: Connection, data: bytes) -> list[Output]:
        received = self._source.deserialize(connection, data)
        image = DECODERS[connection.msgtype](received)
        found = self._identifiers[connection.topic].identify(image)
        # Without the duration, runs are byte-identical.
        found = replace(found, filter=replace(found.filter, duration=0.0))
        header = self._header(received)
        message = coded_target_array(found, self._family, image.shape, header, self._types)
        topics = self._topics[connection.topic]
        answers = [self._serialized(topics.targets, CODED_TARGETS, message)]
        if topics.debug_image:
            drawn = self._drawn(image, found, header)
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
