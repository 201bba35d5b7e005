"""What is in the place of a bag while it is made: its answers so far, and how to go on.

It is a bag itself, of several files that are never changed once they have their name. Every image
adds one; ten files of the same number of images are joined into one, so that there are never
many. The metadata, replaced as a whole, says which files count. So there is no moment in which a
process that is killed leaves anything but a bag with the answers to all images before the one it
was at.
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
from typing import Any, Final
from urllib.parse import quote

from rosbags.rosbag2 import StoragePlugin, Writer
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from ahf_ros.bag.definitions import typestore
from ahf_ros.filtering.identifier import Memory

VERSION: Final = 9
"""Of the format of bags that are written."""

METADATA = 'metadata.yaml'

PROGRESS = '/ahf_bag/progress'
"""Topic that tells of every image what became of it. The finished bag does not have it."""

JOINED = 10
"""Number of files that are joined into one."""

_STRING = 'std_msgs/msg/String'
_INFORMATION = 'rosbag2_bagfile_information'
_NEW = 'metadata.new'
_SUFFIX = '.part.db3'
_EMPTY = f'{0:09}-0{_SUFFIX}'


@dataclass(frozen=True, slots=True)
class Entry:
    """What became of an image.

    Attributes
    ----------
    topic : str
        That it was recorded from.
    timestamp : int
        When it was recorded, ns.
    memory : Memory
        What its identification leaves to the next one of its topic.
    reason : str
        Why it was refused; empty where it was not.
    """

    topic: str
    timestamp: int
    memory: Memory
    reason: str


Output = tuple[str, bytes]
"""A topic and a message for it."""

_Row = tuple[str, int, bytes]  # topic, time in ns, message


def begin(folder: Path, topics: Mapping[str, str], told: str) -> None:
    """Make a bag without messages, all at once.

    Parameters
    ----------
    folder : Path
        The bag, which does not exist.
    topics : mapping of str to str
        The topics of the answers and their types.
    told : str
        What the bag is made from, kept with it.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    store = typestore()
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f'.{folder.name}.') as made:
        bag = Path(made) / 'bag'
        with Writer(bag, version=VERSION, storage_plugin=StoragePlugin.SQLITE3) as writer:
            writer.set_custom_data('ahf_ros', told)
            for topic, kind in {**topics, PROGRESS: _STRING}.items():
                writer.add_connection(topic, kind, typestore=store)
        (bag / f'{bag.name}.db3').rename(bag / _EMPTY)
        content = _metadata(bag)
        content[_INFORMATION]['relative_file_paths'] = [_EMPTY]
        _replace(bag / METADATA, content)
        bag.rename(folder)


class Journal:
    """The answers of a bag that is being made.

    Parameters
    ----------
    folder : Path
        The bag, made by `begin`.

    Attributes
    ----------
    entries : list of Entry
        Of all images so far, in their order.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._store = typestore()
        self._content = _metadata(folder)
        self._parts: list[str] = self._content[_INFORMATION]['relative_file_paths']
        self._remove_others()
        self._counts: Counter[str] = Counter()
        self.entries: list[Entry] = []
        for topic, _, data in self._rows(self._parts):
            self._counts[topic] += 1
            if topic == PROGRESS:
                self.entries.append(self._entry(data))

    def append(self, entry: Entry, answers: Sequence[Output]) -> None:
        """Write what became of an image, and the messages about it, all or nothing."""
        rows = [(topic, entry.timestamp, data) for topic, data in answers]
        rows.append((PROGRESS, entry.timestamp, self._serialized(entry)))
        self._parts.append(self._write_part(len(self.entries), 1, rows))
        self.entries.append(entry)
        self._counts.update(topic for topic, _, _ in rows)
        while len(last := self._parts[-JOINED:]) == JOINED and len(set(map(_size, last))) == 1:
            joined = self._write_part(_first(last[0]), JOINED * _size(last[0]), self._rows(last))
            self._parts[-JOINED:] = [joined]
        self._write_metadata()
        self._remove_others()

    def answers(self) -> Iterator[tuple[Entry, list[Output]]]:
        """Yield every image with the messages about it, in their order."""
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
            # A file that is broken off is not used.
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

    def _write_metadata(self) -> None:
        """Say which files count, how many messages there are and when."""
        about = self._content[_INFORMATION]
        times = [entry.timestamp for entry in self.entries]
        about['starting_time'] = {'nanoseconds_since_epoch': min(times)}
        about['duration'] = {'nanoseconds': max(times) - min(times)}
        about['message_count'] = sum(self._counts.values())
        about['files'] = []  # of what each file holds, which readers can do without
        for item in about['topics_with_message_count']:
            item['message_count'] = self._counts[item['topic_metadata']['name']]
        _replace(self._folder / METADATA, self._content)

    def _remove_others(self) -> None:
        """Remove the parts that do not count: joined, or not finished."""
        for file in self._folder.glob(f'*{_SUFFIX}'):
            if file.name not in self._parts:
                file.unlink()


def custom_data(folder: Path) -> dict[str, str]:
    """Return what is kept with a bag, empty where there is nothing or it is none."""
    try:
        return _metadata(folder)[_INFORMATION]['custom_data'] or {}
    except (OSError, YAMLError, KeyError, TypeError):
        return {}


def remove_parts(folder: Path) -> None:
    """Remove all files of a journal from a bag that is finished."""
    for file in (*folder.glob(f'*{_SUFFIX}'), *folder.glob(_NEW)):
        file.unlink()


def _first(part: str) -> int:
    return int(part.removesuffix(_SUFFIX).split('-')[0])


def _size(part: str) -> int:
    return int(part.removesuffix(_SUFFIX).split('-')[1])


def _metadata(folder: Path) -> Any:
    return YAML(typ='safe').load((folder / METADATA).read_text(encoding='utf-8'))


def _replace(path: Path, content: Any) -> None:
    """Write a file of which readers see the old or the new one, never a part."""
    new = path.with_name(_NEW)
    new.write_text(json.dumps(content, indent=1), encoding='utf-8')  # JSON is YAML
    new.replace(path)
