"""Bags without an end: what a recorder that died or a disk that was full has left.

The library rosbags refuses them. The readers here find the messages that are whole.
"""

from __future__ import annotations

import io
import sqlite3
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rosbags.highlevel import AnyReader
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
)
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1.reader import Chunk, Header, IndexData, RecordType, decompressors, read_uint32
from rosbags.rosbag2 import Reader as Reader2
from rosbags.rosbag2.metadata import parse_qos
from rosbags.typesys.store import Typestore

SUFFIXES = ('.bag', '.db3', '.mcap')
"""Endings of the files that hold messages."""


def open_cut(path: Path, default: Typestore, reason: str) -> AnyReader:
    """Open what is left of a bag.

    Parameters
    ----------
    path : Path
        Folder or file.
    default : Typestore
        The messages, where the bag does not define them.
    reason : str
        Why it cannot be opened as others are, for the error.

    Raises
    ------
    ValueError
        If nothing is left; the message names the bag and says why.
    """
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    files = [file for file in files if file.suffix in SUFFIXES]
    if not files:
        raise ValueError(f'{path} is not a bag: {reason}')
    try:
        reader = AnyReader(files, default_typestore=default)
        reader.readers = [_reader(file) for file in files]
        reader.open()
    except Exception as error:
        raise ValueError(f'{path} cannot be read: {reason}') from error
    return reader


def _reader(file: Path) -> Any:
    """Return the reader of a file, the usual one where the file is whole."""
    usual = Reader1 if file.suffix == '.bag' else Reader2
    try:
        with usual(file):
            return usual(file)
    except Exception:
        cut = {'.bag': CutRos1, '.db3': CutSqlite, '.mcap': CutMcap}
        return cut[file.suffix](file)


class CutRos1(Reader1):
    """Bag of ROS 1 whose index is missing: found again in the chunks that are whole."""

    def open(self) -> None:
        """Read all chunks, and make the index of them."""
        self.bio = self.path.open('rb')
        end = self.path.stat().st_size
        self.bio.readline()
        while (place := self.bio.tell()) < end:
            try:
                header = Header.read(self.bio)
                size = read_uint32(self.bio)
            except Exception:
                break
            start = self.bio.tell()
            if start + size > end:
                break
            if header.get_uint8('op') == RecordType.CHUNK:
                decompress = decompressors[header.get_string('compression')]
                self.chunks[place] = Chunk(size, start, decompress)
                self._index(place, decompress(self.bio.read(size)))
            self.bio.seek(start + size)
        self.connections = [
            item._replace(msgcount=len(self.indexes[item.id])) for item in self.connections
        ]

    def _index(self, place: int, content: bytes) -> None:
        """Note the connections and the messages of a chunk."""
        file, self.bio = self.bio, io.BytesIO(content)
        while (offset := self.bio.tell()) < len(content):
            header = Header.read(self.bio)
            size = read_uint32(self.bio)
            end = self.bio.tell() + size
            number = header.get_uint32('conn')
            if header.get_uint8('op') == RecordType.MSGDATA:
                item = IndexData(header.get_time('time'), place, offset)
                self.indexes[number].append(item)
            elif number not in self.indexes:
                self.bio.seek(offset)
                self.connections.append(self.read_connection())
                self.indexes[number] = []
            self.bio.seek(end)
        self.bio = file


class CutMcap(Reader2):
    """MCAP file without a summary: given one that is empty behind its last whole record."""

    def __init__(self, path: Path) -> None:
        ended: Any = _Ended(path)  # all that rosbags asks of a path
        super().__init__(ended)


class _Ended:
    """Path of a file that ends, when opened, with the last whole record and an empty summary."""

    _FOOTER = b'\x02' + (20).to_bytes(8, 'little') + bytes(20) + b'\x89MCAP0\r\n'
    _DATA_END = 0x0F
    _MAGIC = 8  # bytes before the first record

    def __init__(self, path: Path) -> None:
        self.suffix = path.suffix
        self._path = path

    def __str__(self) -> str:
        return str(self._path)

    def exists(self) -> bool:
        return self._path.exists()

    def is_dir(self) -> bool:
        return False

    def open(self, *_: Any) -> io.BufferedReader:
        return io.BufferedReader(_Joined(self._path, self._end(), self._FOOTER))

    def _end(self) -> int:
        """Return where the last whole record ends."""
        size = self._path.stat().st_size
        place = self._MAGIC
        with self._path.open('rb') as file:
            while True:
                file.seek(place)
                head = file.read(9)
                following = place + 9 + int.from_bytes(head[1:], 'little')
                if len(head) < 9 or head[0] == self._DATA_END or following > size:
                    return place
                place = following


class _Joined(io.RawIOBase):
    """The first bytes of a file and others behind them, read as one file."""

    def __init__(self, path: Path, end: int, tail: bytes) -> None:
        self._file = path.open('rb')
        self._end = end
        self._tail = tail
        self._place = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        origin = (0, self._place, self._end + len(self._tail))[whence]
        self._place = origin + offset
        return self._place

    def readinto(self, buffer: Any) -> int:
        if self._place < self._end:
            self._file.seek(self._place)
            found = self._file.read(min(len(buffer), self._end - self._place))
        else:
            start = self._place - self._end
            found = self._tail[start : start + len(buffer)]
        buffer[: len(found)] = found
        self._place += len(found)
        return len(found)

    def close(self) -> None:
        self._file.close()
        super().close()


class CutSqlite:
    """SQLite file of which pages are missing: its messages in the order of their recording."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.connections: list[Connection] = []

    def __enter__(self) -> CutSqlite:
        """Open the file."""
        address = f'file:{quote(str(self._path))}?mode=ro&immutable=1'
        self._database = sqlite3.connect(address, uri=True)
        # Without it SQLite refuses a file that is shorter than its header says.
        self._database.execute('PRAGMA writable_schema=ON')
        rows = self._database.execute(
            'SELECT id, name, type, serialization_format, offered_qos_profiles FROM topics'
        ).fetchall()
        definitions = self._definitions()
        for number, topic, kind, form, qos in rows:
            extension = ConnectionExtRosbag2(form, parse_qos(qos))
            definition = definitions.get(kind, MessageDefinition(MessageDefinitionFormat.NONE, ''))
            self.connections.append(
                Connection(number, topic, kind, definition, '', 0, extension, self)
            )
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._database.close()

    def messages(
        self, connections: Collection[Connection], start: int | None, stop: int | None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield the messages of connections up to the first page that is missing."""
        wanted = {item.id: item for item in connections}
        for number, time, data in self._database.execute(
            'SELECT topic_id, timestamp, data FROM messages ORDER BY id'
        ):
            if number in wanted:
                yield wanted[number], time, data

    def _definitions(self) -> dict[str, MessageDefinition]:
        forms = {'ros2msg': MessageDefinitionFormat.MSG, 'ros2idl': MessageDefinitionFormat.IDL}
        try:
            rows = self._database.execute(
                'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
            ).fetchall()
        except sqlite3.DatabaseError:  # older than ROS 2 Iron
            return {}
        return {kind: MessageDefinition(forms[form], text) for kind, form, text in rows}
