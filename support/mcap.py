"""MCAP files record by record, also such as no ROS tool would write."""

import struct
from dataclasses import dataclass, field
from pathlib import Path
from zlib import crc32

import zstandard

MAGIC = b'\x89MCAP0\r\n'


def text(value: str | bytes) -> bytes:
    """Return a text with its length before it."""
    data = value.encode() if isinstance(value, str) else value
    return struct.pack('<I', len(data)) + data


def record(opcode: int, content: bytes) -> bytes:
    """Return a record."""
    return struct.pack('<BQ', opcode, len(content)) + content


def schema(number: int, name: str, encoding: str, data: str | bytes) -> bytes:
    """Return the record of a schema."""
    return record(3, struct.pack('<H', number) + text(name) + text(encoding) + text(data))


def channel(number: int, schema: int, topic: str, encoding: str = 'cdr') -> bytes:
    """Return the record of a channel."""
    return record(4, struct.pack('<HH', number, schema) + text(topic) + text(encoding) + text(b''))


def message(
    channel: int, time: int, data: bytes, sequence: int = 0, published: int | None = None
) -> bytes:
    """Return the record of a message."""
    published = time if published is None else published
    return record(5, struct.pack('<HIQQ', channel, sequence, time, published) + data)


def attachment(name: str, data: bytes) -> bytes:
    """Return the record of an attachment."""
    content = struct.pack('<QQ', 1, 1) + text(name) + text('text/plain')
    return record(9, content + struct.pack('<Q', len(data)) + data + bytes(4))


def metadata(name: str) -> bytes:
    """Return the record of metadata without entries."""
    return record(12, text(name) + text(b''))


def chunk(
    records: bytes, start: int, stop: int, *, compressed: bool = False, checksum: bool = True
) -> bytes:
    """Return the record of a chunk, without an index."""
    crc = crc32(records) if checksum else 0
    head = struct.pack('<QQQI', start, stop, len(records), crc)
    stored = zstandard.compress(records) if compressed else records
    name = text('zstd' if compressed else '')
    return record(6, head + name + struct.pack('<Q', len(stored)) + stored)


@dataclass
class McapFile:
    """A file that is written at once."""

    records: list[bytes] = field(default_factory=list)
    profile: str = 'ros2'

    def write(self, path: Path) -> Path:
        """Write the file with a footer and without an index."""
        head = record(1, text(self.profile) + text('test'))
        tail = record(15, bytes(4)) + record(2, bytes(20))
        path.write_bytes(MAGIC + head + b''.join(self.records) + tail + MAGIC)
        return path
