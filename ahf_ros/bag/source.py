"""Bags that are open for reading: all messages as ROS 2 serializes them, and what is missing.

The readers of rosbags read each file of a bag through its index. MCAP files without an index, such
as those of a recorder that was killed, and those with channels that are not of ROS are read from
their beginning by mcap. SQLite files that rosbags refuses are copied as far as they can be read. A
damage ends its file there.
"""

import re
import sqlite3
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

import zstandard
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, ChunkIndex, McapRecord, Schema
from mcap.records import Message as McapMessage
from mcap.records import Metadata as McapMetadata
from mcap.writer import CompressionType, Writer
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Connection, ConnectionExtRosbag1, ConnectionExtRosbag2

from ahf_ros.bag.definitions import COMPRESSED_IMAGE, IMAGE, TypeStores, as_ros2
from ahf_ros.bag.mcap_records import CutFile, has_checksums, read_records, seconds
from ahf_ros.base.opening import parsing, read_text
from ahf_ros.base.parsed_yaml import parsed_yaml
from ahf_ros.base.text import counted, printable, reason_of

Message = tuple[Connection, int, bytes]
"""Topic of a message, its time of recording in ns, and its bytes."""

METADATA = 'metadata.yaml'

MAXIMUM_SIZE = 2**29
"""Bytes that a message or a chunk of an MCAP file without an index may have."""

_ENDINGS = ('.bag', '.db3', '.mcap')
_COMPRESSED = '.zstd'
_ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'  # no serialized message begins like that
_SERIALIZATION = 'cdr'
_SCHEMAS = ('ros2msg', 'ros2idl', 'omgidl')  # encodings that rosbags reads
_TABLES = ('schema', 'topics', 'message_definitions', 'messages')
_OWN_METADATA = 'rosbag2'  # a copy of metadata.yaml in MCAP files
_MAXIMUM_TOPICS = 2000  # time to write a bag grows with the square of their number
_MAXIMUM_LINES = 100  # about what is missing; more are only counted
_MOST_METADATA, _MOST_VALUES = 2**24, 500_000  # bytes and values of metadata.yaml
_DEPTH = '/compressedDepth'
_VIDEO = re.compile(r'.*/(FFMPEGPacket|CompressedVideo|Packet)')  # ffmpeg, Foxglove, theora


@dataclass(frozen=True, slots=True)
class Metadata:
    """What metadata.yaml says."""

    files: tuple[str, ...] = ()  # their names in their order
    counts: Counter[str] = field(default_factory=Counter)  # of the messages, by topic
    custom: dict[str, str] = field(default_factory=dict)  # what somebody has added


def read_metadata(folder: Path) -> Metadata:
    """Return what the metadata of a bag say; a ValueError unless they are as ROS 2 writes them."""
    with parsing(METADATA, 'what ROS 2 writes'):
        text = read_text(folder / METADATA, _MOST_METADATA)
        content = parsed_yaml(text, METADATA, _MOST_VALUES, aliases=True)
        about = content['rosbag2_bagfile_information']
        counts: Counter[str] = Counter()
        for item in about['topics_with_message_count']:
            counts[str(item['topic_metadata']['name'])] += int(item['message_count'])
        custom = about.get('custom_data') or {}
        return Metadata(
            files=tuple(PurePath(name).name for name in about['relative_file_paths']),
            counts=counts,
            custom={str(name): str(value) for name, value in custom.items()},
        )


_Topic = tuple[Connection, Callable[[bytes], bytes]]
"""A topic as one of ROS 2, and what turns a message as recorded into one of ROS 2."""


@dataclass(frozen=True, slots=True, eq=False)
class _File:
    """A file of a bag."""

    name: str
    start: int  # time of the first message, ns
    count: int  # of the messages that it should have
    topics: dict[int, _Topic]  # by the number of the connection
    messages: Callable[[], Iterator[Message]]  # yields all in their order


class Source(ExitStack):
    """A bag of ROS 1 or ROS 2, open for reading.

    It is the folder of a ROS 2 bag, one of its files (.db3, .mcap), or a ROS 1 bag (.bag). If
    nothing can be read, that raises a ValueError that names the bag.

    Attributes
    ----------
    connections : list of rosbags.interfaces.Connection
        All topics of ROS, as those of ROS 2; one that was recorded in several ways has several.
    foreign : list of rosbags.interfaces.Connection
        Topics whose messages are not serialized as in ROS.
    metadata : Metadata
        Contents of metadata.yaml.
    stores : TypeStores
        Types of the messages.
    left_out : dict of str to None
        What a copy does not have besides messages that are missing, as an ordered set.
    checked : bool
        Whether all chunks of MCAP files have a checksum, by which damage in them is noticed.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.metadata = Metadata()
        self.connections: list[Connection] = []
        self.foreign: list[Connection] = []
        self.left_out: dict[str, None] = {}
        self.checked = True
        self.stores = TypeStores()
        self._files: list[_File] = []
        self._unopened: list[str] = []
        self._damages: dict[str, str] = {}  # by file, as of the last reading
        self._refused: Counter[tuple[str, str]] = Counter()  # by topic and reason
        self._uncounted: list[str] = []
        if not path.exists():
            raise ValueError(f'{path} does not exist, accepted is a bag')
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    @property
    def lost(self) -> list[str]:
        """What could not be read when the bag was last read, in a bounded number of lines."""
        refused = [
            _refused(topic, count, reason) for (topic, reason), count in self._refused.items()
        ]
        lines = [*self._unopened, *self._damages.values(), *refused, *self._uncounted]
        more = len(lines) - _MAXIMUM_LINES
        return [*lines[:_MAXIMUM_LINES], f'{more} more'] if more > 0 else lines

    def size(self) -> int:
        """Return the total size of the files of the bag, bytes."""
        files = self.path.rglob('*') if self.path.is_dir() else [self.path]
        return sum(file.stat().st_size for file in files if file.is_file())

    def image_topics(self, names: Collection[str]) -> list[str]:
        """Return the given image topics, or all image topics if none are given.

        A topic that is not in the bag or has no images is named by a ValueError. Topics of depth
        images and of video are left out, and named.
        """
        kinds = {item.topic: item.msgtype for item in self.connections}
        unread = {topic: why for topic, kind in kinds.items() if (why := _unread(topic, kind))}
        accepted = [
            topic
            for topic, kind in kinds.items()
            if kind in (IMAGE, COMPRESSED_IMAGE) and topic not in unread
        ]
        if not accepted:
            if self.lost:
                lost = '; '.join(self.lost)
                raise ValueError(f'{self.path} has no images that can be read: {lost}')
            foreign = ''.join(
                f'; {it.topic} is serialized as {_encoding(it)}' for it in self.foreign
            )
            raise ValueError(
                f'{self.path} has no images, accepted are topics of {IMAGE} or '
                f'{COMPRESSED_IMAGE}{foreign}'
                + ''.join(f'; {topic} {why}' for topic, why in unread.items())
            )
        self.left_out |= {
            f'answers to {topic}, which {why}': None for topic, why in unread.items()
        }
        for name in names:
            if name not in accepted:
                what = f'is of {kinds[name]}' if name in kinds else 'does not exist'
                what = unread.get(name, what)
                raise ValueError(
                    f'{self.path}: topic {name} {what}, accepted is one of {", ".join(accepted)}'
                )
        return list(names) or accepted

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Yield the messages of some topics of ROS, or all of them; note what is missing.

        The bag is always read as a whole, so a damage ends every reading at the same message.
        """
        self._damages.clear()
        self._refused.clear()
        self._uncounted.clear()
        read: Counter[str] = Counter()
        for file in self._files:
            for connection, time, data in self._read(file, topics):
                read[connection.topic] += 1
                yield connection, time, data
        if topics is None:
            self.check_counts(read)

    def check_counts(self, counts: Counter[str]) -> None:
        """Note each topic that has fewer messages than the metadata count."""
        foreign = {item.topic for item in self.foreign}
        self._uncounted += [
            f'{topic}: {counts[topic]} of {count} messages were read'
            for topic, count in self.metadata.counts.items()
            if counts[topic] < count and topic not in foreign
        ]

    def _open(self) -> None:
        paths = [self.path]
        if self.path.is_dir():
            paths = found = sorted(it for it in self.path.iterdir() if _ending(it) in _ENDINGS)
            try:
                self.metadata = read_metadata(self.path)
                paths = [self.path / name for name in self.metadata.files]
                unlisted = (it.name for it in found if it not in paths)
                self.left_out |= {f'{it}, which {METADATA} does not list': None for it in unlisted}
            except ValueError as error:
                self._unopened.append(str(error))
        scratch = Path(self.enter_context(TemporaryDirectory(prefix='ahf_')))
        for path in paths:
            try:
                self._files.append(self._opened(path, scratch))
            except Exception as error:
                # Damaged files make a library raise anything.
                reason = str(error) if isinstance(error, ValueError) else reason_of(error)
                self._unopened.append(f'{path.name} cannot be read: {reason}')
        if not self._files:
            why = '; '.join(self._unopened) or f'it holds no files {", ".join(_ENDINGS)}'
            raise ValueError(f'{self.path} is not a bag that can be read: {why}')
        if not self.metadata.files:
            self._files.sort(key=lambda file: file.start)
        topics = [topic for file in self._files for topic, _ in file.topics.values()]
        if len(topics) > _MAXIMUM_TOPICS:
            raise ValueError(
                f'{self.path} has {len(topics)} topics, accepted are at most {_MAXIMUM_TOPICS}'
            )
        self.foreign = [item for item in topics if _encoding(item) != _SERIALIZATION]
        self.connections = [item for item in topics if _encoding(item) == _SERIALIZATION]
        for item in self.foreign:
            messages = counted(item.msgcount, 'message')
            self.left_out[f'{item.topic}: {messages} serialized as {_encoding(item)}'] = None

    def _opened(self, path: Path, scratch: Path) -> _File:
        """Open a file, decompressed where it is compressed."""
        if path.exists() and not path.is_file():
            raise ValueError('it is not a regular file')
        if path.suffix == _COMPRESSED:
            path = self._decompressed(path, scratch)
        if path.suffix == '.mcap':
            self.checked &= has_checksums(path)
            if not self._is_indexed(path):
                return self._unindexed(path, scratch)
        wal = path.with_name(f'{path.name}-wal')
        if wal.exists() and wal.stat().st_size:
            self._unopened.append(f'{wal.name} was not merged into {path.name}')
        reader: Any = (rosbag1 if path.suffix == '.bag' else rosbag2).Reader(path)
        try:
            self.enter_context(reader)
        except Exception:
            # Such as damages, and channels that are not of ROS.
            if path.suffix == '.mcap':
                return self._unindexed(path, scratch)
            if path.suffix != '.db3':
                raise
            reader = self.enter_context(rosbag2.Reader(self._recovered(path, scratch)))
        return _File(
            name=path.name,
            start=reader.start_time,
            count=reader.message_count,
            topics=self._topics(reader.connections),
            messages=reader.messages,
        )

    def _decompressed(self, path: Path, scratch: Path) -> Path:
        """Return a decompressed copy of a file, up to where it is damaged."""
        copy = scratch / path.stem
        with path.open('rb') as source, copy.open('wb') as target:
            try:
                zstandard.ZstdDecompressor().copy_stream(source, target)
            except zstandard.ZstdError as error:
                self._unopened.append(f'{path.name}: {error}')
        return copy

    def _recovered(self, path: Path, scratch: Path) -> Path:
        """Return a copy of a damaged SQLite file, up to where it is damaged."""
        copy = scratch / f'{len(self._files)}.db3'
        address = f'file:{quote(str(path.absolute()))}?immutable=1'
        with (
            closing(sqlite3.connect(address, uri=True)) as damaged,
            closing(sqlite3.connect(copy)) as database,
            database,
        ):
            # Without it SQLite refuses a file that is shorter than its header says.
            damaged.execute('PRAGMA writable_schema=ON')
            query = "SELECT sql FROM sqlite_master WHERE type = 'table' AND name = ?"
            for table in _TABLES:
                read = 0
                try:
                    for (made,) in damaged.execute(query, (table,)).fetchall():
                        database.execute(made)
                        for row in damaged.execute(f'SELECT * FROM {table}'):
                            marks = ', '.join('?' * len(row))
                            database.execute(f'INSERT INTO {table} VALUES ({marks})', row)
                            read += 1
                except sqlite3.Error as error:
                    rows = f'{counted(read, "row")} of {table}'
                    reason = f'nothing after {rows} can be read: {reason_of(error)}'
                    self._unopened.append(f'{path.name}: {reason}')
            database.execute('CREATE INDEX timestamp_idx ON messages (timestamp)')
        return copy

    def _is_indexed(self, path: Path) -> bool:
        """Return whether an MCAP file has an index, of chunks that are there once.

        Note what a copy will not have.
        """
        with path.open('rb') as file, suppress(Exception):
            summary = make_reader(file).get_summary()
            if summary is not None and summary.statistics is not None:
                self._leave_out(summary.attachment_indexes, 'attachment')
                self._leave_out(summary.metadata_indexes, 'metadata')
                chunks = {_extent(it) for it in summary.chunk_indexes}
                return bool(chunks) and len(chunks) == len(summary.chunk_indexes)
        return False

    def _leave_out(self, items: Iterable[Any], what: str) -> None:
        names = (item.name for item in items if item.name != _OWN_METADATA)
        self.left_out |= {f'{what} {name!r}': None for name in names}

    def _unindexed(self, path: Path, scratch: Path) -> _File:
        """Open an MCAP file that is read from its beginning.

        Its definitions are copied to a file of their own, so that rosbags reads them, too.
        """
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        counts: Counter[int] = Counter()
        start: int | None = None
        definitions = scratch / f'{path.stem}.definitions.mcap'
        with definitions.open('wb') as file:
            writer = Writer(file, compression=CompressionType.NONE)
            writer.start(profile='ros2')
            for record in self._records(path):
                if isinstance(record, McapMessage):
                    counts[record.channel_id] += 1
                    start = record.log_time if start is None else start
                elif isinstance(record, Attachment | McapMetadata):
                    self._leave_out([record], type(record).__name__.lower())
                elif isinstance(record, Schema) and record.encoding in _SCHEMAS:
                    if record.id not in schemas:
                        schemas[record.id] = writer.register_schema(
                            record.name, record.encoding, record.data
                        )
                elif isinstance(record, Channel) and record.id not in channels:
                    channels[record.id] = writer.register_channel(
                        record.topic,
                        record.message_encoding,
                        schemas.get(record.schema_id, 0),
                        record.metadata,
                    )
            writer.finish()
        with rosbag2.Reader(definitions) as reader:
            known = {item.id: item for item in reader.connections}
        topics = self._topics(
            known[other]._replace(id=number, msgcount=counts[number])
            for number, other in channels.items()
        )

        def messages() -> Iterator[Message]:
            for record in self._records(path):
                if isinstance(record, McapMessage) and record.channel_id in topics:
                    connection, _ = topics[record.channel_id]
                    yield connection, record.log_time, record.data

        return _File(
            name=path.name,
            start=start or 0,
            count=counts.total(),
            topics=topics,
            messages=messages,
        )

    def _records(self, path: Path) -> Iterator[McapRecord]:
        """Yield the records of an MCAP file up to its end or to a damage, which is noted."""
        time: int | None = None

        def leave_out(what: str) -> None:
            self.left_out[f'{path.name}: {what}'] = None

        try:
            for record in read_records(path, MAXIMUM_SIZE, leave_out):
                yield record
                time = record.log_time if isinstance(record, McapMessage) else time
        except Exception as error:
            self._note_damage(path.name, time, error)

    def _topics(self, connections: Iterable[Connection]) -> dict[int, _Topic]:
        """Return topics as those of ROS 2, by their numbers; note those that cannot be."""
        topics = {}
        for item in connections:
            try:
                topics[item.id] = _topic(item)
            except Exception as error:
                # With bad definitions, the parser and the code generator may raise anything.
                self._unopened.append(
                    _refused(printable(str(item.topic)), item.msgcount, reason_of(error))
                )
        return topics

    def _read(self, file: _File, topics: Collection[str] | None) -> Iterator[Message]:
        """Yield the messages of a file up to its end or to a damage, which is noted."""
        read = 0
        last: int | None = None
        try:
            for recorded, time, data in file.messages():
                read, last = read + 1, time
                topic = file.topics.get(recorded.id)
                if topic is None or (topics is not None and recorded.topic not in topics):
                    continue
                connection, convert = topic
                try:
                    if not (isinstance(time, int) and 0 <= time < 2**63):
                        raise ValueError(f'{time} ns is not a time')
                    converted = convert(data)
                except Exception as error:
                    # With damaged messages, the generated code may raise anything.
                    self._refused[connection.topic, reason_of(error)] += 1
                    continue
                if _encoding(connection) == _SERIALIZATION:
                    yield connection, time, converted
        except Exception as error:
            # Damaged files make a library raise anything.
            self._note_damage(file.name, last, error)
        if read < file.count and file.name not in self._damages:
            self._damages[file.name] = f'{file.name}: {read} of {file.count} messages were read'

    def _note_damage(self, name: str, last: int | None, error: Exception) -> None:
        where = 'nothing' if last is None else f'nothing after {seconds(last)} s'
        cut = isinstance(error, CutFile)
        reason = str(error) if cut else reason_of(error).removesuffix(': ')
        self._damages[name] = f'{name}: {where} can be read: {reason}'


def _refused(topic: str, count: int, reason: str) -> str:
    return f'{topic}: {counted(count, "message")} cannot be converted: {reason}'


def _unread(topic: str, kind: str) -> str:
    """Return why the images of a topic are not read, nothing for others."""
    if kind == COMPRESSED_IMAGE and topic.endswith(_DEPTH):
        return 'has depth images'
    if _VIDEO.fullmatch(kind):
        return f'has video of {kind}: decode it, such as with image_transport republish'
    return ''


def _encoding(item: Connection) -> str:
    assert isinstance(item.ext, ConnectionExtRosbag2)
    return item.ext.serialization_format


def _extent(chunk: ChunkIndex) -> tuple[int, ...]:
    """Return what two chunks have in common that may be the same."""
    times = chunk.message_start_time, chunk.message_end_time
    return *times, chunk.uncompressed_size, chunk.compressed_size


def _ending(path: Path) -> str:
    return Path(path.stem).suffix if path.suffix == _COMPRESSED else path.suffix


def _topic(item: Connection) -> _Topic:
    """Return a topic as one of ROS 2."""
    if isinstance(item.ext, ConnectionExtRosbag1):
        return as_ros2(item)
    texts = (item.topic, item.msgtype, item.msgdef.data, item.digest, _encoding(item))
    if not all(isinstance(it, str) for it in texts):
        raise ValueError(f'it is of type {item.msgtype!r}, serialized as {_encoding(item)!r}')
    return item, _plain


def _plain(data: object) -> bytes:
    """Return a message of ROS 2, decompressed where it is compressed."""
    if not isinstance(data, bytes | bytearray | memoryview):
        raise ValueError(f'a message is of type {type(data).__name__}, accepted are bytes')
    if bytes(data[:4]) != _ZSTD_MAGIC:
        return bytes(data)
    if (size := zstandard.frame_content_size(data)) > MAXIMUM_SIZE:
        raise ValueError(f'a message has {size} bytes, accepted are at most {MAXIMUM_SIZE}')
    return zstandard.decompress(data, MAXIMUM_SIZE)
