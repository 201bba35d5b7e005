"""Blocks of messages, which overlap in time, as one sequence of messages in the order of time."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

from rosbags.interfaces import Connection

from ahf_ros.bag.compression import LARGEST, decompress
from ahf_ros.bag.records import Lost, Message


@dataclass(slots=True)
class Block:
    """Records that are stored together: a chunk, or messages that follow each other.

    Attributes
    ----------
    offset, size : int
        Of its records in the file, as they are stored, bytes.
    start, stop : int
        Earliest and latest time of a message, ns.
    compression : str
        For `decompress`.
    uncompressed : int
        Size of the records of a chunk before compression, bytes; 0 outside of chunks.
    crc : int
        CRC-32 of the records before compression; 0 where it is not known.
    channels : dict of int to int or None
        Number of messages by channel; None where no index tells, or a wrong one.
    doubtful : bool
        Whether an index of the chunk is wrong.
    """

    offset: int
    size: int
    start: int
    stop: int
    compression: str = ''
    uncompressed: int = 0
    crc: int = 0
    channels: dict[int, int] | None = None
    doubtful: bool = False

    def count(self, channel: int, times: Collection[int], whole: bool) -> None:
        """Add what the index of a channel tells, unless it cannot be right."""
        self.doubtful |= not (whole and all(self.start <= time <= self.stop for time in times))
        channels = self.channels or {}
        channels = channels | {channel: channels.get(channel, 0) + len(times)}
        self.channels = None if self.doubtful else channels

    def distrust(self) -> None:
        """Forget what the index tells: a part of it is missing."""
        self.doubtful, self.channels = True, None

    def content(self, file: BinaryIO) -> bytes:
        """Return its records.

        Raises
        ------
        ValueError
            If they are damaged or larger than `LARGEST`.
        """
        size = max(self.size, self.uncompressed)
        if size > LARGEST:
            raise ValueError(f'a chunk has {size} bytes, accepted are at most {LARGEST}')
        file.seek(self.offset)
        stored = file.read(self.size)
        if not self.uncompressed:
            return stored
        content = decompress(stored, self.compression, self.uncompressed)
        if len(content) != self.uncompressed:
            raise ValueError(
                f'a chunk has {len(content)} bytes, its header says {self.uncompressed}'
            )
        return content


class Recorded(NamedTuple):
    """A message in the order in which it is yielded."""

    time: int
    block: int
    number: int
    connection: Connection
    recorded: int
    data: bytes


Load = Callable[[BinaryIO, Block], Iterable[Recorded | Lost]]
"""Yields the messages of a block, none of them before its start."""


def merged(
    path: Path, blocks: Iterable[Block], channels: Collection[int], load: Load
) -> Iterator[Message | Lost]:
    """Yield the messages of the blocks that hold some channels in the order of time."""
    waiting: list[Recorded] = []
    with path.open('rb') as file:
        for block in sorted(blocks, key=lambda block: (block.start, block.offset)):
            if block.channels is not None and not any(it in block.channels for it in channels):
                continue
            while waiting and waiting[0].time < block.start:
                yield heapq.heappop(waiting)[3:]
            for item in load(file, block):
                if isinstance(item, Lost):
                    yield item
                else:
                    heapq.heappush(waiting, item)
        while waiting:
            yield heapq.heappop(waiting)[3:]
