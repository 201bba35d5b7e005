"""The writer of rosbags, for folders of any name."""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

from rosbags.rosbag2 import StoragePlugin, Writer, writer
from rosbags.rosbag2.enums import CompressionMode
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

_UNPRINTABLE = re.compile('[\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]')
STORAGES = {'mcap': StoragePlugin.MCAP, 'sqlite3': StoragePlugin.SQLITE3}


class _SqliteWriter(Sqlite3Writer):
    """Opens its file by path: rosbags does by an address, in which ?, # and % mean something."""

    def __init__(self, path: Path, _: CompressionMode) -> None:
        self.path = path / f'{path.name}.db3'
        self.conn = sqlite3.connect(self.path)
        self.conn.executescript(self.SQLITE_SCHEMA)
        self.cursor = self.conn.cursor()


class BagWriter(Writer):
    """A writer of bags without compression, in the newest version of their format."""

    STORAGE_PLUGINS: Mapping[StoragePlugin, Any] = {
        **Writer.STORAGE_PLUGINS,
        StoragePlugin.SQLITE3: _SqliteWriter,
    }

    def __init__(self, path: Path, storage: str) -> None:
        super().__init__(path, version=9, storage_plugin=STORAGES[storage])

    def close(self) -> None:
        """Complete the bag, with metadata that read back as they were given."""
        yaml, writer.YAML = writer.YAML, _Json  # type: ignore[assignment, misc]
        try:
            super().close()
        finally:
            writer.YAML = yaml  # type: ignore[misc]


class _Json:
    """Takes the place of ruamel.yaml, which breaks long lines within the backslashes of a text."""

    def __init__(self, typ: str) -> None:
        self.typ = typ

    def dump(self, content: Any, stream: TextIO) -> None:
        """Write content as JSON."""
        stream.write(as_yaml(content))


def as_yaml(content: Any) -> str:
    """Return content as JSON that is YAML, too: characters beyond 16 bits are not escaped."""
    text = json.dumps(content, indent=1, ensure_ascii=False)
    return _UNPRINTABLE.sub(lambda found: f'\\u{ord(found[0]):04x}', text)
