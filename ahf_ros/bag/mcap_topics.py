"""Schemas and channels of MCAP files as the connections of rosbags."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    Qos,
)
from rosbags.rosbag2.metadata import parse_qos

from ahf_ros.bag.records import Schema

_FORMATS = {
    'ros2msg': MessageDefinitionFormat.MSG,
    'ros2idl': MessageDefinitionFormat.IDL,
    'omgidl': MessageDefinitionFormat.IDL,
}
NO_DEFINITION = MessageDefinition(MessageDefinitionFormat.NONE, '')
_LONGEST_QOS = 2**16  # characters; what takes a second to parse
_NO_SCHEMA = Schema('', '', b'')


class _Channel(NamedTuple):
    schema: int
    topic: str
    encoding: str
    metadata: dict[str, str]


class Topics:
    """The schemas and channels of a file.

    Parameters
    ----------
    owner : object
        The file, for the connections.
    """

    def __init__(self, owner: object) -> None:
        self._owner = owner
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, _Channel] = {}

    def add_schema(self, content: bytes) -> None:
        """Add the schema of a record, unless it is known."""
        (number,) = struct.unpack_from('<H', content)
        name, place = _string(content, 2)
        encoding, place = _string(content, place)
        data, _ = _bytes(content, place)
        self._schemas.setdefault(number, Schema(name, encoding, data))

    def add_channel(self, content: bytes) -> None:
        """Add the channel of a record, unless it is known."""
        number, schema = struct.unpack_from('<HH', content)
        topic, place = _string(content, 4)
        encoding, place = _string(content, place)
        metadata, _ = _bytes(content, place)
        pairs = {}
        place = 0
        while place < len(metadata):
            key, place = _string(metadata, place)
            pairs[key], place = _string(metadata, place)
        self._channels.setdefault(number, _Channel(schema, topic, encoding, pairs))

    def schema(self, channel: int) -> Schema | None:
        """Return the schema of a channel, None where there is none."""
        return self._schemas.get(self._channels[channel].schema)

    def know(self, channels: Iterable[int] | None) -> bool:
        """Return whether all of some channels are defined, False where they are not known."""
        return channels is not None and all(number in self._channels for number in channels)

    def names(self, channels: Iterable[int] | None) -> tuple[str, ...]:
        """Return the topics of some channels, or all where they are not known."""
        selected = self._channels if channels is None else channels
        topics = {self._channels[it].topic for it in selected if it in self._channels}
        return tuple(sorted(topics))

    def connections(self, counts: Mapping[int, int]) -> list[Connection]:
        """Return the channels as connections with the given numbers of messages."""
        return [
            self._connection(number, channel, counts.get(number, 0))
            for number, channel in sorted(self._channels.items())
        ]

    def _connection(self, number: int, channel: _Channel, count: int) -> Connection:
        schema = self._schemas.get(channel.schema, _NO_SCHEMA)
        qos = tolerant_qos(channel.metadata.get('offered_qos_profiles', ''))
        digest = channel.metadata.get('topic_type_hash', '')
        extension = ConnectionExtRosbag2(channel.encoding, qos)
        definition = _definition(schema)
        return Connection(
            number, channel.topic, schema.name, definition, digest, count, extension, self._owner
        )


def _definition(schema: Schema) -> MessageDefinition:
    """Return a schema for rosbags, without a definition where it is in no language of ROS."""
    with suppress(UnicodeDecodeError, KeyError):
        return MessageDefinition(_FORMATS[schema.encoding], schema.data.decode())
    return NO_DEFINITION


def tolerant_qos(text: Any) -> list[Qos]:
    """Return the QoS that publishers offered, none where it is not as ROS writes it."""
    if isinstance(text, str) and len(text) > _LONGEST_QOS:
        return []
    try:
        return parse_qos(text)
    except Exception:
        # Text of others makes the parser raise anything, and no message depends on it.
        return []


def name_at(content: bytes, place: int = 0) -> str:
    """Return the text at a place of a record."""
    return _string(content, place)[0]


def _string(content: bytes, place: int) -> tuple[str, int]:
    text, end = _bytes(content, place)
    return text.decode(errors='replace'), end


def _bytes(content: bytes, place: int) -> tuple[bytes, int]:
    """Return the bytes whose number comes first, and where they end."""
    (size,) = struct.unpack_from('<I', content, place)
    end = place + 4 + size
    if end > len(content):
        raise ValueError('a record is shorter than what it holds')
    return content[place + 4 : end], end
