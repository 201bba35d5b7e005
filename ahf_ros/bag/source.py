"""Bags as they are read: every message in the order of time, and what could not be read."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rosbags.interfaces import Connection, ConnectionExtRosbag1, ConnectionExtRosbag2

from ahf_ros.bag.compression import ZSTD_MAGIC, decompress
from ahf_ros.bag.definitions import COMPRESSED_IMAGE, IMAGE, TypeStores
from ahf_ros.bag.folder import Metadata, open_files, read_metadata
from ahf_ros.bag.records import Lost, Message

_SERIALIZATION = 'cdr'
_NAMED = 100  # what is lost, in lines; more is counted


class Source:
    """A bag of ROS 1 or ROS 2 that is open for reading.

    Parameters
    ----------
    path : Path
        Folder of a bag of ROS 2, one of its files (.db3, .mcap), or a bag of ROS 1 (.bag).

    Attributes
    ----------
    connections : list of rosbags.interfaces.Connection
        Every topic, once for each way in which it was recorded.
    metadata : Metadata
        What the folder says about the bag.
    stores : TypeStores
        The types of its messages.

    Raises
    ------
    ValueError
        If nothing can be read; the message names the bag.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.stores = TypeStores()
        self.metadata = Metadata()
        self._lost: dict[Lost, None] = {}  # in the order in which it was found
        self._foreign: list[Connection] = []
        self._stack = ExitStack()
        if not path.exists():
            raise ValueError(f'{path} does not exist, accepted is a bag')
        try:
            self._open()
        except BaseException:
            self._stack.close()
            raise

    def _open(self) -> None:
        if self.path.is_dir():
            try:
                self.metadata = read_metadata(self.path)
            except ValueError as error:
                self._note(Lost((), None, None, str(error)))
        scratch = Path(self._stack.enter_context(TemporaryDirectory(prefix='ahf_')))
        self._files, lost = open_files(self.path, self.metadata.files, scratch)
        for missing in lost:
            self._note(missing)
        self.connections: list[Connection] = []
        for item in (it for file in self._files for it in file.connections):
            (self.connections if _is_ros(item) else self._foreign).append(item)

    def __enter__(self) -> Source:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the bag."""
        self._stack.close()

    @property
    def is_ros2(self) -> bool:
        """Whether the messages are serialized as ROS 2 does it."""
        return not any(isinstance(it.ext, ConnectionExtRosbag1) for it in self.connections)

    @property
    def lost(self) -> list[str]:
        """What could not be read so far; bounded in length, empty where nothing is missing."""
        lines = [str(item) for item in self._lost]
        more = len(lines) - _NAMED
        return [*lines[:_NAMED], f'{more} more'] if more > 0 else lines

    @property
    def left_out(self) -> list[str]:
        """What a copy does not have beside messages; complete once the messages were read."""
        return [it for file in self._files for it in file.left_out]

    @property
    def foreign(self) -> list[str]:
        """Topics whose messages ROS 2 cannot read, so that no bag of ROS 2 can hold them."""
        return [f'{it.topic}: messages are serialized as {_encoding(it)}' for it in self._foreign]

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
            lost = f'; not readable: {"; ".join(self.lost)}' if self._lost else ''
            raise ValueError(
                f'{self.path} has no images, accepted are topics of {IMAGE} or '
                f'{COMPRESSED_IMAGE}{lost}'
            )
        for name in names:
            if name not in accepted:
                what = f'is of {kinds[name]}' if name in kinds else 'does not exist'
                raise ValueError(
                    f'{self.path}: topic {name} {what}, accepted is one of {", ".join(accepted)}'
                )
        return list(names) or accepted

    def deserialize(self, connection: Connection, data: bytes) -> Any:
        """Return the message that was recorded.

        Raises
        ------
        ValueError
            If it is not as its type says.
        """
        return self.stores.deserialize(connection, data)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Yield the messages of some topics, or of all; take note of those that are lost."""
        for file in self._files:
            wanted = [
                it
                for it in self.connections
                if it.owner is file and (topics is None or it.topic in topics)
            ]
            for item in file.messages(wanted) if wanted else ():
                plain = item if isinstance(item, Lost) else self._plain(item)
                if isinstance(plain, Lost):
                    self._note(plain)
                else:
                    yield plain

    def check_counts(self, counts: dict[str, int]) -> None:
        """Take note of topics of which fewer messages were read than the metadata count."""
        for topic, count in self.metadata.counts.items():
            if (read := counts.get(topic, 0)) < count and topic not in self._foreign_topics:
                reason = f'{read} of {count} messages were read'
                self._note(Lost((topic,), None, None, reason))

    @property
    def _foreign_topics(self) -> set[str]:
        return {item.topic for item in self._foreign}

    def _note(self, item: Lost) -> None:
        self._lost[item] = None

    def _plain(self, message: Message) -> Message | Lost:
        """Return a message without its compression."""
        item, time, data = message
        compressed = self.metadata.compressed
        if compressed is None:
            compressed = data.startswith(ZSTD_MAGIC)
        if not compressed:
            return message
        try:
            return item, time, decompress(data, 'zstd')
        except ValueError as error:
            return Lost((item.topic,), time, time, str(error))


def _encoding(item: Connection) -> str:
    return item.ext.serialization_format if isinstance(item.ext, ConnectionExtRosbag2) else 'ros1'


def _is_ros(item: Connection) -> bool:
    return _encoding(item) in (_SERIALIZATION, 'ros1')
