"""Identification of all images of a bag, into a copy of the bag with the results.

First, the results of all images are written to a journal in the place of the new bag
(`ahf_ros.bag.journal`). Then the bag is written in one pass, at the speed of the disk, and
replaces the journal. A run that was killed continues where it stopped.
"""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import WriterError

from ahf_ros import ending
from ahf_ros.bag.answering import Answering, AnswerTopics
from ahf_ros.bag.assembly import (
    TASK_KEY,
    Outcome,
    assemble,
    check_entry,
    finished,
    remove_assembled,
)
from ahf_ros.bag.folder import MALFORMED
from ahf_ros.bag.journal import PROGRESS, Entry, Journal, begin, custom_data, remove_parts
from ahf_ros.bag.records import Message, seconds
from ahf_ros.bag.source import Source
from ahf_ros.interchange.files import locked
from ahf_ros.session_settings import IdentificationSettings, StackSettings
from ahf_ros.settings.parameter import parameters

WRITING_ERRORS = (OSError, sqlite3.Error, WriterError)
"""Errors of writing a bag, such as a full disk or a folder without permission."""

Report = Callable[[int, int, str], None]
"""Called after each image with the number of finished images, the number of all images or 0 if
unknown, and what there is to say about this image or its stack, empty if there is nothing."""

_FORMAT = 2  # version of the journal and of the data stored in a bag
_TOPIC_NAME = re.compile(r'/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*', re.ASCII)
_OF_STACKS = tuple(item.name for item in parameters(StackSettings))
_IRRELEVANT = ('source', 'target', 'threads', 'patience')  # settings that do not change the bag


@dataclass(frozen=True, slots=True)
class BagTask:
    """Task of `answer_bag`.

    Attributes
    ----------
    source : Path
        The bag with the images.
    target : Path
        The bag to write.
    topics : tuple of str
        Topics of the images; all if empty.
    output_topic : str
        Topic of the results; without a leading slash, relative to the topic of the images.
    storage : str
        One of `ahf_ros.bag.writing.STORAGES`.
    debug_images : bool
        Whether to write annotated images, as JPEG.
    identification : IdentificationSettings
        Settings of the identification.
    stacking : StackSettings
        Which images are identified together.
    patience : float
        Time to wait for another process that writes the bag, s.
    """

    source: Path
    target: Path
    topics: tuple[str, ...] = ()
    output_topic: str = 'coded_targets'
    storage: str = 'mcap'
    debug_images: bool = False
    identification: IdentificationSettings = field(default_factory=IdentificationSettings)
    stacking: StackSettings = field(default_factory=StackSettings)
    patience: float = 0.0


def answer_bag(task: BagTask, report: Report) -> Outcome:
    """Identify the targets of all images in a bag, or continue an interrupted run.

    Parameters
    ----------
    task : BagTask
    report : callable
        Called after each image, also for images of an earlier run.

    Returns
    -------
    Outcome
        Equal for equal tasks, as is the bag, byte for byte, however often the run was
        interrupted.

    Raises
    ------
    ValueError
        If the bag cannot be read or lacks a topic, or if the target exists and is not from the
        same task.
    """
    with Source(task.source) as source:
        topics = _answer_topics(task, source)
        origin = _origin(task, source, topics)
        if not task.target.exists():
            types = {name: kind for to in topics.values() for name, kind in to.types.items()}
            begin(task.target, types, json.dumps(origin))
        with locked(task.target, task.patience):
            _check_target(task.target, origin)
            outcome = finished(task.target) or _made(task, source, topics, report)
            _tidy(task.target)
    return outcome


def _made(
    task: BagTask, source: Source, topics: dict[str, AnswerTopics], report: Report
) -> Outcome:
    """Write the journal, then the bag."""
    journal = Journal(task.target)
    _answer_images(task, source, topics, journal, report)
    return assemble(source, task.target, topics, journal, task.storage)


def _answer_topics(task: BagTask, source: Source) -> dict[str, AnswerTopics]:
    """Return the topics of the results by topic of the images."""
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
        name = task.output_topic
        targets = name if name.startswith('/') else f'{image}/{name}'
        debug_image = f'{targets}/debug_image/compressed' if task.debug_images else ''
        topics[image] = AnswerTopics(targets, debug_image)
    taken = {item.topic for item in source.connections} | {PROGRESS}
    for name in (name for to in topics.values() for name in to.types):
        if name in taken:
            has = f'{task.source} has' if name != PROGRESS else 'ahf bag needs'
            raise ValueError(f'{has} a topic {name}, accepted is another output_topic')
    return topics


def _origin(task: BagTask, source: Source, topics: dict[str, AnswerTopics]) -> dict[str, Any]:
    """Return everything that the results depend on."""
    origin = _flat(asdict(task))
    irrelevant = _IRRELEVANT if task.stacking.stack > 1 else (*_IRRELEVANT, *_OF_STACKS)
    origin = {name: value for name, value in origin.items() if name not in irrelevant}
    origin |= {'topics': list(topics), 'size of the bag': source.size(), 'format': _FORMAT}
    return origin


def _flat(values: dict[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value) if isinstance(value, dict) else {name: value}
    return flat


def _check_target(target: Path, origin: dict[str, Any]) -> None:
    """Raise a ValueError unless a bag was begun with the same task."""
    before: dict[str, Any] = {}
    with suppress(*MALFORMED):
        before = dict(json.loads(custom_data(target).get(TASK_KEY, '{}')))
    if not before:
        raise ValueError(f'{target} exists, accepted is a new name or a bag that was begun here')
    for name in before | origin:
        if before.get(name) != origin.get(name):
            raise ValueError(
                f'{target} was begun with {name} {before.get(name)!r}, now it is '
                f'{origin.get(name)!r}; accepted is the same value, or another name for the bag'
            )


def _answer_images(
    task: BagTask,
    source: Source,
    topics: dict[str, AnswerTopics],
    journal: Journal,
    report: Report,
) -> None:
    """Identify the images that are not in the journal yet."""
    answering = Answering(source, topics, task.identification, task.stacking)
    total = sum(item.msgcount for item in source.connections if item.topic in topics)
    earlier = list(journal.entries)
    for number, (message, last) in enumerate(_with_last(source.messages(topics))):
        connection, timestamp, data = message
        if number < len(earlier):
            entry = earlier[number]
            check_entry(source, task.target, entry, connection.topic, timestamp)
            answering.resume(entry, connection, data)
        else:
            entry, answers = answering.answer(connection, timestamp, data, last)
            ending.check()  # the answer may be that of a program that was ended
            journal.append(entry, answers)
        report(number + 1, total, _remark(entry))


def _with_last(messages: Iterable[Message]) -> Iterator[tuple[Message, bool]]:
    """Yield messages, and whether each is the last one."""
    before: Message | None = None
    for message in messages:
        if before is not None:
            yield before, False
        before = message
    if before is not None:
        yield before, True


def _remark(entry: Entry) -> str:
    """Return what there is to say about an image; empty if there is nothing."""
    said = '; '.join(filter(None, (entry.reason, entry.note)))
    return f'{entry.topic} at {seconds(entry.timestamp)} s: {said}' if said else ''


def _tidy(target: Path) -> None:
    """Remove the temporary files of a finished bag."""
    remove_assembled(target)
    remove_parts(target)
