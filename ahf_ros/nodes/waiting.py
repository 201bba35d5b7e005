"""Messages that wait for their turn: in memory up to a limit, beyond it on disk."""

from __future__ import annotations

import shutil
import tempfile
import threading
from collections.abc import Callable
from functools import partial
from typing import Any, BinaryIO

from rclpy.serialization import deserialize_message, serialize_message

SEGMENT = 64 * 2**20
"""Size beyond which a file is not continued, bytes. Its space is free once all in it was taken."""

RESERVE = 256 * 2**20
"""Space of the disk that is left to others, bytes."""

Take = Callable[[], Any]
"""Returns the message that waited; called once."""


class _Segment:
    """A file without a name that holds messages one after the other."""

    def __init__(self) -> None:
        self.file: BinaryIO = tempfile.TemporaryFile()  # noqa: SIM115
        self.size = 0
        self.waiting = 0


class WaitingMessages:
    """Messages that wait, in bounded memory and without loss.

    The middleware keeps what a node does not take, without a bound that ROS 2 could set: a process
    that was slow to take 60 images of 10 MB grew by 490 MB. So the node takes every message at
    once, and those that exceed its memory wait in files.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._memory = 0
        self._segment: _Segment | None = None

    def put(self, message: Any, limit: int) -> Take:
        """Keep a message until it is taken.

        Parameters
        ----------
        message : sensor_msgs.msg.Image or sensor_msgs.msg.CompressedImage
        limit : int
            Memory that waiting messages may take together, bytes; one may always wait.

        Raises
        ------
        ValueError
            If it would have to wait on disk and there is no space.
        """
        size = len(message.data)
        with self._lock:
            if not self._memory or self._memory + size <= limit:
                self._memory += size
                return partial(self._taken, message, size)
        return self._written(type(message), serialize_message(message))

    def _taken(self, message: Any, size: int) -> Any:
        with self._lock:
            self._memory -= size
        return message

    def _written(self, kind: type, data: bytes) -> Take:
        free = shutil.disk_usage(tempfile.gettempdir()).free
        if free < len(data) + RESERVE:
            raise ValueError(
                f'the queue is full: queue_memory is used up and {tempfile.gettempdir()} has '
                f'{free} bytes left, accepted are at least {len(data) + RESERVE}'
            )
        with self._lock:
            segment = self._segment
            if segment is None or segment.size > SEGMENT:
                segment = self._segment = _Segment()
            place = segment.size
            segment.file.seek(place)
            segment.file.write(data)
            segment.size += len(data)
            segment.waiting += 1
        return partial(self._read, kind, segment, place, len(data))

    def _read(self, kind: type, segment: _Segment, place: int, size: int) -> Any:
        with self._lock:
            segment.file.seek(place)
            data = segment.file.read(size)
            segment.waiting -= 1
            if not segment.waiting:
                # Nothing in it waits: the next message that has to begins another file.
                segment.file.close()
                if segment is self._segment:
                    self._segment = None
        return deserialize_message(data, kind)
