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

from ahf_ros.bag.mcap_topics import NO_DEFINITION, tolerant_qos
from ahf_ros.bag.records import Lost, Message
from ahf_ros.text import reason_of

_FORMATS = {'ros2msg': MessageDefinitionFormat.MSG, 'ros2idl': MessageDefinitionFormat.IDL}
_LAST = 2**63 - 1  # that a row can have
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

    def messages(self, selected: list[Connection]) -> Iterator[Message | Lost]:
        """Yield the messages of some topics in the order of time; see `BagFile`."""
        yield from self._lost
        topics = {item.id: item for item in selected}
        rows = self._rows[np.isin(self._rows['topic'], list(topics))]
        with closing(self._open()) as database:
            for time, row, topic in rows.tolist():
                try:
                    query = 'SELECT data FROM messages WHERE id = ?'
                    (data,) = database.execute(query, (row,)).fetchone()
                    yield topics[topic], time, bytes(data)
                except (sqlite3.Error, TypeError) as error:
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
        return [
            Connection(
                number,
                topic,
                kind,
                definitions.get(kind, NO_DEFINITION),
                digest or '',
                0,
                ConnectionExtRosbag2(encoding, tolerant_qos(qos)),
                self,
            )
            for number, topic, kind, encoding, qos, digest in database.execute(
                f'SELECT id, name, type, serialization_format, {qos}, {digest} FROM topics'
            )
        ]

    def _scan(self, database: sqlite3.Connection) -> np.ndarray:
        """Return the rows that can be read, in the order of time."""
        rows: list[tuple[int, int, int]] = []
        following = 0
        query = 'SELECT timestamp, id, topic_id FROM messages WHERE id >= ? ORDER BY id'
        while True:
            try:
                for row in database.execute(query, (following,)):
                    time, number, topic = (int(it) for it in row)
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


def _readable(database: sqlite3.Connection, row: int) -> tuple[int, int] | None:
    """Return the next row behind a damage and its time, None where there is none."""

    def after(least: int) -> tuple[int, int] | None:
        query = 'SELECT id, timestamp FROM messages WHERE id >= ? ORDER BY id LIMIT 1'
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
            if form in _FORMATS
        }
    return {}
