"""Copies of messages of any type from one bag to another."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stdout, suppress
from types import SimpleNamespace
from typing import Any

from rosbags.convert.converter import create_connections_converters
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag2 import Writer

from ahf_ros.bag.definitions import TypeStores
from ahf_ros.bag.other_messages import OtherMessages
from ahf_ros.bag.source import Source, is_ros
from ahf_ros.text import reason_of

UNKNOWN_HASH = f'RIHS01_{0:064x}'
"""Hash of a type whose definition is missing or not accepted."""

_Target = tuple[Connection, Callable[[bytes], Any]]


class Copy:
    """Copies ROS 2 messages byte for byte, and converts ROS 1 messages to ROS 2.

    Parameters
    ----------
    source : Source
        Bag that is copied.
    writer : Writer
        Bag that is written. All topics of the source are added at once.
    others : OtherMessages
        Takes the messages that a ROS 2 bag cannot hold.

    Attributes
    ----------
    counts : Counter
        Number of messages written to the bag, by topic.
    """

    def __init__(self, source: Source, writer: Writer, others: OtherMessages) -> None:
        self._writer = writer
        self._others = others
        self._targets: dict[tuple[int, int], _Target] = {}
        self._reasons: dict[str, str] = {}  # by topic that cannot be converted
        self._refused: Counter[tuple[str, str]] = Counter()
        self.counts: Counter[str] = Counter()
        for item in source.connections:
            if isinstance(item.ext, ConnectionExtRosbag2):
                target: _Target | None = (_added(writer, item, source.stores), bytes)
            else:
                target = self._converted(item, source.stores)
            if target is not None:
                self._targets[item.id, id(item.owner)] = target

    @property
    def refused(self) -> list[str]:
        """ROS 1 messages that could not be converted to ROS 2, and why."""
        return [
            f'{topic}: {count} messages cannot be converted: {reason}'
            for (topic, reason), count in self._refused.items()
        ]

    def write(self, connection: Connection, timestamp: int, data: bytes) -> None:
        """Write a message of the source."""
        if not is_ros(connection):
            self._others.write(connection, timestamp, data)
            return
        target = self._targets.get((connection.id, id(connection.owner)))
        if target is None:
            self._refused[connection.topic, self._reasons[connection.topic]] += 1
            return
        written, convert = target
        try:
            converted = convert(data)
        except Exception as error:
            # With damaged messages, the generated code may raise anything.
            self._refused[connection.topic, reason_of(error)] += 1
            return
        self._writer.write(written, timestamp, converted)
        self.counts[connection.topic] += 1

    def _converted(self, item: Connection, stores: TypeStores) -> _Target | None:
        """Return the topic for ROS 1 messages and their converter; None if there is none."""
        try:
            reader: Any = SimpleNamespace(is2=False, typestore=stores.of(item))
            with redirect_stdout(sys.stderr):  # prints which types have a new name
                targets, converters = create_connections_converters(
                    [item], None, reader, self._writer
                )
        except Exception as error:
            # With bad definitions, the parser and the code generator may raise anything.
            self._reasons[item.topic] = reason_of(error)
            return None
        return targets[item.id, item.owner], converters[item.msgtype]


def _added(writer: Writer, item: Connection, stores: TypeStores) -> Connection:
    """Return the connection of a writer that equals the given one; add it if it is missing."""
    assert isinstance(item.ext, ConnectionExtRosbag2)
    for known in writer.connections:
        if (known.topic, known.msgtype, known.ext) == (item.topic, item.msgtype, item.ext):
            return known
    definition, digest = item.msgdef.data, item.digest
    undefined = item.msgdef.format == MessageDefinitionFormat.NONE
    with suppress(Exception):
        # Types that are not accepted are copied with the hash of unknown types.
        if undefined:
            definition, _ = stores.of(item).generate_msgdef(item.msgtype, ros_version=2)
        digest = digest or stores.of(item).hash_rihs01(item.msgtype)
    return writer.add_connection(
        item.topic,
        item.msgtype,
        msgdef=definition,
        rihs01=digest or UNKNOWN_HASH,
        serialization_format=item.ext.serialization_format,
        offered_qos_profiles=item.ext.offered_qos_profiles,
    )
