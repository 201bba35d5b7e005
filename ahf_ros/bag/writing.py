"""The writer of rosbags, for folders of any name."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionMode
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

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
