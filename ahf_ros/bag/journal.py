"""Journal of an unfinished bag: the results so far, from which a later run continues.

The journal is itself a bag, of several files that never change once they have their names. Every
image adds a file, and ten files with the same number of images are merged into one, which keeps
the number of files small. The metadata lists the valid files and is replaced atomically. So a
process that is killed at any moment leaves a bag with the results of all earlier images.
"""

from __future__ import annotations

import json
import shutil
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ahf_ros.bag.definitions import typestore
from ahf_ros.bag.folder import MALFORMED, METADATA, load_metadata
from ahf_ros.bag.writing import BagWriter, as_yaml
from ahf_ros.filtering.identifier import Memory

PROGRESS = '/ahf_bag/progress'
"""Topic with the entry of every image; the finished bag does not have it."""

MERGED = 10
"""Number of files that are merged into one."""

_STRING = 'std_msgs/msg/String'
_INFORMATION = 'rosbag2_bagfile_information'
_NEW = 'metadata.new'
_SUFFIX = '.part.db3'
_EMPTY = f'{0:09}-0{_SUFFIX}'


@dataclass(frozen=True, slots=True)
class Entry:
    """Entry of one image.

    Attributes
    ----------
    topic : str
        Topic of the image.
    timestamp : int
        Time of recording, ns.
    memory : Memory
        State of the identifier after the image, for the next image of the topic.
    reason : str
        Why the image was refused; empty if it was not.
    note : str
        What became of its stack, if that is not what was asked for.
    """

    topic: str
    timestamp: int
    memory: Memory
    reason: str
    note: str = ''


Output = tuple[str, bytes]
"""A topic and a serialized message for it."""

_Row = tuple[str, int, bytes]  # topic, time in ns, message


def begin(folder: Path, topics: Mapping[str, str], origin: str) -> None:
    """Create a bag without messages, atomically.

    Parameters
    ----------
    folder : Path
        The bag, which does not exist.
    topics : mapping of str to str
        The topics of the results and their types.
    origin : str
        Description of what the bag is made from, stored in its metadata.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    store = typestore()
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f'.{folder.name}.') as made:
        bag = Path(made) / 'bag'
        with BagWriter(bag, 'sqlite3') as writer:
            writer.set_custom_data('ahf_ros', origin)
            for topic, kind in {**topics, PROGRESS: _STRING}.items():
                writer.add_connection(topic, kind, typestore=store)
        (bag / f'{bag.name}.db3').rename(bag / _EMPTY)
        content = load_metadata(bag)
        content[_INFORMATION]['relative_file_paths'] = [_EMPTY]
        _replace(bag / METADATA, content)
        bag.rename(folder)


class Journal:
    """The results of an unfinished bag.

    Parameters
    ----------
    folder : Path
        The bag, created by `begin`.

    Attributes
    ----------
    entries : list of Entry
        Entries of all images so far, in their order.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._store = typestore()
        self._content = load_metadata(folder)
        self._parts: list[str] = self._content[_INFORMATION]['relative_file_paths']
        self._remove_others()
        self._counts: Counter[str] = Counter()
        self.entries: list[Entry] = []
        for topic, _, data in self._rows(self._parts):
            self._counts[topic] += 1
            if topic == PROGRESS:
                self.entries.append(self._entry(data))

    def append(self, entry: Entry, answers: Sequence[Output]) -> None:
        """Write the entry of an image and the messages about it, all or nothing."""
        rows = [(topic, entry.timestamp, data) for topic, data in answers]
        rows.append((PROGRESS, entry.timestamp, self._serialized(entry)))
        self._parts.append(self._write_part(len(self.entries), 1, rows))
        self.entries.append(entry)
        self._counts.update(topic for topic, _, _ in rows)
        while len(last := self._parts[-MERGED:]) == MERGED and len(set(map(_size, last))) == 1:
            merged = self._write_part(_first(last[0]), MERGED * _size(last[0]), self._rows(last))
            self._parts[-MERGED:] = [merged]
        self._writeload_metadata()
        self._remove_others()

    def answers(self) -> Iterator[tuple[Entry, list[Output]]]:
        """Yield every entry with the messages about its image, in order."""
        entries = iter(self.entries)
        answers: list[Output] = []
        for topic, _, data in self._rows(self._parts):
            if topic != PROGRESS:
                answers.append((topic, data))
                continue
            yield next(entries), answers
            answers = []

    def _write_part(self, first: int, size: int, rows: Iterable[_Row]) -> str:
        """Write a file of the bag and return its name."""
        name = f'{first:09}-{size}{_SUFFIX}'
        new = self._folder / f'new{_SUFFIX}'
        shutil.copyfile(self._folder / _EMPTY, new)
        with closing(sqlite3.connect(new)) as database, database:
            # A partial file is never used, so nothing needs to be safe on disk.
            database.execute('PRAGMA journal_mode=OFF')
            database.execute('PRAGMA synchronous=OFF')
            numbers = dict(database.execute('SELECT name, id FROM topics').fetchall())
            database.executemany(
                'INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)',
                ((numbers[topic], timestamp, data) for topic, timestamp, data in rows),
            )
        new.rename(self._folder / name)
        return name

    def _rows(self, parts: Iterable[str]) -> Iterator[_Row]:
        """Yield the messages in the order in which they were written."""
        for part in parts:
            address = f'file:{quote(str(self._folder / part))}?immutable=1'
            with closing(sqlite3.connect(address, uri=True)) as database:
                yield from database.execute(
                    'SELECT topics.name, timestamp, data FROM messages '
                    'JOIN topics ON topics.id = messages.topic_id ORDER BY messages.id'
                )

    def _serialized(self, entry: Entry) -> bytes:
        text = self._store.types[_STRING](data=json.dumps(asdict(entry)))
        return bytes(self._store.serialize_cdr(text, _STRING))

    def _entry(self, data: bytes) -> Entry:
        text: Any = self._store.deserialize_cdr(data, _STRING)
        fields = json.loads(text.data)
        memory = {name: value and tuple(value) for name, value in fields['memory'].items()}
        return Entry(**fields | {'memory': Memory(**memory)})

    def _writeload_metadata(self) -> None:
        """Write which files are valid, the number of messages, and their times."""
        about = self._content[_INFORMATION]
        times = [entry.timestamp for entry in self.entries]
        about['starting_time'] = {'nanoseconds_since_epoch': min(times)}
        about['duration'] = {'nanoseconds': max(times) - min(times)}
        about['message_count'] = sum(self._counts.values())
        about['files'] = []  # contents of each file; readers do not need them
        for item in about['topics_with_message_count']:
            item['message_count'] = self._counts[item['topic_metadata']['name']]
        _replace(self._folder / METADATA, self._content)

    def _remove_others(self) -> None:
        """Remove files that are not valid: already merged, or unfinished."""
        for file in self._folder.glob(f'*{_SUFFIX}'):
            if file.name not in self._parts:
                file.unlink()


def custom_data(folder: Path) -> dict[str, str]:
    """Return the custom data of a bag; empty if there are none or the folder is no bag."""
    try:
        return load_metadata(folder)[_INFORMATION]['custom_data'] or {}
    except MALFORMED:
        return {}


def remove_parts(folder: Path) -> None:
    """Remove all files of the journal from a finished bag."""
    for file in (*folder.glob(f'*{_SUFFIX}'), *folder.glob(_NEW)):
        file.unlink()


def _first(part: str) -> int:
    return int(part.removesuffix(_SUFFIX).split('-')[0])


def _size(part: str) -> int:
    return int(part.removesuffix(_SUFFIX).split('-')[1])


def _replace(path: Path, content: Any) -> None:
    """Replace a file atomically."""
    new = path.with_name(_NEW)
    new.write_text(as_yaml(content), encoding='utf-8')
    new.replace(path)
