"""Bags as they are read: every message in the order of time, up to where a bag is cut."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection
from rosbags.typesys.store import Typestore

from ahf_ros.bag.cut import open_cut
from ahf_ros.bag.definitions import COMPRESSED_IMAGE, IMAGE, typestore

Message = tuple[Connection, int, bytes]
"""A message as it was recorded: where from, when in ns, and what."""


class Source:
    """A bag of ROS 1 or ROS 2 that is open for reading.

    Parameters
    ----------
    path : Path
        Folder of a bag of ROS 2, one of its files (.db3, .mcap), or a bag of ROS 1 (.bag).

    Attributes
    ----------
    cut : str
        Why the end of the bag cannot be read, empty as long as nothing is missing.

    Raises
    ------
    ValueError
        If nothing can be read; the message names the bag.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.cut = ''
        if not path.exists():
            raise ValueError(f'{path} does not exist, accepted is a bag')
        try:
            self._reader = AnyReader([path], default_typestore=typestore())
            self._reader.open()
        except Exception as error:
            # Damaged files make a reader raise anything.
            self.cut = _reason(error)
            self._reader = open_cut(path, typestore(), self.cut)

    def __enter__(self) -> Source:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the bag."""
        self._reader.close()

    @property
    def is_ros2(self) -> bool:
        """Whether the messages are serialized as ROS 2 does it."""
        return self._reader.is2

    @property
    def reader(self) -> AnyReader:
        """The reader of rosbags."""
        return self._reader

    @property
    def connections(self) -> list[Connection]:
        """Every topic, once for each way in which it was recorded."""
        return self._reader.connections

    @property
    def typestore(self) -> Typestore:
        """The messages that the bag defines."""
        return self._reader.typestore

    def size(self) -> int:
        """Return the bytes of all files of the bag."""
        files = self.path.rglob('*') if self.path.is_dir() else [self.path]
        return sum(file.stat().st_size for file in files if file.is_file())

    def image_topics(self, names: Collection[str]) -> list[str]:
        """Return the topics of the given names, or all that carry images where there are none.

        Raises
        ------
        ValueError
            If the bag has no such topic, or it does not carry images; the message names both.
        """
        kinds = {item.topic: item.msgtype for item in self.connections}
        accepted = [topic for topic, kind in kinds.items() if kind in (IMAGE, COMPRESSED_IMAGE)]
        if not accepted:
            raise ValueError(
                f'{self.path} has no images, accepted are topics of {IMAGE} or {COMPRESSED_IMAGE}'
            )
        for name in names:
            if name not in accepted:
                what = f'is of {kinds[name]}' if name in kinds else 'does not exist'
                raise ValueError(
                    f'{self.path}: topic {name} {what}, accepted is one of {", ".join(accepted)}'
                )
        return list(names) or accepted

    def deserialize(self, connection: Connection, data: bytes) -> Any:
        """Return the message that was recorded."""
        return self._reader.deserialize(data, connection.msgtype)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Yield the messages of some topics, or of all, up to where the bag is cut."""
        wanted = [it for it in self.connections if topics is None or it.topic in topics]
        if not wanted:
            return
        with closing(self._reader.messages(wanted)) as messages:
            while True:
                try:
                    message = next(messages)
                except StopIteration:
                    return
                except Exception as error:
                    self.cut = self.cut or _reason(error)
                    return
                yield message


def _reason(error: Exception) -> str:
    return f'{type(error).__name__}: {error}'
