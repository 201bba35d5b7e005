"""The messages of a bag in another one, whatever they are."""

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
from ahf_ros.bag.records import reason_of
from ahf_ros.bag.source import Source

UNKNOWN_HASH = f'RIHS01_{0:064x}'
"""Of a type whose definition is missing or not accepted."""

_Target = tuple[Connection, Callable[[bytes], Any]]


class Copy:
    """Copies messages: those of ROS 2 byte for byte, those of ROS 1 as ROS 2 serializes them.

    Parameters
    ----------
    source : Source
        Where they come from.
    writer : Writer
        Gets all topics of the source now, and its messages by `write`.

    Attributes
    ----------
    counts : Counter
        Number of messages that were written, by topic.
    """

    def __init__(self, source: Source, writer: Writer) -> None:
        self._writer = writer
        self._targets: dict[tuple[int, int], _Target] = {}
        self._reasons: dict[str, str] = {}  # by topics that are not accepted
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
        """Messages of ROS 1 that have no counterpart in ROS 2, and why."""
        return [
            f'{topic}: {count} messages cannot be converted: {reason}'
            for (topic, reason), count in self._refused.items()
        ]

    def write(self, connection: Connection, timestamp: int, data: bytes) -> None:
        """Write a message of the source."""
        target = self._targets.get((connection.id, id(connection.owner)))
        if target is None:
            self._refused[connection.topic, self._reasons[connection.topic]] += 1
            return
        written, convert = target
        try:
            converted = convert(data)
        except Exception as error:
            # Damaged messages make the generated code raise anything.
            self._refused[connection.topic, reason_of(error)] += 1
            return
        self._writer.write(written, timestamp, converted)
        self.counts[connection.topic] += 1

    def _converted(self, item: Connection, stores: TypeStores) -> _Target | None:
        """Return where messages of ROS 1 go to and how; None if their type is not accepted."""
        try:
            reader: Any = SimpleNamespace(is2=False, typestore=stores.of(item))
            with redirect_stdout(sys.stderr):  # it tells of types that have a new name
                targets, converters = create_connections_converters(
                    [item], None, reader, self._writer
                )
        except Exception as error:
            # The parser and the generator of code raise anything for what is no definition.
            self._reasons[item.topic] = reason_of(error)
            return None
        return targets[item.id, item.owner], converters[item.msgtype]


def _added(writer: Writer, item: Connection, stores: TypeStores) -> Connection:
    """Return the connection of a writer that is as the given one, added where it is missing."""
    assert isinstance(item.ext, ConnectionExtRosbag2)
    for known in writer.connections:
        if (known.topic, known.msgtype, known.ext) == (item.topic, item.msgtype, item.ext):
            return known
    definition, digest = item.msgdef.data, item.digest
    with suppress(Exception):
        # A type that is not accepted is copied under the hash of an unknown one.
        store = stores.of(item)
        if item.msgdef.format == MessageDefinitionFormat.NONE:
            definition, _ = store.generate_msgdef(item.msgtype, ros_version=2)
        digest = digest or store.hash_rihs01(item.msgtype)
    return writer.add_connection(
        item.topic,
        item.msgtype,
        msgdef=definition,
        rihs01=digest or UNKNOWN_HASH,
        serialization_format=item.ext.serialization_format,
        offered_qos_profiles=item.ext.offered_qos_profiles,
    )
