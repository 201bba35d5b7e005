"""From a bag with images to a bag that holds the answers beside everything else.

First all images are answered, one after the other, into a journal in the place of the bag
(`ahf_ros.bag.journal`). Then the bag is written in one go, at the speed of the disk, and takes
the place of the journal. What is killed on the way goes on from there.
"""

from __future__ import annotations

import fcntl
import json
import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import WriterError

from ahf_ros.bag.answering import Answering, AnswerTopics
from ahf_ros.bag.assembly import (
    TASK_KEY,
    Outcome,
    assemble,
    check_entry,
    finished,
    remove_assembled,
)
from ahf_ros.bag.journal import PROGRESS, Entry, Journal, begin, custom_data, remove_parts
from ahf_ros.bag.records import seconds
from ahf_ros.bag.source import Source
from ahf_ros.session import IdentificationSettings

WRITING_ERRORS = (OSError, sqlite3.Error, WriterError)
"""What it means when a bag cannot be written: a full disk, a folder of somebody else."""

Report = Callable[[int, int, str], None]
"""Gets the number of images that are done and that there are, 0 where unknown, and why the last
one was refused, empty where it was not."""

_FORMAT = 2  # of the journal and of what is kept in a bag
_IRRELEVANT = ('source', 'target', 'threads')  # to what is in the bag


@dataclass(frozen=True, slots=True)
class BagTask:
    """What is to be done.

    Attributes
    ----------
    source : Path
        The bag with the images.
    target : Path
        The bag that is to be made.
    topics : tuple of str
        The topics of the images, all where empty.
    output_topic : str
        Topic of the answers; one without a slash at the beginning is below that of the images.
    storage : str
        One of `ahf_ros.bag.writing.STORAGES`.
    debug_images : bool
        Whether annotated images are written, as JPEG.
    identification : IdentificationSettings
    """

    source: Path
    target: Path
    topics: tuple[str, ...] = ()
    output_topic: str = 'coded_targets'
    storage: str = 'mcap'
    debug_images: bool = False
    identification: IdentificationSettings = field(default_factory=IdentificationSettings)


def answer_bag(task: BagTask, report: Report) -> Outcome:
    """Identify the targets of all images in a bag, or go on with it.

    Parameters
    ----------
    task : BagTask
    report : callable
        Told of every image, also of those that an earlier run has answered.

    Returns
    -------
    Outcome
        The same, and the same bag byte for byte, for every run with the same task, however often
        it was broken off.

    Raises
    ------
    ValueError
        If the bag cannot be read, has no such topics, or the target is something else already.
    """
    with Source(task.source) as source:
        topics = _answer_topics(task, source)
        told = _told(task, source, topics)
        if not task.target.exists():
            types = {name: kind for to in topics.values() for name, kind in to.types.items()}
            begin(task.target, types, json.dumps(told))
        with locked(task.target):
            _check_target(task.target, told)
            outcome = finished(task.target) or _made(task, source, topics, report)
            _tidy(task.target)
    return outcome


def _made(
    task: BagTask, source: Source, topics: dict[str, AnswerTopics], report: Report
) -> Outcome:
    """Make the bag from its journal."""
    journal = Journal(task.target)
    _answer_images(task, source, topics, journal, report)
    return assemble(source, task.target, topics, journal, task.storage)


@contextmanager
def locked(target: Path) -> Iterator[None]:
    """Keep other processes from a bag; whatever ends this one ends that, too."""
    descriptor = os.open(target, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError as error:
        raise ValueError(f'{target} is being written by another process') from error
    finally:
        os.close(descriptor)


def _answer_topics(task: BagTask, source: Source) -> dict[str, AnswerTopics]:
    """Return where the answers go, by the topic of the images."""
    images = source.image_topics(task.topics)
    if task.output_topic.startswith('/') and len(images) > 1:
        raise ValueError(
            f'output_topic is {task.output_topic}, accepted for several topics of images '
            f'({", ".join(images)}) is a name without a slash at the beginning'
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


def _told(task: BagTask, source: Source, topics: dict[str, AnswerTopics]) -> dict[str, Any]:
    """Return everything that the answers depend on."""
    told = _flat(asdict(task))
    told = {name: value for name, value in told.items() if name not in _IRRELEVANT}
    told |= {'topics': list(topics), 'size of the bag': source.size(), 'format': _FORMAT}
    return told


def _flat(values: dict[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value) if isinstance(value, dict) else {name: value}
    return flat


def _check_target(target: Path, told: dict[str, Any]) -> None:
    """Refuse what is there unless it is a bag that was begun with the same task."""
    begun = custom_data(target).get(TASK_KEY)
    if begun is None:
        raise ValueError(f'{target} exists, accepted is a new name or a bag that was begun here')
    before = json.loads(begun)
    for name in before | told:
        if before.get(name) != told.get(name):
            raise ValueError(
                f'{target} was begun with {name} {before.get(name)!r}, now it is '
                f'{told.get(name)!r}; accepted is the same, or another name for the bag'
            )


def _answer_images(
    task: BagTask,
    source: Source,
    topics: dict[str, AnswerTopics],
    journal: Journal,
    report: Report,
) -> None:
    """Answer the images that are not answered yet."""
    answering = Answering(source, topics, task.identification)
    total = sum(item.msgcount for item in source.connections if item.topic in topics)
    earlier = list(journal.entries)
    for number, (connection, timestamp, data) in enumerate(source.messages(topics)):
        if number < len(earlier):
            entry = earlier[number]
            check_entry(source, task.target, entry, connection.topic, timestamp)
            answering.resume(entry)
        else:
            entry, answers = answering.answer(connection, timestamp, data)
            journal.append(entry, answers)
        report(number + 1, total, _refusal(entry))


def _refusal(entry: Entry) -> str:
    if not entry.reason:
        return ''
    return f'{entry.topic} at {seconds(entry.timestamp)} s: {entry.reason}'


def _tidy(target: Path) -> None:
    """Remove what is left of the way to a bag that is done."""
    remove_assembled(target)
    remove_parts(target)
