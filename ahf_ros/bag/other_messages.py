"""Messages that a ROS 2 bag cannot hold, such as JSON and Protobuf, in an MCAP file beside it.

A bag with topics that are serialized in several ways is refused by `ros2 bag` and by rosbags. The
file has the schemas, channels and bytes of the source. Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
from collections import Counter
from pathlib import Path
from typing import BinaryIO

from rosbags.interfaces import Connection

from ahf_ros.bag.mcap import MAGIC, Mcap
from ahf_ros.bag.records import BagFile, Schema
from ahf_ros.bag.source import encoding

NAME = 'other_messages.mcap'
"""Name of the file in the folder of a bag; metadata.yaml does not list it."""

_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE = 0x01, 0x02, 0x03, 0x04, 0x05
_STATISTICS, _DATA_END = 0x0B, 0x0F


class OtherMessages:
    """The file, which is created with the first message.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    counts : Counter
        Number of messages by topic and serialization.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: BinaryIO | None = None
        self._numbers: dict[tuple[int, int], int] = {}  # of the channels
        self._definitions: list[bytes] = []  # records of schemas and channels
        self._schemas = 0
        self._written: Counter[int] = Counter()
        self._times: list[int] = []  # first and last
        self.counts: Counter[tuple[str, str]] = Counter()

    @property
    def described(self) -> list[str]:
        """A line about each topic in the file."""
        return [
            f'{topic}: {count} messages, serialized as {how}, are in {NAME}'
            for (topic, how), count in self.counts.items()
        ]

    def __enter__(self) -> OtherMessages:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Complete and close the file."""
        if self._file is None:
            return
        with self._file as file:
            file.write(_record(_DATA_END, bytes(4)))
            summary = file.tell()
            file.write(b''.join(self._definitions) + self._statistics())
            file.write(_record(_FOOTER, struct.pack('<QQI', summary, 0, 0)) + MAGIC)

    def write(self, connection: Connection, timestamp: int, data: bytes) -> None:
        """Write a message of a source at a time in ns."""
        if self._file is None:
            self._file = self._path.open('xb')
            self._file.write(MAGIC + _record(_HEADER, _text('') + _text('ahf_ros')))
        key = connection.id, id(connection.owner)
        if key not in self._numbers:
            self._file.write(self._defined(connection, key))
        number = self._numbers[key]
        head = struct.pack('<HIQQ', number, 0, timestamp, timestamp)
        self._file.write(_record(_MESSAGE, head + data))
        self._written[number] += 1
        self.counts[connection.topic, encoding(connection)] += 1
        times = [*self._times, timestamp]
        self._times = [min(times), max(times)]

    def _defined(self, connection: Connection, key: tuple[int, int]) -> bytes:
        """Return the records that define a new channel."""
        owner: BagFile = connection.owner  # type: ignore[assignment]
        schema = owner.schema(connection)
        records = []
        if schema is not None:
            self._schemas += 1
            records.append(_schema(self._schemas, schema))
        self._numbers[key] = number = len(self._numbers)
        head = struct.pack('<HH', number, self._schemas if schema else 0)
        texts = _text(connection.topic) + _text(encoding(connection)) + _text('')
        records.append(_record(_CHANNEL, head + texts))
        self._definitions += records
        return b''.join(records)

    def _statistics(self) -> bytes:
        counts = b''.join(struct.pack('<HQ', *it) for it in sorted(self._written.items()))
        channels = len(self._numbers)
        head = struct.pack(
            '<QHIIIIQQ', self._written.total(), self._schemas, channels, 0, 0, 0, *self._times
        )
        return _record(_STATISTICS, head + struct.pack('<I', len(counts)) + counts)


def check_others(path: Path, count: int) -> None:
    """Raise a ValueError unless a file holds a number of messages, an OSError if it is missing."""
    found = sum(item.msgcount for item in Mcap(path).connections)
    if found != count:
        raise ValueError(f'{path.name} has {found} of {count} messages')


def _schema(number: int, schema: Schema) -> bytes:
    texts = _text(schema.name) + _text(schema.encoding)
    return _record(_SCHEMA, struct.pack('<H', number) + texts + _sized(schema.data))


def _text(value: str) -> bytes:
    return _sized(value.encode())


def _sized(data: bytes) -> bytes:
    return struct.pack('<I', len(data)) + data


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack('<BQ', opcode, len(content)) + content
