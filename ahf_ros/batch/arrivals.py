"""Files that arrive in a folder: each is taken once it has stopped changing."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ahf_ros.batch.fingerprints import file_fingerprint

_EMPTY = '0 '  # how the fingerprint of an empty file begins
_ARRIVING = ('created', 'modified', 'moved', 'closed')  # events of watchdog; others are of readers


@dataclass(slots=True)
class _Seen:
    """A file as it was when it was looked at, since when, and whether it was taken."""

    fingerprint: str
    since: float
    taken: bool = False


class Arrivals:
    """The files of a folder, as they arrive.

    Parameters
    ----------
    folder : Path
    suffixes : collection of str
        Endings of the files, in small letters. Files whose name begins with a dot are left out.
    recursive : bool
        Whether files of folders in the folder are looked at, too.
    settling : float
        Time for which a file has to be unchanged, s.
    clock : callable, optional
        Time in s.

    Attributes
    ----------
    away : str
        Why the folder cannot be read; empty if it can.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     arrivals = Arrivals(Path(folder), ('.png',), False, 0.0)
    ...     _ = Path(folder, 'a.png').write_bytes(b'image')
    ...     [Path(path).name for path in arrivals.take()], arrivals.take()
    (['a.png'], [])
    """

    def __init__(
        self,
        folder: Path,
        suffixes: Collection[str],
        recursive: bool,
        settling: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.away = ''
        self._folder = folder
        self._suffixes = tuple(suffixes)
        self._recursive = recursive
        self._settling = settling
        self._clock = clock
        self._seen: dict[str, _Seen] = {}

    def take(self) -> list[str]:
        """Return the files that are there, unchanged for long enough, and not taken as they are.

        They are sorted by name. A file that changes afterwards is taken again.
        """
        try:
            paths = sorted(self._paths())
        except OSError as error:
            self.away = error.strerror or str(error)
            return []
        self.away = ''
        now = self._clock()
        seen: dict[str, _Seen] = {}
        ready = []
        for path in paths:
            fingerprint = file_fingerprint(path)
            if not fingerprint or fingerprint.startswith(_EMPTY):
                continue
            entry = self._seen.get(path)
            if entry is None or entry.fingerprint != fingerprint:
                entry = _Seen(fingerprint, now)
            seen[path] = entry
            if not entry.taken and now - entry.since >= self._settling:
                entry.taken = True
                ready.append(path)
        self._seen = seen
        return ready

    @property
    def settling(self) -> bool:
        """Whether there are files that may still change."""
        return any(not entry.taken for entry in self._seen.values())

    def _paths(self) -> Iterator[str]:
        with os.scandir(self._folder):
            pass  # raises an OSError if the folder is away, which `walk` keeps to itself
        for folder, folders, names in os.walk(self._folder):
            if not self._recursive:
                folders.clear()
            for name in names:
                if name.lower().endswith(self._suffixes) and not name.startswith('.'):
                    yield str(Path(folder, name))


class Alarm:
    """Wakes whoever waits for a folder as soon as something happens in it.

    Without watchdog, or where the folder cannot be watched, waiting lasts its whole time.

    Parameters
    ----------
    folder : Path
    recursive : bool
    """

    def __init__(self, folder: Path, recursive: bool) -> None:
        self._folder = folder
        self._recursive = recursive
        self._happened = threading.Event()
        self._observer: Any = None

    def set(self) -> bool:
        """Begin to watch, or begin again; return whether watchdog is installed."""
        self.close()
        try:
            from watchdog.events import FileSystemEvent, FileSystemEventHandler
            from watchdog.observers import Observer
        except ModuleNotFoundError:
            return False
        happened = self._happened

        class Handler(FileSystemEventHandler):
            def on_any_event(self, event: FileSystemEvent) -> None:
                if event.event_type in _ARRIVING:
                    happened.set()

        with suppress(OSError):  # the folder is away, or there are too many watches
            self._observer = Observer()
            self._observer.schedule(Handler(), str(self._folder), recursive=self._recursive)
            self._observer.start()
        return True

    def wait(self, timeout: float) -> None:
        """Wait until something happens, or until the time is over, s."""
        self._happened.wait(timeout)
        self._happened.clear()

    def close(self) -> None:
        """Watch no longer."""
        if self._observer is not None and self._observer.is_alive():
            self._observer.stop()
            self._observer.join()
        self._observer = None
