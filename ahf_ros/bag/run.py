"""Identification of all images of a bag, into a copy of the bag with the results.

First, the results of all images are written to a journal in the folder of the new bag
(`ahf_ros.bag.journal`). Then the bag is written in one pass, at the speed of the disk, and
replaces the journal. A run that was killed continues where it stopped.
"""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import WriterError

from ahf_ros import ending
from ahf_ros.bag import journal as journals
from ahf_ros.bag.answering import Answering, AnswerTopics
from ahf_ros.bag.assembly import (
    TASK_KEY,
    Outcome,
    assemble,
    check_entry,
    custom_data,
    finished,
    remove_assembled,
)
from ahf_ros.bag.journal import Entry, Journal
from ahf_ros.bag.source import Message, Source, seconds
from ahf_ros.interchange.files import locked
from ahf_ros.session_settings import IdentificationSettings, StackSettings
from ahf_ros.settings.parameter import parameters

WRITING_ERRORS = (OSError, sqlite3.Error, WriterError)
"""Errors of writing a bag, such as a full disk or a folder without permission."""

Report = Callable[[int, int, str], None]
"""Called after each image with the number of finished images, the number of all images or 0 if
unknown, and what there is to say about this image or its stack, empty if there is nothing."""

_FORMAT = 3  # version of the journal and of the data stored in a bag
_TOPIC_NAME = re.compile(r'/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*', re.ASCII)
_ADDRESS = re.compile('[?#%]')  # rosbags opens SQLite files by an address
_OF_STACKS = tuple(item.name for item in parameters(StackSettings))
_IRRELEVANT = (
    'source',
    'output',
    'threads',
    'lock_timeout',
)  # settings that do not change the bag


@dataclass(frozen=True, slots=True)
class BagTask:
    """Task of `answer_bag`.

    Attributes
    ----------
    source : Path
        The bag with the images.
    output : Path
        The bag to write.
    topics : tuple of str
        Topics of the images; all if empty.
    output_topic : str
        Topic of the results; without a leading slash, relative to the topic of the images.
    storage : str
        One of `ahf_ros.bag.assembly.STORAGES`.
    debug_images : bool
        Whether to write annotated images, as JPEG.
    identification : IdentificationSettings
        Settings of the identification.
    stacking : StackSettings
        Which images are identified together.
    lock_timeout : float
        Time to wait for another process that writes the bag, s.
    """

    source: Path
    output: Path
    topics: tuple[str, ...] = ()
    output_topic: str = 'coded_targets'
    storage: str = 'mcap'
    debug_images: bool = False
    identification: IdentificationSettings = field(default_factory=IdentificationSettings)
    stacking: StackSettings = field(default_factory=StackSettings)
    lock_timeout: float = 0.0


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
        If the bag cannot be read or lacks a topic, or if the output exists and is not from the
        same task.
    """
    if task.storage == 'sqlite3' and _ADDRESS.search(str(task.output)):
        raise ValueError(
            f'output is {task.output}, accepted with storage sqlite3 is a path without ?, # and %'
        )
    with Source(task.source) as source:
        topics = _answer_topics(task, source)
        origin = _origin(task, source, topics)
        task.output.mkdir(parents=True, exist_ok=True)
        with locked(task.output, task.lock_timeout):
            _begin(task.output, origin)
            outcome = finished(task.output) or _made(task, source, topics, origin, report)
            remove_assembled(task.output)
            journals.remove(task.output)
    return outcome


def _made(
    task: BagTask,
    source: Source,
    topics: dict[str, AnswerTopics],
    origin: dict[str, Any],
    report: Report,
) -> Outcome:
    """Complete the journal, then write the bag."""
    with closing(Journal(task.output)) as journal:
        _answer_images(task, source, topics, journal, report)
        return assemble(source, task.output, topics, journal, task.storage, json.dumps(origin))


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
    taken = {item.topic for item in source.connections}
    for name in (name for to in topics.values() for name in to.types):
        if name in taken:
            raise ValueError(f'{task.source} has a topic {name}, accepted is another output_topic')
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


def _begin(output: Path, origin: dict[str, Any]) -> None:
    """Begin a bag, or raise a ValueError unless it was begun with the same task."""
    begun = journals.begun_with(output) or custom_data(output).get(TASK_KEY)
    if begun is None:
        if any(not it.name.startswith(journals.NAME) for it in output.iterdir()):
            raise ValueError(
                f'{output} exists, accepted is a new name or a bag that was begun here'
            )
        journals.begin(output, json.dumps(origin))
        return
    before = json.loads(begun)
    for name in before | origin:
        if before.get(name) != origin.get(name):
            raise ValueError(
                f'{output} was begun with {name} {before.get(name)!r}, now it is '
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
        if number < len(earlier):
            entry = earlier[number]
            connection, timestamp, _ = message
            check_entry(source, task.output, entry, connection.topic, timestamp)
            answering.resume(entry, message)
        else:
            entry, outputs = answering.answer(message, last)
            ending.check()  # the answer may be that of a program that was ended
            journal.append(entry, outputs)
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
