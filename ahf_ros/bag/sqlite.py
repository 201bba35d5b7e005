"""SQLite files of bags: every row that is whole, also where pages are missing or damaged."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from urllib.parse import quote

import numpy as np
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
)

from ahf_ros.bag.compression import LARGEST
from ahf_ros.bag.mcap_topics import NO_DEFINITION, tolerant_qos
from ahf_ros.bag.records import Lost, Message
from ahf_ros.text import reason_of, shown

_FORMATS = {'ros2msg': MessageDefinitionFormat.MSG, 'ros2idl': MessageDefinitionFormat.IDL}
_FIRST, _LAST = -(2**63), 2**63 - 1  # numbers that a row can have
_TABLES = {
    'topics': {'id', 'name', 'type', 'serialization_format'},
    'messages': {'topic_id', 'timestamp', 'data'},
}
"""Tables that are read, and columns that they must have."""
_ROW = np.dtype([('time', np.int64), ('row', np.int64), ('topic', np.int64)])


class Sqlite:
    """A file .db3; see `BagFile`.

    Raises
    ------
    ValueError
        If the topics cannot be read.
    """

    left_out: list[str]

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lost: list[Lost] = []
        self.left_out = []
        try:
            with closing(self._open()) as database:
                _check_tables(database)
                topics = self._topics(database)
                self._rows = self._scan(database)
        except sqlite3.Error as error:
            raise ValueError(f'{path} cannot be read: {error}') from error
        wal = path.with_name(f'{path.name}-wal')
        if wal.exists() and wal.stat().st_size:
            self._lost.append(Lost((), None, None, f'{wal.name} was not merged into the file'))
        numbers, counts = (
            it.tolist() for it in np.unique(self._rows['topic'], return_counts=True)
        )
        count = dict(zip(numbers, counts, strict=True))
        self.connections = [it._replace(msgcount=count.pop(it.id, 0)) for it in topics]
        for number, messages in count.items():
            reason = f'{messages} messages of topic {number}, which is not defined'
            self._lost.append(Lost((), None, None, reason))
        self.start = int(self._rows['time'][0]) if len(self._rows) else 0

    def schema(self, connection: Connection) -> None:
        """Return None: only MCAP has schemas; see `BagFile`."""

    def messages(self, selected: list[Connection]) -> Iterator[Message | Lost]:
        """Yield the messages of some topics in the order of time; see `BagFile`."""
        yield from self._lost
        topics = {item.id: item for item in selected}
        rows = self._rows[np.isin(self._rows['topic'], list(topics))]
        with closing(self._open()) as database:
            for time, row, topic in rows.tolist():
                try:
                    yield topics[topic], time, _data(database, row)
                except (sqlite3.Error, TypeError, ValueError) as error:
                    yield Lost((topics[topic].topic,), time, time, reason_of(error))

    def _open(self) -> sqlite3.Connection:
        address = f'file:{quote(str(self._path))}?mode=ro&immutable=1'
        database = sqlite3.connect(address, uri=True)
        # Without it SQLite refuses a file that is shorter than its header says.
        database.execute('PRAGMA writable_schema=ON')
        return database

    def _topics(self, database: sqlite3.Connection) -> list[Connection]:
        columns = {row[1] for row in database.execute('PRAGMA table_info(topics)')}
        qos, digest = (
            name if name in columns else "''"
            for name in ('offered_qos_profiles', 'type_description_hash')
        )
        definitions = _definitions(database)
        topics: list[Connection] = []
        for number, topic, kind, encoding, offered, hashed in database.execute(
            f'SELECT id, name, type, serialization_format, {qos}, {digest} FROM topics'
        ):
            if not all(isinstance(it, str) for it in (topic, kind, encoding)):
                words = f'{shown(topic)} of type {shown(kind)}, serialized as {shown(encoding)}'
                self._lost.append(Lost((), None, None, f'topic {shown(number)} is {words}'))
                continue
            definition = definitions.get(kind, NO_DEFINITION)
            extension = ConnectionExtRosbag2(encoding, tolerant_qos(offered))
            known = hashed if isinstance(hashed, str) else ''
            topics.append(Connection(number, topic, kind, definition, known, 0, extension, self))
        return topics

    def _scan(self, database: sqlite3.Connection) -> np.ndarray:
        """Return the rows that can be read, in the order of time."""
        rows: list[tuple[int, int, int]] = []
        following = _FIRST
        query = 'SELECT timestamp, rowid, topic_id FROM messages WHERE rowid >= ? ORDER BY rowid'
        while True:
            try:
                for row in database.execute(query, (following,)):
                    time, number, topic = (int(it) for it in row)
                    if time < 0:
                        self._lost.append(Lost((), None, None, f'{time} ns is not a time'))
                    else:
                        rows.append((time, number, topic))
                break
            except (sqlite3.Error, TypeError, ValueError, OverflowError) as error:
                first = rows[-1][1] + 1 if rows else following
                before = rows[-1][0] if rows else None
                found = _readable(database, max(first, following))
                after = found[1] if found else None
                self._lost.append(Lost((), before, after, reason_of(error)))
                if found is None:
                    break
                following = found[0]
        table = np.array(rows, _ROW)
        return table[np.argsort(table, order=('time', 'row'))]


def _check_tables(database: sqlite3.Connection) -> None:
    """Refuse a file where a view or computed columns stand for what should be recorded."""
    for name, needed in _TABLES.items():
        query = "SELECT type, sql FROM sqlite_master WHERE name = ? AND type IN ('table', 'view')"
        kind, made = database.execute(query, (name,)).fetchone() or ('missing', '')
        if kind != 'table' or not str(made).upper().startswith('CREATE TABLE'):
            raise sqlite3.DatabaseError(f'{name} is not a table')
        columns = {row[1] for row in database.execute(f'PRAGMA table_info({name})')}
        if missing := needed - columns:
            raise sqlite3.DatabaseError(f'{name} has no columns {", ".join(sorted(missing))}')


def _data(database: sqlite3.Connection, row: int) -> bytes:
    """Return the data of a message, which are looked at before they are read."""
    query = 'SELECT typeof(data), length(data) FROM messages WHERE rowid = ?'
    kind, size = database.execute(query, (row,)).fetchone()
    if kind != 'blob' or size > LARGEST:
        raise ValueError(f'{size} bytes of type {kind}, accepted are at most {LARGEST} of blob')
    query = 'SELECT data FROM messages WHERE rowid = ?'
    return bytes(database.execute(query, (row,)).fetchone()[0])


def _readable(database: sqlite3.Connection, row: int) -> tuple[int, int] | None:
    """Return the next row behind a damage and its time, None where there is none."""

    def after(least: int) -> tuple[int, int] | None:
        query = 'SELECT rowid, timestamp FROM messages WHERE rowid >= ? ORDER BY rowid LIMIT 1'
        with suppress(sqlite3.Error, TypeError, ValueError):
            number, time = database.execute(query, (least,)).fetchone()
            return int(number), int(time)
        return None

    step = 1
    while (found := after(row + step)) is None:
        if row + 2 * step > _LAST:
            return None
        step *= 2
    low, high = row + step // 2, row + step
    while high - low > 1:
        middle = (low + high) // 2
        if (nearer := after(middle)) is None:
            low = middle
        else:
            high, found = middle, nearer
    return found


def _definitions(database: sqlite3.Connection) -> dict[str, MessageDefinition]:
    """Return the definitions of types; bags before ROS 2 Iron have none."""
    query = 'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
    with suppress(sqlite3.Error):
        return {
            kind: MessageDefinition(_FORMATS[form], text)
            for kind, form, text in database.execute(query)
            if form in _FORMATS and isinstance(text, str)
        }
    return {}
