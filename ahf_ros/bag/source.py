"""Bags that are open for reading: all messages in order of time, and what is unreadable."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rosbags.interfaces import Connection, ConnectionExtRosbag1, ConnectionExtRosbag2

from ahf_ros.bag.compression import ZSTD_MAGIC, decompress
from ahf_ros.bag.definitions import COMPRESSED_IMAGE, IMAGE, TypeStores
from ahf_ros.bag.folder import Metadata, open_files, read_metadata, unlisted_files
from ahf_ros.bag.records import Lost, Message

_SERIALIZATION = 'cdr'
_MAXIMUM_TOPICS = 2000  # time to write a bag grows with the square of their number
_MAXIMUM_LINES = 100  # about lost messages; more are only counted


class Source:
    """A bag of ROS 1 or ROS 2, open for reading.

    Parameters
    ----------
    path : Path
        Folder of a ROS 2 bag, one of its files (.db3, .mcap), or a ROS 1 bag (.bag).

    Attributes
    ----------
    connections : list of rosbags.interfaces.Connection
        All topics of ROS; one that was recorded in several ways has several connections.
    foreign : list of rosbags.interfaces.Connection
        Topics whose messages are serialized in another way than those of ROS.
    metadata : Metadata
        Contents of metadata.yaml.
    stores : TypeStores
        Types of the messages.

    Raises
    ------
    ValueError
        If nothing can be read; the message names the bag.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.stores = TypeStores()
        self.metadata = Metadata()
        self._lost: dict[Lost, None] = {}  # an ordered set
        self.foreign: list[Connection] = []
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
            (self.connections if is_ros(item) else self.foreign).append(item)
        if (count := len(self.connections) + len(self.foreign)) > _MAXIMUM_TOPICS:
            raise ValueError(
                f'{self.path} has {count} topics, accepted are at most {_MAXIMUM_TOPICS}'
            )

    def __enter__(self) -> Source:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the bag."""
        self._stack.close()

    @property
    def is_ros2(self) -> bool:
        """Whether all messages are serialized as in ROS 2."""
        return not any(isinstance(it.ext, ConnectionExtRosbag1) for it in self.connections)

    @property
    def lost(self) -> list[str]:
        """What could not be read so far, in a bounded number of lines."""
        lines = [str(item) for item in self._lost]
        more = len(lines) - _MAXIMUM_LINES
        return [*lines[:_MAXIMUM_LINES], f'{more} more'] if more > 0 else lines

    @property
    def left_out(self) -> list[str]:
        """What a copy lacks besides messages; complete after all messages were read."""
        others = unlisted_files(self.path, self.metadata.files)
        return [*(it for file in self._files for it in file.left_out), *others]

    def size(self) -> int:
        """Return the total size of the files of the bag, bytes."""
        files = self.path.rglob('*') if self.path.is_dir() else [self.path]
        return sum(file.stat().st_size for file in files if file.is_file())

    def image_topics(self, names: Collection[str]) -> list[str]:
        """Return the given image topics, or all image topics if none are given.

        Raises
        ------
        ValueError
            If a topic is not in the bag or has no images; the message names both.
        """
        kinds = {item.topic: item.msgtype for item in self.connections}
        accepted = [topic for topic, kind in kinds.items() if kind in (IMAGE, COMPRESSED_IMAGE)]
        if not accepted:
            lost = f'; not readable: {"; ".join(self.lost)}' if self._lost else ''
            kinds = {item.topic: encoding(item) for item in self.foreign}
            lost += ''.join(f'; {topic} is serialized as {it}' for topic, it in kinds.items())
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
        """Return a recorded message.

        Raises
        ------
        ValueError
            If the data do not match their type.
        """
        return self.stores.deserialize(connection, data)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Yield the messages of some topics of ROS, or all messages; note which are lost."""
        wanted = [it for it in self.connections if topics is None or it.topic in topics]
        if topics is None:
            wanted += self.foreign
        for file in self._files:
            selected = [it for it in wanted if it.owner is file]
            for item in file.messages(selected) if selected else ():
                plain = item if isinstance(item, Lost) else self._plain(item)
                if isinstance(plain, Lost):
                    self._note(plain)
                else:
                    yield plain

    def check_counts(self, counts: dict[str, int]) -> None:
        """Note the topics of which fewer messages were read than the metadata count."""
        for topic, count in self.metadata.counts.items():
            if (read := counts.get(topic, 0)) < count:
                reason = f'{read} of {count} messages were read'
                self._note(Lost((topic,), None, None, reason))

    def _note(self, item: Lost) -> None:
        self._lost[item] = None

    def _plain(self, message: Message) -> Message | Lost:
        """Return a message, decompressed."""
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


def encoding(item: Connection) -> str:
    """Return how the messages of a topic are serialized."""
    return item.ext.serialization_format if isinstance(item.ext, ConnectionExtRosbag2) else 'ros1'


def is_ros(item: Connection) -> bool:
    """Return whether a bag of ROS 2 can hold the messages of a topic."""
    return isinstance(item.ext, ConnectionExtRosbag1) or encoding(item) == _SERIALIZATION
