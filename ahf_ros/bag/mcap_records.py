"""The records of MCAP files without their index: of cut files, too, up to the last whole one."""

import struct
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import IO
from zlib import crc32

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk

from ahf_ros.base.text import printable

_MAGIC_SIZE = 8
_RECORD = struct.Struct('<BQ')  # opcode, bytes of content
_CHUNK = struct.Struct('<QQQI')  # first and last time, ns; size; checksum of the records
_MESSAGE = struct.Struct('<HIQ')  # channel, number, time, ns
_CHECKSUM_AT = 24  # in a chunk
_LONGEST = 2**62  # file, bytes; damage may make any size of a record


class CutFile(ValueError):
    """A file ends before it should; the text says in what."""


def seconds(timestamp: int) -> str:
    """Return a time in ns as seconds, exactly."""
    whole, part = divmod(abs(timestamp), 10**9)
    return f'{"-" if timestamp < 0 else ""}{whole}.{part:09}'


def read_records(path: Path, most: int, leave_out: Callable[[str], None]) -> Iterator[McapRecord]:
    """Yield the records of a file, and those in its chunks, up to its end or to a damage.

    A record may have `most` bytes. A chunk that is there again is left out and named. Of a cut
    chunk, the whole records are yielded; then a `CutFile` is raised. A damage raises anything.
    """
    reading = _Reading(most, leave_out)
    with path.open('rb') as file:
        where = yield from reading.records(file)
    if where:
        raise CutFile(f'the file is cut {where}')


class _Reading:
    """What is known of a file that is being read."""

    def __init__(self, most: int, leave_out: Callable[[str], None]) -> None:
        self._most = most
        self._leave_out = leave_out
        self._topics: dict[int, str] = {}
        self._chunks: set[tuple[int, ...]] = set()

    def records(self, file: IO[bytes], inside: bool = False) -> Generator[McapRecord, None, str]:
        """Yield the records of a file or `inside` a chunk, and return where it is cut, or ''."""
        reader = StreamReader(
            file,
            skip_magic=inside,
            emit_chunks=True,
            validate_crcs=True,
            record_size_limit=self._most,
        )
        end = 0  # of the last record
        try:
            for record in reader.records:
                end = file.tell()
                yield from self._parts(record)
            return ''
        except (EndOfFile, struct.error):
            if file.read(1):
                raise
        file.seek(end)
        return (yield from self._cut(file.read(), inside))

    def _parts(self, record: McapRecord) -> Iterator[McapRecord]:
        """Yield a record, or those in a chunk that was not there before."""
        parts: list[McapRecord] = [record]
        if isinstance(record, Chunk):
            times = record.message_start_time, record.message_end_time
            known = (*times, len(record.data), crc32(record.data))
            if known in self._chunks:
                self._leave_out(f'a chunk with messages {_span(*times)}, which is there again')
                return
            self._chunks.add(known)
            parts = breakup_chunk(record, validate_crc=True)
        for part in parts:
            if isinstance(part, Channel):
                self._topics[part.id] = part.topic
            yield part

    def _cut(self, rest: bytes, inside: bool) -> Generator[McapRecord, None, str]:
        """Yield what is whole in the last record of a file, and return in what it is cut."""
        opcode = rest[0] if len(rest) >= _RECORD.size else 0
        content = rest[_RECORD.size :]
        if opcode == Opcode.MESSAGE and len(content) >= _MESSAGE.size:
            channel, _, time = _MESSAGE.unpack_from(content)
            topic = printable(self._topics.get(channel, 'an unknown topic'))
            return f'in a message of {topic} at {seconds(time)} s'
        if opcode == Opcode.CHUNK and len(content) >= _CHUNK.size:
            first, last, size, _ = _CHUNK.unpack_from(content)
            stored = _stored(content, min(size, self._most))
            where = yield from self.records(BytesIO(stored), inside=True)
            return where or f'in a chunk with messages {_span(first, last)}'
        return '' if inside else 'between two messages'


def _span(first: int, last: int) -> str:
    return f'from {seconds(first)} to {seconds(last)} s'


def _stored(chunk: bytes, size: int) -> bytes:
    """Return at most `size` bytes of the records in a cut chunk; none of one that is not zstd."""
    at = _CHUNK.size + 4 + int.from_bytes(chunk[_CHUNK.size : _CHUNK.size + 4], 'little')
    compression, stored = chunk[_CHUNK.size + 4 : at], chunk[at + 8 :]
    if compression == b'zstd':
        with suppress(zstandard.ZstdError):
            return zstandard.ZstdDecompressor().stream_reader(stored).read(size)
    return b'' if compression else stored[:size]


def has_checksums(path: Path) -> bool:
    """Return whether the chunks of a file have checksums, by which damage in them is noticed."""
    with path.open('rb') as file:
        places = (place + _CHECKSUM_AT for place, _ in _chunks(file))
        return all(file.seek(it) and file.read(4) != bytes(4) for it in places)


def add_checksums(path: Path) -> None:
    """Write the checksum of each chunk that has none into a file whose chunks are not compressed.

    rosbags writes none.
    """
    with path.open('r+b') as file:
        for place, size in _chunks(file):
            chunk = Chunk.read(ReadDataStream(BytesIO(file.read(size))))
            if not chunk.compression and not chunk.uncompressed_crc:
                file.seek(place + _CHECKSUM_AT)
                file.write(crc32(chunk.data).to_bytes(4, 'little'))


def _chunks(file: IO[bytes]) -> Iterator[tuple[int, int]]:
    """Yield where the content of each chunk begins, which is read next, and its size."""
    place = _MAGIC_SIZE
    while place < _LONGEST and file.seek(place):
        head = file.read(_RECORD.size)
        if len(head) < _RECORD.size or head[0] == Opcode.FOOTER:
            return
        place += _RECORD.size
        opcode, size = _RECORD.unpack(head)
        if opcode == Opcode.CHUNK:
            yield place, size
        place += size
