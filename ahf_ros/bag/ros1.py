"""Bags of ROS 1: every record that is whole, whether the index of the file is there or not.

Format: http://wiki.ros.org/Bags/Format/2.0. The file is scanned chunk by chunk; the index that
follows a chunk says which topics it holds.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import Header, RecordType

from ahf_ros.bag.blocks import Block, Recorded, merged
from ahf_ros.bag.records import Lost, Message
from ahf_ros.text import reason_of

_MAGIC = b'#ROSBAG V2.0'
_LARGEST_HEADER = 2**24  # bytes; the longest holds the definition of a type


class Ros1:
    """A file .bag; see `BagFile`.

    Raises
    ------
    ValueError
        If it is not a bag of ROS 1.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._blocks: list[Block] = []
        self._lost: list[Lost] = []
        self._known: dict[int, Connection] = {}
        self.left_out: list[str] = []
        with path.open('rb') as file:
            if file.readline(64).rstrip() != _MAGIC:
                raise ValueError(f'{path} does not begin as a bag of ROS 1, version 2.0')
            self._scan(file, path.stat().st_size)
            self._learn(file)
        self.start = min((block.start for block in self._blocks), default=0)

    @property
    def connections(self) -> list[Connection]:
        """The topics, with the number of their messages where an index tells."""
        return [
            item._replace(
                msgcount=sum((block.channels or {}).get(item.id, 0) for block in self._blocks)
            )
            for _, item in sorted(self._known.items())
        ]

    def schema(self, connection: Connection) -> None:
        """Return None: only MCAP has schemas; see `BagFile`."""

    def messages(self, selected: list[Connection]) -> Iterator[Message | Lost]:
        """Yield the messages of some topics in the order of time; see `BagFile`."""
        yield from self._lost
        channels = {item.id: item for item in selected}
        yield from merged(
            self._path,
            self._blocks,
            channels,
            lambda file, block: self._entries(file, block, channels),
        )

    def _scan(self, file: BinaryIO, size: int) -> None:
        """Find the chunks and connections, up to the end or the first damage."""
        indexed = False
        while (place := file.tell()) < size:
            try:
                header, length = _head(file, size)
                start = file.tell()
                operation = header.get_uint8('op')
                if operation == RecordType.BAGHEADER:
                    indexed = header.get_uint64('index_pos') > 0
                elif operation == RecordType.CHUNK:
                    compression = header.get_string('compression')
                    uncompressed = header.get_uint32('size')
                    self._blocks.append(Block(start, length, 0, 0, compression, uncompressed))
                elif operation == RecordType.IDXDATA:
                    self._count(header.get_uint32('conn'), file.read(length))
                elif operation == RecordType.CONNECTION:
                    file.seek(place)
                    self._add(file)
                file.seek(start + length)
            except Exception as error:
                # Damaged records make the parser raise anything.
                self._lost.append(self._from_here(f'byte {place}: {reason_of(error)}'))
                return
        if not indexed:
            self._lost.append(self._from_here('the bag was not closed'))

    def _from_here(self, reason: str) -> Lost:
        return Lost((), max((it.stop for it in self._blocks), default=None), None, reason)

    def _add(self, file: BinaryIO) -> None:
        """Add the connection at the place of a file."""
        reader = Reader(self._path)
        reader.bio = file
        item = reader.read_connection()
        self._known.setdefault(item.id, item._replace(owner=self))

    def _count(self, channel: int, index: bytes) -> None:
        """Add the index of a connection to the chunk before it."""
        block = self._blocks[-1]
        whole = len(index) % 12 == 0
        entries = struct.iter_unpack('<LLL', index[: len(index) // 12 * 12])
        times = [second * 10**9 + nanosecond for second, nanosecond, _ in entries]
        if times and whole:
            first = block.channels is None
            block.start = min(times) if first else min(block.start, *times)
            block.stop = max(times) if first else max(block.stop, *times)
        block.count(channel, times, whole)

    def _learn(self, file: BinaryIO) -> None:
        """Read the chunks that no index describes, all where the index of the bag is damaged."""
        known = self._known
        self._known = {} if self._lost else dict(known)
        if self._lost and self._blocks:
            self._blocks[-1].distrust()
        for block in self._blocks:
            if block.channels is not None and all(it in self._known for it in block.channels):
                continue
            times = [item.recorded for item in self._all(file, block)]
            block.start, block.stop = min(times, default=0), max(times, default=0)
            block.channels = None
        self._known = known | self._known

    def _all(self, file: BinaryIO, block: Block) -> list[Recorded]:
        return [it for it in self._entries(file, block, None) if isinstance(it, Recorded)]

    def _entries(
        self, file: BinaryIO, block: Block, selected: dict[int, Connection] | None
    ) -> Iterator[Recorded | Lost]:
        """Yield the messages of a chunk, up to the damage; all if `selected` is None."""
        time = block.start
        number = 0
        try:
            content = block.content(file)
            records = io.BytesIO(content)
            while (number := records.tell()) < len(content):
                header, length = _head(records, len(content))
                data = records.read(length)
                if header.get_uint8('op') == RecordType.CONNECTION:
                    end = records.tell()
                    records.seek(number)
                    self._add(records)
                    records.seek(end)
                    continue
                channel, recorded = header.get_uint32('conn'), header.get_time('time')
                time = max(recorded, block.start)  # so that blocks can be merged
                item = self._known.get(channel)
                if item is None:
                    yield Lost((), recorded, recorded, f'connection {channel} is not defined')
                elif selected is None or channel in selected:
                    item = item if selected is None else selected[channel]
                    yield Recorded(time, block.offset, number, item, recorded, data)
        except Exception as error:
            # Damaged records make the parser raise anything.
            known = self._known if block.channels is None else block.channels
            topics = {self._known[it].topic for it in known if it in self._known}
            yield Lost(tuple(sorted(topics)), time, max(block.stop, time), reason_of(error))


def _head(file: BinaryIO, end: int) -> tuple[Header, int]:
    """Return the header of the record at the place of a file, and the length of its data."""
    place = file.tell()
    (size,) = struct.unpack('<L', file.read(4))
    if size > min(end - place, _LARGEST_HEADER):
        raise ValueError('the file ends within a record')
    file.seek(place)
    header = Header.read(file)
    (length,) = struct.unpack('<L', file.read(4))
    if file.tell() + length > end:
        raise ValueError('the file ends within a record')
    return header, length
