"""From a recorded image to the messages about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2

from ahf_ros import ending
from ahf_ros.bag.definitions import (
    CODED_TARGETS,
    COMPRESSED_IMAGE,
    message_types,
    typestore,
)
from ahf_ros.bag.journal import Entry, Output
from ahf_ros.bag.source import Message, Source
from ahf_ros.detectors import create_detector
from ahf_ros.drawing.overlay import draw
from ahf_ros.interchange.target_messages import coded_target_array
from ahf_ros.session_settings import IdentificationSettings, StackSettings
from ahf_ros.stream import Answer, Frame, Kind, Remark, Stream, message_frame, refusal


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

    A stack is answered with the header of its last image.

    Parameters
    ----------
    source : Source
        Where the images come from.
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
        # Without durations, runs are byte-identical.
        self._streams: dict[str, Stream[Any]] = {
            topic: Stream(settings, stacking, detector, timed=False, interrupt=ending.check)
            for topic in topics
        }
        self._store = typestore()
        self._types = message_types(self._store)

    def answer(self, message: Message, last: bool) -> tuple[Entry, list[Output]]:
        """Return what becomes of an image, and the messages about it.

        Parameters
        ----------
        message : Message
            The image.
        last : bool
            Whether no image follows; then all stacks end.
        """
        connection, timestamp, _ = message
        topic = connection.topic
        said = [(topic, it) for it in self._streams[topic].add(lambda: self._frame(message))]
        if last:
            for name, stream in self._streams.items():
                said += [(name, it) for it in stream.end('no image follows')]
        outputs: list[Output] = []
        remarks: list[Remark] = []
        for name, it in said:
            try:
                if isinstance(it, Remark):
                    remarks.append(it)
                else:
                    outputs += self._messages(self._topics[name], it)
            except Exception as error:
                remarks.append(refusal(error))
        entry = Entry(
            topic=topic,
            timestamp=timestamp,
            memory=self._streams[topic].memory,
            reason='; '.join(it.text for it in remarks if it.kind == Kind.REFUSED),
            note='; '.join(it.text for it in remarks if it.kind != Kind.REFUSED),
        )
        return entry, outputs

    def resume(self, entry: Entry, message: Message) -> None:
        """Go on as if an image had just been answered."""
        self._streams[entry.topic].resume(entry.memory, lambda: self._frame(message))

    def _frame(self, message: Message) -> Frame[Any]:
        """Return a decoded image with its header."""
        connection, _, data = message
        return message_frame(self._source.stores.deserialize(connection, data))

    def _messages(self, topics: AnswerTopics, answer: Answer[Any]) -> list[Output]:
        """Return the messages about an image or a stack."""
        header, found = answer.items[-1], answer.identification
        message = coded_target_array(found, self._family, answer.stack.shape, header, self._types)
        outputs = [self._serialized(topics.targets, CODED_TARGETS, message)]
        if topics.debug_image:
            _, encoded = cv2.imencode('.jpg', draw(answer.image, found))
            drawn = self._store.types[COMPRESSED_IMAGE](
                header=header, format='bgr8; jpeg compressed bgr8', data=encoded.ravel()
            )
            outputs.append(self._serialized(topics.debug_image, COMPRESSED_IMAGE, drawn))
        return outputs

    def _serialized(self, topic: str, kind: str, message: Any) -> Output:
        return topic, bytes(self._store.serialize_cdr(message, kind))
