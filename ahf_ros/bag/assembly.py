"""The finished bag: its source and the answers, in the place of the journal."""

from __future__ import annotations

import json
import re
import shutil
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag2 import StoragePlugin, Writer
from ruamel.yaml import YAML

from ahf_ros.bag.answering import AnswerTopics
from ahf_ros.bag.definitions import typestore
from ahf_ros.bag.journal import Entry, Journal
from ahf_ros.bag.source import METADATA, Source, read_metadata

STORAGES = {'mcap': StoragePlugin.MCAP, 'sqlite3': StoragePlugin.SQLITE3}

TASK_KEY = 'ahf_ros'
"""Under which a bag keeps what it was made from."""

OUTCOME_KEY = 'ahf_ros_outcome'
"""Under which a bag keeps what became of it."""

UNKNOWN_HASH = f'RIHS01_{0:064x}'
"""Hash of a type whose definition is missing or not accepted."""

_UNPRINTABLE = re.compile('[\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]')
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
    """

    images: int
    refused: int
    lost: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


def assemble(
    source: Source,
    output: Path,
    topics: Mapping[str, AnswerTopics],
    journal: Journal,
    storage: str,
    origin: str,
) -> Outcome:
    """Write a bag from its source and the journal into the folder of the journal.

    Parameters
    ----------
    source : Source
    output : Path
        The folder.
    topics : mapping of str to AnswerTopics
        By the topic of the images.
    journal : Journal
    storage : str
        One of `STORAGES`.
    origin : str
        Description of what the bag is made from.

    Raises
    ------
    ValueError
        If what was read is not what was answered before. The journal with all answers is left
        as it is then.
    """
    remove_assembled(output)
    bag = output / _ASSEMBLED / output.name
    with Writer(bag, version=9, storage_plugin=STORAGES[storage]) as writer:
        _write(source, output, topics, journal, writer)
    outcome = Outcome(
        images=len(journal.entries),
        refused=sum(bool(entry.reason) for entry in journal.entries),
        lost=tuple(source.lost),
        left_out=tuple(source.left_out),
    )
    own = {TASK_KEY: origin, OUTCOME_KEY: json.dumps(asdict(outcome))}
    _set_custom_data(bag / METADATA, source.metadata.custom | own)
    for file in sorted(bag.iterdir(), key=lambda file: file.name == METADATA):
        # The metadata last: they say that the bag is finished.
        file.replace(output / file.name)
    return outcome


def finished(output: Path) -> Outcome | None:
    """Return what became of a bag, None if it is not finished.

    Raises
    ------
    ValueError
        If it is finished, but its data are not there any more.
    """
    done = custom_data(output).get(OUTCOME_KEY)
    if done is None:
        return None
    try:
        fields = json.loads(done)
        outcome = Outcome(**{name: _frozen(value) for name, value in fields.items()})
        with Source(output) as made:
            counts: Counter[str] = Counter()
            for item in made.connections:
                counts[item.topic] += item.msgcount
            made.check_counts(counts)
            lost = '; '.join(made.lost)
    except (TypeError, ValueError) as error:
        lost = str(error)
    if lost:
        raise ValueError(
            f'{output} was finished and is damaged: {lost}; accepted is another name, or '
            'to remove it'
        )
    return outcome


def custom_data(output: Path) -> dict[str, str]:
    """Return what is in the metadata of a bag besides its contents; empty if it is no bag."""
    try:
        return read_metadata(output).custom
    except ValueError:
        return {}


def remove_assembled(output: Path) -> None:
    """Remove what is left of an assembly that was broken off."""
    shutil.rmtree(output / _ASSEMBLED, ignore_errors=True)


def check_entry(source: Source, output: Path, entry: Entry, topic: str, timestamp: int) -> None:
    """Refuse an image that is not the one that was answered."""
    if (entry.topic, entry.timestamp) != (topic, timestamp):
        raise ValueError(
            f'{source.path} is not the bag that {output} was begun with: {topic} at {timestamp} '
            f'ns is read where {entry.topic} at {entry.timestamp} ns was'
        )


def _set_custom_data(path: Path, custom: dict[str, str]) -> None:
    """Add custom data to the metadata of a bag.

    They are written as JSON that is YAML, too. What rosbags writes does not always read back: its
    YAML breaks long lines within the backslashes of a text.
    """
    content = YAML(typ='safe').load(path.read_text(encoding='utf-8'))
    content['rosbag2_bagfile_information']['custom_data'] = custom
    text = json.dumps(content, indent=1, ensure_ascii=False)  # YAML joins no surrogates
    escaped = _UNPRINTABLE.sub(lambda found: f'\\u{ord(found[0]):04x}', text)
    path.write_text(escaped, encoding='utf-8')


def _frozen(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _write(
    source: Source,
    output: Path,
    topics: Mapping[str, AnswerTopics],
    journal: Journal,
    writer: Writer,
) -> None:
    """Write all messages of a source with the answers."""
    copies = {
        (item.id, id(item.owner)): _added(writer, item, source) for item in source.connections
    }
    answers = {
        name: writer.add_connection(name, kind, typestore=typestore())
        for to in topics.values()
        for name, kind in to.types.items()
    }
    answered = journal.outputs()
    images = 0
    for connection, timestamp, data in source.messages():
        writer.write(copies[connection.id, id(connection.owner)], timestamp, data)
        if connection.topic not in topics:
            continue
        images += 1
        entry, outputs = next(answered, (None, []))
        if entry is None:
            break
        check_entry(source, output, entry, connection.topic, timestamp)
        for name, message in outputs:
            writer.write(answers[name], timestamp, message)
    if images != len(journal.entries):
        lost = '; '.join(source.lost) or 'no damage was found'
        raise ValueError(
            f'{source.path}: {len(journal.entries)} images were answered, {images} can be read '
            f'now; {output} keeps the answers: {lost}'
        )


def _added(writer: Writer, item: Connection, source: Source) -> Connection:
    """Return the topic of a writer that equals the given one; add it if it is missing."""
    assert isinstance(item.ext, ConnectionExtRosbag2)
    for known in writer.connections:
        if (known.topic, known.msgtype, known.ext) == (item.topic, item.msgtype, item.ext):
            return known
    definition, digest = item.msgdef.data, item.digest
    with suppress(Exception):
        # Types that are not accepted are copied with the hash of unknown types.
        store = source.stores.of(item)
        if item.msgdef.format == MessageDefinitionFormat.NONE:
            definition, _ = store.generate_msgdef(item.msgtype, ros_version=2)
        digest = digest or store.hash_rihs01(item.msgtype)
    return writer.add_connection(
        item.topic,
        item.msgtype,
        msgdef=definition,
        rihs01=digest or UNKNOWN_HASH,
        offered_qos_profiles=item.ext.offered_qos_profiles,
    )
