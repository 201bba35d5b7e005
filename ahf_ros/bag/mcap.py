"""MCAP files: every record that is whole, whether the index of the file is there or not.

Format: https://mcap.dev/spec. The file is scanned once, record by record, without reading what
is in its chunks, so neither a missing nor a wrong index decides what is read. Where a record is
damaged, reading goes on at the next chunk that the index of the file lists.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO
from zlib import crc32

from rosbags.interfaces import Connection

from ahf_ros.bag.blocks import Block, Recorded, merged
from ahf_ros.bag.mcap_topics import Topics, name_at
from ahf_ros.bag.records import Lost, Message, Schema

MAGIC = b'\x89MCAP0\r\n'

_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x02, 0x03, 0x04, 0x05, 0x06
_MESSAGE_INDEX, _CHUNK_INDEX, _ATTACHMENT, _METADATA = 0x07, 0x08, 0x09, 0x0C
_LAST_STANDARD, _FIRST_PRIVATE = 0x0F, 0x80
_HEAD = 9  # bytes of opcode and length
_MESSAGE_HEADER = 22
_TAIL = _HEAD + 20 + len(MAGIC)  # footer and magic
_STRETCH = 2**20  # bytes of messages outside of chunks that are read at once
_OWN_METADATA = 'rosbag2'  # a copy of metadata.yaml


class Mcap:
    """An MCAP file; see `BagFile`.

    Raises
    ------
    ValueError
        If the file is not an MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._topics = Topics(self)
        self._blocks: list[Block] = []
        self._lost: list[Lost] = []
        self._differs = False  # whether messages have publish times or sequence numbers
        self._others: list[str] = []  # attachments and metadata
        with path.open('rb') as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise ValueError(f'{path} does not begin as an MCAP file')
            size = file.seek(0, io.SEEK_END)
            self._scan(file, size, _chunk_offsets(file, size))
            self._learn(file)
        self.start = min((block.start for block in self._blocks), default=0)

    @property
    def connections(self) -> list[Connection]:
        """The topics, with the number of their messages where an index tells."""
        counts: dict[int, int] = {}
        for block in self._blocks:
            for channel, count in (block.channels or {}).items():
                counts[channel] = counts.get(channel, 0) + count
        return self._topics.connections(counts)

    @property
    def left_out(self) -> list[str]:
        """What a copy does not have; complete once the messages were read."""
        times = ['publish times and sequence numbers'] if self._differs else []
        return self._others + times

    def schema(self, connection: Connection) -> Schema | None:
        """Return the schema of a topic; see `BagFile`."""
        return self._topics.schema(connection.id)

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

    def _scan(self, file: BinaryIO, size: int, chunks: list[int]) -> None:
        """Find the blocks, schemas and channels, from the beginning to the footer."""
        place = len(MAGIC)
        while place < size:
            try:
                opcode, length = _head(file, place, size)
                if opcode == _FOOTER:
                    return
                self._note(file, opcode, place, length)
                place += _HEAD + length
            except (ValueError, struct.error) as error:
                if self._blocks:
                    self._blocks[-1].distrust()
                following = next((it for it in chunks if it > place), None)
                after = None if following is None else _start(file, following)
                self._lost.append(Lost((), self._latest(), after, f'byte {place}: {error}'))
                if following is None:
                    return
                place = following
        if self._blocks:
            self._blocks[-1].distrust()
        self._lost.append(Lost((), self._latest(), None, 'the file has no end'))

    def _latest(self) -> int | None:
        return max((block.stop for block in self._blocks), default=None)

    def _note(self, file: BinaryIO, opcode: int, place: int, length: int) -> None:
        """Take note of a record."""
        if opcode == _CHUNK:
            self._blocks.append(_chunk(file, place + _HEAD, length))
        elif opcode == _MESSAGE:
            self._note_message(file, place, length)
        elif opcode == _MESSAGE_INDEX:
            self._count(file.read(length))
        elif opcode == _SCHEMA:
            self._topics.add_schema(file.read(length))
        elif opcode == _CHANNEL:
            self._topics.add_channel(file.read(length))
        elif opcode == _ATTACHMENT:
            self._others.append(f'attachment {name_at(file.read(length), 16)!r}')
        elif opcode == _METADATA and (name := name_at(file.read(length))) != _OWN_METADATA:
            self._others.append(f'metadata {name!r}')

    def _note_message(self, file: BinaryIO, place: int, length: int) -> None:
        """Add a message outside of chunks to the block that it continues."""
        if length < _MESSAGE_HEADER:
            raise ValueError(f'a message has {length} bytes')
        channel, _, time = struct.unpack('<HIQ', file.read(14))
        last = self._blocks[-1] if self._blocks else None
        joined = last and last.offset + last.size == place and last.uncompressed == 0
        if last is None or not joined or last.size > _STRETCH:
            last = Block(place, 0, time, time)
            self._blocks.append(last)
        last.size += _HEAD + length
        last.start, last.stop = min(last.start, time), max(last.stop, time)
        last.count(channel, (time,), True)

    def _count(self, index: bytes) -> None:
        """Add the index of a channel to the chunk before it."""
        block = self._blocks[-1] if self._blocks else None
        if block is not None and block.uncompressed:
            channel, size = struct.unpack_from('<HI', index)
            pairs = struct.iter_unpack('<QQ', index[6 : 6 + (len(index) - 6) // 16 * 16])
            block.count(channel, [time for time, _ in pairs], size == len(index) - 6)

    def _learn(self, file: BinaryIO) -> None:
        """Read the schemas and channels in chunks whose channels the summary does not define."""
        for block in self._blocks:
            if block.uncompressed and not self._topics.know(block.channels):
                with suppress(ValueError, struct.error):  # told where its messages are read
                    for opcode, content in _records(_content(file, block)):
                        if opcode == _SCHEMA:
                            self._topics.add_schema(content)
                        elif opcode == _CHANNEL:
                            self._topics.add_channel(content)

    def _entries(
        self, file: BinaryIO, block: Block, selected: dict[int, Connection]
    ) -> Iterator[Recorded | Lost]:
        """Yield the messages of a block, up to where it is damaged."""
        time = block.start
        try:
            for number, (opcode, content) in enumerate(_records(_content(file, block))):
                if opcode != _MESSAGE:
                    continue
                channel, sequence, recorded, published = struct.unpack_from('<HIQQ', content)
                if recorded >= 2**63:
                    yield Lost((), None, None, f'{recorded} ns is not a time')
                    continue
                time = max(recorded, block.start)  # so that blocks can be merged
                self._differs |= sequence != 0 or published != recorded
                if channel in selected:
                    data = content[_MESSAGE_HEADER:]
                    yield Recorded(time, block.offset, number, selected[channel], recorded, data)
                elif not self._topics.know((channel,)):
                    yield Lost((), recorded, recorded, f'channel {channel} is not defined')
        except (ValueError, struct.error) as error:
            topics = self._topics.names(block.channels)
            yield Lost(topics, time, max(block.stop, time), str(error))


def _head(file: BinaryIO, place: int, size: int) -> tuple[int, int]:
    """Return opcode and length of the record at a place, and seek its content."""
    file.seek(place)
    head = file.read(_HEAD)
    if len(head) < _HEAD:
        raise ValueError('the file ends within a record')
    opcode, length = struct.unpack('<BQ', head)
    if opcode == 0 or _LAST_STANDARD < opcode < _FIRST_PRIVATE:
        raise ValueError(f'{opcode:#04x} is the opcode of no record')
    if place + _HEAD + length > size:
        raise ValueError('the file ends within a record')
    return opcode, length


def _chunk(file: BinaryIO, start: int, length: int) -> Block:
    """Return the block of a chunk record."""
    earliest, latest, uncompressed, crc, size = struct.unpack('<QQQII', file.read(32))
    if size > 16:
        raise ValueError(f'the name of a compression has {size} bytes')
    compression = file.read(size).decode(errors='replace')
    (compressed,) = struct.unpack('<Q', file.read(8))
    offset = start + 40 + size
    if offset + compressed != start + length or not uncompressed:
        raise ValueError('the header of a chunk is damaged')
    return Block(offset, compressed, earliest, latest, compression, uncompressed, crc)


def _content(file: BinaryIO, block: Block) -> bytes:
    """Return the records of a block, see `Block.content`."""
    content = block.content(file)
    if block.crc and crc32(content) != block.crc:
        raise ValueError('the checksum of a chunk is wrong')
    return content


def _records(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record in a block."""
    place = 0
    while place < len(content):
        opcode, length = struct.unpack_from('<BQ', content, place)
        place += _HEAD
        if opcode not in (_SCHEMA, _CHANNEL, _MESSAGE) or place + length > len(content):
            raise ValueError('a record in a chunk is damaged')
        yield opcode, content[place : place + length]
        place += length


def _chunk_offsets(file: BinaryIO, size: int) -> list[int]:
    """Return where chunks begin, as the index of the file tells; empty where there is none."""
    offsets: list[int] = []
    with suppress(ValueError, struct.error, OSError):
        file.seek(size - _TAIL)
        (place,) = struct.unpack_from('<Q', file.read(_TAIL), _HEAD)
        while place:
            opcode, length = _head(file, place, size)
            if opcode == _CHUNK_INDEX:
                offsets.append(struct.unpack('<QQQ', file.read(24))[2])
            place = 0 if opcode == _FOOTER else place + _HEAD + length
    return sorted(it for it in offsets if len(MAGIC) <= it < size)


def _start(file: BinaryIO, place: int) -> int | None:
    """Return the time at which the chunk at a place starts, None where there is no chunk."""
    file.seek(place)
    record = file.read(_HEAD + 8)
    if len(record) < _HEAD + 8 or record[0] != _CHUNK:
        return None
    return int.from_bytes(record[_HEAD:], 'little')
