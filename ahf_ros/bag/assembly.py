"""The finished bag: its source and the answers, counted, in the place of the journal."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from ahf_ros.bag.answering import AnswerTopics
from ahf_ros.bag.copying import Copy
from ahf_ros.bag.definitions import typestore
from ahf_ros.bag.folder import MALFORMED, METADATA
from ahf_ros.bag.journal import Entry, Journal, Output, custom_data
from ahf_ros.bag.other_messages import NAME as OTHER_MESSAGES
from ahf_ros.bag.other_messages import OtherMessages, check_others
from ahf_ros.bag.source import Source, is_ros
from ahf_ros.bag.writing import BagWriter
from ahf_ros.text import reason_of

TASK_KEY = 'ahf_ros'
"""Under which a bag keeps what it was made from."""

OUTCOME_KEY = 'ahf_ros_outcome'
"""Under which a finished bag keeps what became of it."""

_ASSEMBLED = '.assembled'


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a bag.

    Attributes
    ----------
    images : int
        Number of images.
    refused : int
        Number of those that were not accepted.
    lost : tuple of str
        Messages that are missing, with topic and time where they are known.
    left_out : tuple of str
        What else of the source the new bag does not have.
    others : int
        Number of messages in `ahf_ros.bag.other_messages.NAME`, because a ROS 2 bag cannot hold
        them.
    """

    images: int
    refused: int
    lost: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    others: int = 0


def assemble(
    source: Source,
    target: Path,
    topics: Mapping[str, AnswerTopics],
    journal: Journal,
    storage: str,
) -> Outcome:
    """Write a bag from its source and the journal, and put it in the place of the journal.

    Parameters
    ----------
    source : Source
    target : Path
        The bag, until now a journal.
    topics : mapping of str to AnswerTopics
        By the topic of the images.
    journal : Journal
    storage : str
        One of `ahf_ros.bag.writing.STORAGES`.

    Raises
    ------
    ValueError
        If what was read is not what was answered before. The journal with all answers is left
        as it is then.
    """
    remove_assembled(target)
    bag = target / _ASSEMBLED / target.name
    kept = custom_data(target)[TASK_KEY]
    with BagWriter(bag, storage) as writer:
        for name, value in source.metadata.custom.items():
            writer.set_custom_data(name, value)
        writer.set_custom_data(TASK_KEY, kept)
        with OtherMessages(bag / OTHER_MESSAGES) as others:
            copy = Copy(source, writer, others)
            answers = _write(source, target, topics, journal, writer, copy)
        written = sum(writer.counts.values())
        if written != answers + copy.counts.total():
            raise ValueError(
                f'{target} would hold {written} messages, accepted are the '
                f'{copy.counts.total()} of {source.path} and {answers} answers'
            )
        refused = sum(bool(entry.reason) for entry in journal.entries)
        lost = (*source.lost, *copy.refused)
        left_out = (*others.described, *source.left_out)
        total = sum(others.counts.values())
        outcome = Outcome(len(journal.entries), refused, lost, left_out, total)
        writer.set_custom_data(OUTCOME_KEY, json.dumps(asdict(outcome)))
    for file in sorted(bag.iterdir(), key=lambda file: file.name == METADATA):
        # The metadata last: it says which files are the bag.
        file.replace(target / file.name)
    return outcome


def finished(target: Path) -> Outcome | None:
    """Return what became of a bag, None if it is not finished.

    Raises
    ------
    ValueError
        If it is finished, but its data are not there any more.
    """
    done = custom_data(target).get(OUTCOME_KEY)
    if done is None:
        return None
    try:
        fields = json.loads(done)
        for name in ('lost', 'left_out'):
            fields[name] = tuple(fields[name])
        outcome = Outcome(**fields)
        with Source(target) as made:
            counts: Counter[str] = Counter()
            for item in made.connections:
                counts[item.topic] += item.msgcount
            made.check_counts(counts)
            lost = '; '.join(made.lost)
        if outcome.others:
            check_others(target / OTHER_MESSAGES, outcome.others)
    except MALFORMED as error:
        lost = str(error) if isinstance(error, ValueError) else reason_of(error)
    if lost:
        raise ValueError(
            f'{target} was finished and is damaged: {lost}; accepted is another name, or '
            'to remove it'
        )
    return outcome


def remove_assembled(target: Path) -> None:
    """Remove what is left of an assembly that was broken off."""
    shutil.rmtree(target / _ASSEMBLED, ignore_errors=True)


def check_entry(source: Source, target: Path, entry: Entry, topic: str, timestamp: int) -> None:
    """Refuse an image that is not the one that was answered."""
    if (entry.topic, entry.timestamp) != (topic, timestamp):
        raise ValueError(
            f'{source.path} is not the bag that {target} was begun with: {topic} at {timestamp} '
            f'ns is read where {entry.topic} at {entry.timestamp} ns was'
        )


def _write(
    source: Source,
    target: Path,
    topics: Mapping[str, AnswerTopics],
    journal: Journal,
    writer: BagWriter,
    copy: Copy,
) -> int:
    """Write all messages of a source with the answers, and return the number of answers."""
    store = typestore()
    connections = {
        name: writer.add_connection(name, kind, typestore=store)
        for to in topics.values()
        for name, kind in to.types.items()
    }
    entries: Iterator[tuple[Entry, list[Output]]] = journal.answers()
    read: Counter[str] = Counter()
    answers = images_read = 0
    for connection, timestamp, data in source.messages():
        copy.write(connection, timestamp, data)
        read[connection.topic] += 1
        if connection.topic in topics and is_ros(connection):
            images_read += 1
            entry, outputs = next(entries, (None, []))
            if entry is None:
                break
            check_entry(source, target, entry, connection.topic, timestamp)
            answers += len(outputs)
            for name, message in outputs:
                writer.write(connections[name], timestamp, message)
    expected = len(journal.entries)
    if images_read != expected:
        lost = '; '.join(source.lost) or 'no damage was found'
        raise ValueError(
            f'{source.path}: {expected} images were answered, {images_read} can be read now; '
            f'{target} keeps the answers: {lost}'
        )
    source.check_counts(read)
    return answers
