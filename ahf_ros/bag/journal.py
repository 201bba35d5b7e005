"""Journal of an unfinished bag: one SQLite file in its folder, from which a later run continues.

Every image is one transaction, so a process that is killed at any moment leaves the results of all
earlier images.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from ahf_ros.filtering.identifier import Memory

NAME = 'unfinished.sqlite'

Output = tuple[str, bytes]
"""A topic and a serialized message for it."""

_TABLES = (
    'task (origin TEXT)',
    'images (number INTEGER PRIMARY KEY, entry TEXT)',
    'outputs (image INTEGER, number INTEGER, topic TEXT, data BLOB, PRIMARY KEY (image, number))',
)


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
    reason: str = ''
    note: str = ''


class Journal:
    """The results of an unfinished bag; to be closed.

    Parameters
    ----------
    folder : Path
        The bag; created by `begin`.

    Attributes
    ----------
    entries : list of Entry
        Entries of all images so far, in their order.
    """

    def __init__(self, folder: Path) -> None:
        self._database = sqlite3.connect(folder / NAME)
        # What the system holds outlives a killed process; the disk would take 8 ms an image.
        self._database.execute('PRAGMA synchronous=OFF')
        rows = self._database.execute('SELECT entry FROM images ORDER BY number')
        self.entries = [_entry(text) for (text,) in rows]

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def append(self, entry: Entry, outputs: Sequence[Output]) -> None:
        """Write the entry of an image and the messages about it, all or nothing."""
        image = len(self.entries)
        with self._database:
            self._database.execute(
                'INSERT INTO images VALUES (?, ?)', (image, json.dumps(asdict(entry)))
            )
            self._database.executemany(
                'INSERT INTO outputs VALUES (?, ?, ?, ?)',
                ((image, number, *output) for number, output in enumerate(outputs)),
            )
        self.entries.append(entry)

    def outputs(self) -> Iterator[tuple[Entry, list[Output]]]:
        """Yield every entry with the messages about its image, in order."""
        query = 'SELECT topic, data FROM outputs WHERE image = ? ORDER BY number'
        for image, entry in enumerate(self.entries):
            yield entry, self._database.execute(query, (image,)).fetchall()


def begin(folder: Path, origin: str) -> None:
    """Begin a journal, all or nothing.

    Parameters
    ----------
    folder : Path
        The bag.
    origin : str
        Description of what the bag is made from.
    """
    with closing(sqlite3.connect(folder / NAME)) as database, database:
        database.execute('BEGIN')
        for table in _TABLES:
            database.execute(f'CREATE TABLE {table}')
        database.execute('INSERT INTO task VALUES (?)', (origin,))


def begun_with(folder: Path) -> str:
    """Return the description that a journal was begun with, empty if there is none."""
    if (folder / NAME).is_file():
        with (
            closing(sqlite3.connect(folder / NAME)) as database,
            suppress(sqlite3.OperationalError),  # killed before it was begun
        ):
            return str(database.execute('SELECT origin FROM task').fetchone()[0])
    return ''


def remove(folder: Path) -> None:
    """Remove the journal of a finished bag."""
    for file in folder.glob(f'{NAME}*'):
        file.unlink()


def _entry(text: str) -> Entry:
    fields = json.loads(text)
    memory = {name: value and tuple(value) for name, value in fields['memory'].items()}
    return Entry(**fields | {'memory': Memory(**memory)})
