"""The bag that is written: a journal of all answers first, then the bag in the place of it.

The journal is one SQLite file in the folder of the bag, from which a later run continues. Every
image is one transaction, so a process that is killed at any moment leaves the results of all
earlier images.
"""

import json
import re
import shutil
import sqlite3
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag2 import StoragePlugin, Writer

from ahf_ros.bag.definitions import CODED_TARGETS, COMPRESSED_IMAGE, typestore
from ahf_ros.bag.mcap_records import add_checksums
from ahf_ros.bag.source import METADATA, Source, read_metadata
from ahf_ros.base.opening import check_regular, parsing
from ahf_ros.base.parsed_yaml import parsed_yaml
from ahf_ros.base.writing import place, write_whole
from ahf_ros.files.target_json import targets_from_json
from ahf_ros.identification.filtering.identifier import Memory, Seen

JOURNAL = 'unfinished.sqlite'

STORAGES = {'mcap': StoragePlugin.MCAP, 'sqlite3': StoragePlugin.SQLITE3}

Output = tuple[str, bytes]
"""A topic and a serialized message for it."""

_TABLES = (
    'task (origin TEXT)',
    'images (number INTEGER PRIMARY KEY, entry TEXT, outputs INTEGER, checksum INTEGER)',
    'outputs (image INTEGER, number INTEGER, topic TEXT, data BLOB, PRIMARY KEY (image, number))',
    'seen (topic TEXT PRIMARY KEY, height INTEGER, image BLOB, known TEXT, checksum INTEGER)',
)
# Under which a bag keeps what it was made from, and what became of it.
_ORIGIN_KEY, _OUTCOME_KEY = 'ahf_ros', 'ahf_ros_outcome'
_UNKNOWN_HASH = f'RIHS01_{0:064x}'  # of a type whose definition is missing or not accepted
_UNPRINTABLE = re.compile('[\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]')
_ASSEMBLED = '.assembled'


@dataclass(frozen=True, slots=True)
class AnswerTopics:
    """Topics of the answers to the images of a topic: targets, annotated images or ''."""

    targets: str
    debug_image: str

    @property
    def types(self) -> dict[str, str]:
        """The topics and their types."""
        types = {self.targets: CODED_TARGETS}
        return types | {self.debug_image: COMPRESSED_IMAGE} if self.debug_image else types


def answer_topic(image: str, output_topic: str) -> str:
    """Return the topic of the answers to the images of a topic."""
    return output_topic if output_topic.startswith('/') else f'{image}/{output_topic}'


@dataclass(frozen=True, slots=True)
class Entry:
    """Entry of one image in the journal."""

    topic: str  # of the image
    timestamp: int  # of recording, ns
    memory: Memory  # what the image leaves to the next one of the topic; see `Journal.seen`
    reason: str = ''  # why the image was refused; empty if it was not
    note: str = ''  # what else there is to say, such as what became of its stack
    damaged: bool = False  # whether the image is not whole


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a bag."""

    images: int  # their number
    refused: int  # of these; they were not accepted
    damaged: int = 0  # of these; they are not whole
    lost: tuple[str, ...] = ()  # messages that are missing, with topic and time where known
    left_out: tuple[str, ...] = ()  # what else of the source the new bag does not have


class Journal:
    """The results of an unfinished bag that was begun, to be closed; `entries` has all images."""

    def __init__(self, folder: Path) -> None:
        self._database = sqlite3.connect(folder / JOURNAL)
        # What the system holds outlives a killed process; the disk would take 8 ms an image.
        self._database.execute('PRAGMA synchronous=OFF')
        self.entries: list[Entry] = []
        with parsing(folder / JOURNAL, 'what this version has begun'):
            rows = self._database.execute('SELECT * FROM images ORDER BY number').fetchall()
            for number, (image, text, count, checksum) in enumerate(rows):
                outputs = self._outputs(number)
                if (image, count, checksum) != (number, len(outputs), _checksum(text, outputs)):
                    raise ValueError(f'image {number} is damaged, accepted is to remove the file')
                self.entries.append(_entry(text))

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def append(self, entry: Entry, outputs: Sequence[Output]) -> None:
        """Write the entry of an image and the messages about it, all or nothing."""
        memory, seen = replace(entry.memory, seen=None), entry.memory.seen
        entry = replace(entry, memory=memory)
        image, text = len(self.entries), json.dumps(asdict(entry))
        with self._database:
            self._database.execute('DELETE FROM seen WHERE topic = ?', (entry.topic,))
            if seen:
                insert = 'INSERT INTO seen VALUES (?, ?, ?, ?, ?)'
                self._database.execute(insert, (entry.topic, *_stored(seen)))
            row = image, text, len(outputs), _checksum(text, outputs)
            self._database.execute('INSERT INTO images VALUES (?, ?, ?, ?)', row)
            self._database.executemany(
                'INSERT INTO outputs VALUES (?, ?, ?, ?)',
                ((image, number, *output) for number, output in enumerate(outputs)),
            )
        self.entries.append(entry)

    def seen(self, topic: str) -> Seen | None:
        """Return what the last image of a topic has left to be followed."""
        query = 'SELECT height, image, known, checksum FROM seen WHERE topic = ?'
        stored = self._database.execute(query, (topic,)).fetchone()
        return _restored(*stored) if stored else None

    def outputs(self) -> Iterator[tuple[Entry, list[Output]]]:
        """Yield every entry with the messages about its image, in order."""
        return ((entry, self._outputs(image)) for image, entry in enumerate(self.entries))

    def _outputs(self, image: int) -> list[Output]:
        query = 'SELECT topic, data FROM outputs WHERE image = ? ORDER BY number'
        return self._database.execute(query, (image,)).fetchall()


def _checksum(entry: str, outputs: Sequence[Output]) -> int:
    """Return a checksum of the entry of an image and the messages about it."""
    parts = [entry.encode(), *(it for topic, data in outputs for it in (topic.encode(), data))]
    return crc32(b''.join(parts))


def _entry(text: str) -> Entry:
    fields = json.loads(text)
    memory: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in fields['memory'].items()
    }
    return Entry(**fields | {'memory': Memory(**memory)})


def _stored(seen: Seen) -> tuple[int, bytes, str, int]:
    """Return what was seen as the columns of a row: height, image, targets and a checksum."""
    known = {
        'targets': [asdict(it) for it in seen.targets],
        'lost': [asdict(it) for it in seen.lost],
        'turn': seen.turn,
        'still': seen.still,
    }
    image, text = seen.image.tobytes(), json.dumps(known)
    return len(seen.image), image, text, crc32(text.encode(), crc32(image))


def _restored(height: int, image: bytes, text: str, checksum: int) -> Seen:
    """Return what was seen from the columns of a row."""
    if checksum != crc32(text.encode(), crc32(image)):
        raise ValueError('what was seen last is damaged, accepted is to remove the file')
    known = json.loads(text)
    targets, lost = (
        tuple(targets_from_json({'targets': known[name]}, name)) for name in ('targets', 'lost')
    )
    pixels = np.frombuffer(image, np.uint8).reshape(height, -1)
    return Seen(pixels, targets, lost, known['turn'], known['still'])


def begin(output: Path, origin: str) -> None:
    """Begin a journal, all or nothing, with a description of what the bag is made from."""
    with closing(sqlite3.connect(output / JOURNAL)) as database, database:
        database.execute('BEGIN')
        for table in _TABLES:
            database.execute(f'CREATE TABLE {table}')
        database.execute('INSERT INTO task VALUES (?)', (origin,))


def begun_with(output: Path) -> str:
    """Return the description that a bag was begun with, empty if it was not begun here."""
    if (output / JOURNAL).exists():
        check_regular(output / JOURNAL, sys.maxsize)
        with (
            parsing(output / JOURNAL, 'what this version has begun'),
            closing(sqlite3.connect(output / JOURNAL)) as database,
            suppress(sqlite3.OperationalError),  # killed before it was begun
        ):
            return str(database.execute('SELECT origin FROM task').fetchone()[0])
    return _custom_data(output).get(_ORIGIN_KEY, '')


def finished(output: Path) -> Outcome | None:
    """Return what became of a bag, None if it is not finished.

    If it was finished, but its data are not there any more, it raises a ValueError.
    """
    done = _custom_data(output).get(_OUTCOME_KEY)
    if done is None:
        return None
    try:
        fields = json.loads(done)
        outcome = Outcome(
            images=fields['images'],
            refused=fields['refused'],
            damaged=fields['damaged'],
            lost=tuple(fields['lost']),
            left_out=tuple(fields['left_out']),
        )
        with Source(output) as made:
            counts: Counter[str] = Counter()
            for item in made.connections:
                counts[item.topic] += item.msgcount
            made.check_counts(counts)
            lost = '; '.join(made.lost)
    except (TypeError, KeyError, ValueError) as error:
        lost = str(error)
    if lost:
        raise ValueError(
            f'{output} was finished and is damaged: {lost}; accepted is another name, or '
            'to remove it'
        )
    return outcome


def _custom_data(output: Path) -> dict[str, str]:
    """Return what is in the metadata of a bag besides its contents; empty if it is no bag."""
    try:
        return read_metadata(output).custom
    except ValueError:
        return {}


def write_bag(
    source: Source,
    output: Path,
    topics: Mapping[str, AnswerTopics],
    journal: Journal,
    storage: str,
    origin: str,
) -> Outcome:
    """Write a bag of one of `STORAGES` from its source and the journal beside the journal.

    `topics` are by the topic of the images. If what is read is not what was answered before, it
    raises a ValueError, and the journal with all answers is left as it is.
    """
    shutil.rmtree(output / _ASSEMBLED, ignore_errors=True)
    bag = output / _ASSEMBLED / output.name
    with Writer(bag, version=9, storage_plugin=STORAGES[storage]) as writer:
        _write(source, output, topics, journal, writer)
    for file in bag.glob('*.mcap'):
        add_checksums(file)
    outcome = Outcome(
        images=len(journal.entries),
        refused=sum(bool(entry.reason) for entry in journal.entries),
        damaged=sum(entry.damaged for entry in journal.entries),
        lost=tuple(source.lost),
        left_out=tuple(source.left_out),
    )
    own = {_ORIGIN_KEY: origin, _OUTCOME_KEY: json.dumps(asdict(outcome))}
    _set_custom_data(bag / METADATA, source.metadata.custom | own)
    for file in sorted(bag.iterdir(), key=lambda file: file.name == METADATA):
        # The metadata last: they say that the bag is finished.
        place(file, output / file.name)
    return outcome


def remove_unfinished(output: Path) -> None:
    """Remove the journal of a finished bag, and the folder in which the bag was written."""
    shutil.rmtree(output / _ASSEMBLED, ignore_errors=True)
    for file in output.glob(f'{JOURNAL}*'):
        file.unlink()


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
    text = path.read_text(encoding='utf-8')
    content = parsed_yaml(text, str(path), sys.maxsize, aliases=True)
    content['rosbag2_bagfile_information']['custom_data'] = custom
    text = json.dumps(content, indent=1, ensure_ascii=False)  # YAML joins no surrogates
    escaped = _UNPRINTABLE.sub(lambda found: f'\\u{ord(found[0]):04x}', text)
    write_whole(path, escaped.encode())


def _write(
    source: Source,
    output: Path,
    topics: Mapping[str, AnswerTopics],
    journal: Journal,
    writer: Writer,
) -> None:
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
        rihs01=digest or _UNKNOWN_HASH,
        offered_qos_profiles=item.ext.offered_qos_profiles,
    )
