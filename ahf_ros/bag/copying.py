"""The messages of a bag in another one, whatever they are."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from typing import Any

from rosbags.convert.converter import create_connections_converters
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag2 import Writer
from rosbags.typesys.store import Typestore

from ahf_ros.bag.source import Source

UNKNOWN_HASH = f'RIHS01_{0:064x}'
"""Of a type that a bag uses but does not define."""


class Copy:
    """Copies messages: those of ROS 2 byte for byte, those of ROS 1 as ROS 2 serializes them.

    Parameters
    ----------
    source : Source
        Where they come from.
    writer : Writer
        Gets all topics of the source now, and its messages by `write`.
    """

    def __init__(self, source: Source, writer: Writer) -> None:
        self._writer = writer
        if source.is_ros2:
            self._converters: dict[str, Any] = {}
            self._targets = {
                (item.id, id(item.owner)): _added(writer, item, source.typestore)
                for item in source.connections
            }
            return
        with redirect_stdout(sys.stderr):  # it tells of types that have a new name
            targets, self._converters = create_connections_converters(
                source.connections, None, source.reader, writer
            )
        self._targets = {(number, id(owner)): it for (number, owner), it in targets.items()}

    def write(self, connection: Connection, timestamp: int, data: bytes) -> None:
        """Write a message of the source."""
        convert = self._converters.get(connection.msgtype, memoryview)
        target = self._targets[connection.id, id(connection.owner)]
        self._writer.write(target, timestamp, convert(data))


def _added(writer: Writer, item: Connection, store: Typestore) -> Connection:
    """Return the connection of a writer that is as the given one, added where it is missing."""
    assert isinstance(item.ext, ConnectionExtRosbag2)
    for known in writer.connections:
        if (known.topic, known.msgtype, known.ext) == (item.topic, item.msgtype, item.ext):
            return known
    definition, digest = item.msgdef.data, item.digest
    if item.msgtype in store.fielddefs:
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
