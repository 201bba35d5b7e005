"""Identification of all images of a bag, into a copy of the bag with the results.

First, the results of all images are written to a journal in the folder of the new bag
(`ahf_ros.bag.output`). Then the bag is written in one pass, at the speed of the disk, and
replaces the journal. A run that was killed continues where it stopped.
"""

import json
import re
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
from rosbags.rosbag2 import WriterError

from ahf_ros.bag.definitions import CODED_TARGETS, COMPRESSED_IMAGE, message_types, typestore
from ahf_ros.bag.mcap_records import seconds
from ahf_ros.bag.output import (
    JOURNAL,
    AnswerTopics,
    Entry,
    Journal,
    Outcome,
    Output,
    answer_topic,
    begin,
    begun_with,
    check_entry,
    finished,
    remove_unfinished,
    write_bag,
)
from ahf_ros.bag.registration import RegistrationTask, check_registration
from ahf_ros.bag.source import METADATA, Message, Source
from ahf_ros.base import ending
from ahf_ros.base.opening import parsing
from ahf_ros.base.settings.nested import flat_values
from ahf_ros.base.writing import locked
from ahf_ros.families import create_detector
from ahf_ros.families.contract import Unavailable
from ahf_ros.files.target_messages import coded_target_array, unanswered
from ahf_ros.identification.session_settings import IdentificationSettings, StackSettings
from ahf_ros.identification.settling import settled_families
from ahf_ros.identification.stream import (
    STATUS,
    Answer,
    Frame,
    Kind,
    Remark,
    Stream,
    message_frame,
    why_failed,
)
from ahf_ros.views.drawing.overlay import draw

WRITING_ERRORS = (OSError, sqlite3.Error, WriterError)
"""Errors of writing a bag, such as a full disk or a folder without permission."""

Report = Callable[[int, int, str], None]
"""Called after each image with the number of finished images, the number of all images or 0 if
unknown, and what there is to say about this image or its stack, empty if there is nothing."""

_FORMAT = 8  # version of the journal and of the data stored in a bag
_TOPIC_NAME = re.compile(r'/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*', re.ASCII)
_ADDRESS = re.compile('[?#%]')  # rosbags opens SQLite files by an address


@dataclass(frozen=True, slots=True)
class BagTask:
    """Task of `answer_bag`."""

    source: Path  # the bag with the images
    output: Path  # the bag to write
    topics: tuple[str, ...] = ()  # of the images; all if empty
    output_topic: str = (
        'coded_targets'  # relative to the topic of the images unless it begins with /
    )
    storage: str = 'mcap'  # or 'sqlite3'
    debug_images: bool = False  # whether to write annotated images, as JPEG
    identification: IdentificationSettings = field(default_factory=IdentificationSettings)
    stacking: StackSettings = field(default_factory=StackSettings)
    registration: RegistrationTask | None = None  # for `register_bag`, once all is answered
    lock_timeout: float = 0.0  # time to wait for another process that writes the bag, s


def answer_bag(task: BagTask, report: Report) -> Outcome:
    """Identify the targets of all images in a bag, or continue an interrupted run.

    The outcome is equal for equal tasks, as is the bag, byte for byte, however often the run was
    interrupted. `report` is called after each image, also for images of an earlier run.

    Raises
    ------
    ValueError
        If the bag cannot be read or lacks a topic, or if the output exists and is not from the
        same task.
    """
    if task.storage == 'sqlite3' and _ADDRESS.search(str(task.output)):
        raise ValueError(
            f'output is {task.output}, accepted with storage sqlite3 is a path without ?, # and %'
        )
    _check_outside(task.source, 'recording', 'output', task.output)
    if task.registration:
        _check_outside(task.source, 'recording', 'register', task.registration.folder)
        _check_outside(task.output, 'new bag', 'register', task.registration.folder)
    with Source(task.source) as source:
        topics = _answer_topics(task, source)
        if task.registration:
            check_registration(task.registration, source, topics)
        origin = _origin(task, source, topics)
        task.output.mkdir(parents=True, exist_ok=True)
        with locked(task.output, task.lock_timeout):
            _begin(task.output, origin)
            outcome = finished(task.output)
            if outcome is None:
                with closing(Journal(task.output)) as journal:
                    _answer_images(task, source, topics, journal, report)
                    outcome = write_bag(
                        source, task.output, topics, journal, task.storage, json.dumps(origin)
                    )
            remove_unfinished(task.output)
    return outcome


def _check_outside(bag: Path, kind: str, name: str, output: Path) -> None:
    """Refuse an output in the folder of a bag, which would become part of it."""
    folder = bag.resolve()
    if folder.is_file():
        folder = folder.parent
        if not (folder / METADATA).exists():
            return
    if output.resolve().is_relative_to(folder):
        raise ValueError(
            f'{name} is {output}, which is in the {kind} {folder}; accepted is another folder'
        )


def _answer_topics(task: BagTask, source: Source) -> dict[str, AnswerTopics]:
    if not _TOPIC_NAME.fullmatch(task.output_topic):
        raise ValueError(
            f'output_topic is {task.output_topic!r}, accepted are names of letters, digits and _, '
            'none of which starts with a digit, separated by /'
        )
    images = source.image_topics(task.topics)
    if task.output_topic.startswith('/') and len(images) > 1:
        raise ValueError(
            f'output_topic is {task.output_topic}, accepted for several image topics '
            f'({", ".join(images)}) is a name without a leading slash'
        )
    topics = {}
    for image in images:
        targets = answer_topic(image, task.output_topic)
        debug_image = f'{targets}/debug_image/compressed' if task.debug_images else ''
        topics[image] = AnswerTopics(targets, debug_image)
    taken = {item.topic for item in source.connections}
    for name in (name for to in topics.values() for name in to.types):
        if name in taken:
            raise ValueError(f'{task.source} has a topic {name}, accepted is another output_topic')
    return topics


def _origin(task: BagTask, source: Source, topics: dict[str, AnswerTopics]) -> dict[str, Any]:
    """Return everything that the results depend on."""
    origin = {
        'topics': list(topics),
        'output_topic': task.output_topic,
        'storage': task.storage,
        'debug_images': task.debug_images,
        **flat_values(task.identification),
        **(flat_values(task.stacking) if task.stacking.stack > 1 else {}),
        'size of the bag': source.size(),
        'format': _FORMAT,
    }
    del origin['threads']  # which does not change the bag
    return origin


def _begin(output: Path, origin: dict[str, Any]) -> None:
    """Begin a bag, or raise a ValueError unless it was begun with the same task."""
    begun = begun_with(output)
    if not begun:
        if any(not it.name.startswith(JOURNAL) for it in output.iterdir()):
            raise ValueError(
                f'{output} exists, accepted is a new name or a bag that was begun here'
            )
        begin(output, json.dumps(origin))
        return
    with parsing(output, 'what this version has begun'):
        before = dict(json.loads(begun))
    for name in before | origin:
        if before.get(name) != origin.get(name):
            raise ValueError(
                f'{output} was begun with {name} {before.get(name)!r}, now it is '
                f'{origin.get(name)!r}; accepted is the same value, or another name for the bag'
            )


def _answer_images(
    task: BagTask,
    source: Source,
    topics: Mapping[str, AnswerTopics],
    journal: Journal,
    report: Report,
) -> None:
    """Identify the images that are not in the journal yet."""
    answering = _Answering(task, source, topics)
    total = sum(item.msgcount for item in source.connections if item.topic in topics)
    if not source.checked:
        report(0, total, 'chunks have no checksums, so that damage in them may not be noticed')
    earlier = list(journal.entries)
    last_of = {entry.topic: number for number, entry in enumerate(earlier)}
    settled: dict[str, tuple[str, ...]] = {}  # families by topic
    for number, (message, last) in enumerate(_with_last(source.messages(topics))):
        if number < len(earlier):
            entry = earlier[number]
            connection, timestamp, _ = message
            check_entry(source, task.output, entry, connection.topic, timestamp)
            if number == last_of[entry.topic]:
                with parsing(task.output / JOURNAL, 'what this version has begun'):
                    seen = journal.seen(entry.topic)
                entry = replace(entry, memory=replace(entry.memory, seen=seen))
            answering.resume(entry, message)
        else:
            entry, outputs = answering.answer(message, last)
            ending.check()  # the answer may be that of a program that was ended
            journal.append(entry, outputs)
        families = settled_families(entry.memory, settled.get(entry.topic, ()))
        settled[entry.topic] = entry.memory.families
        said = '; '.join(filter(None, (entry.reason, entry.note, families)))
        about = f'{entry.topic} at {seconds(entry.timestamp)} s: {said}' if said else ''
        report(number + 1, total, about)


def _with_last(messages: Iterable[Message]) -> Iterator[tuple[Message, bool]]:
    """Yield messages, and whether each is the last one."""
    before: Message | None = None
    for message in messages:
        if before is not None:
            yield before, False
        before = message
    if before is not None:
        yield before, True


class _Answering:
    """Identifies the images of each topic as a node of its own would.

    A stack is answered with the header of its last image.
    """

    def __init__(self, task: BagTask, source: Source, topics: Mapping[str, AnswerTopics]) -> None:
        settings = task.identification
        detector = create_detector(settings.detector, settings=settings.detection)
        self._source = source
        self._topics = topics
        self._family = detector.family
        # Without durations, runs are byte-identical.
        self._streams: dict[str, Stream[Any]] = {
            topic: Stream(settings, task.stacking, detector, timed=False, interrupt=ending.check)
            for topic in topics
        }
        self._store = typestore()
        self._types = message_types(self._store)

    def answer(self, message: Message, last: bool) -> tuple[Entry, list[Output]]:
        """Return what becomes of an image, and the messages about it; the last ends all stacks."""
        connection, timestamp, _ = message
        topic = connection.topic
        said = [(topic, it) for it in self._streams[topic].add(lambda: self._frame(message))]
        if last:
            for name, stream in self._streams.items():
                said += [(name, it) for it in stream.end('no image follows')]
        outputs: list[Output] = []
        remarks: list[Remark] = []
        for name, it in said:
            if isinstance(it, Remark):
                if isinstance(it.error, Unavailable):
                    raise it.error
                remarks.append(it)
                outputs += self._refusals(self._topics[name], it, message)
                continue
            try:
                outputs += list(self._messages(self._topics[name], it))
            except Exception as error:
                remarks.append(why_failed(error, ()))
        entry = Entry(
            topic=topic,
            timestamp=timestamp,
            memory=self._streams[topic].memory,
            reason='; '.join(it.text for it in remarks if it.kind in STATUS),
            note='; '.join(it.text for it in remarks if it.kind not in STATUS),
            damaged=any(it.kind == Kind.DAMAGED for it in remarks),
        )
        return entry, outputs

    def resume(self, entry: Entry, message: Message) -> None:
        """Go on as if an image had just been answered."""
        self._streams[entry.topic].resume(entry.memory, lambda: self._frame(message))

    def _frame(self, message: Message) -> Frame[Any]:
        return message_frame(self._sent(message))

    def _sent(self, message: Message) -> Any:
        connection, _, data = message
        return self._source.stores.deserialize(connection, data)

    def _refusals(
        self, topics: AnswerTopics, remark: Remark, message: Message
    ) -> Iterator[Output]:
        """Yield answers to the images that a remark is about, if they get no other.

        An image that was not read is that of the message; what is no message, or one of a type
        without a header, gets none.
        """
        headers = remark.items
        if remark.kind == Kind.REFUSED and not headers:
            with suppress(ValueError):
                sent = self._sent(message)
                headers = (sent.header,) if hasattr(sent, 'header') else ()
        for header in headers:
            status, family = STATUS[remark.kind], self._family
            yield self._output(
                topics, unanswered(status, remark.text, family, header, self._types)
            )

    def _output(self, topics: AnswerTopics, answer: Any) -> Output:
        return topics.targets, bytes(self._store.serialize_cdr(answer, CODED_TARGETS))

    def _messages(self, topics: AnswerTopics, answer: Answer[Any]) -> Iterator[Output]:
        header, found = answer.items[-1], answer.identification
        message = coded_target_array(
            found,
            self._family,
            answer.stack.shape,
            header,
            self._types,
            reason=answer.note,
            settled=answer.settled,
        )
        yield self._output(topics, message)
        if topics.debug_image:
            _, encoded = cv2.imencode('.jpg', draw(answer.image, found))
            drawn = self._store.types[COMPRESSED_IMAGE](
                header=header, format='bgr8; jpeg compressed bgr8', data=encoded.ravel()
            )
            yield topics.debug_image, bytes(self._store.serialize_cdr(drawn, COMPRESSED_IMAGE))
