"""The results of a batch in a folder: written as they come, and continued by a later run.

Each line is a record of `ahf identify --json` with one more field, `provenance`. A line that a
killed process left unfinished is cut off, and its images are identified again.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Collection, Hashable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from shutil import copyfile
from typing import IO, Any

from ahf_ros.batch.fingerprints import settings_fingerprint
from ahf_ros.batch.task import ImageOutcome, ImageTask
from ahf_ros.interchange.files import RESULTS_FILE, file_errors, locked
from ahf_ros.release import release

PREVIOUS = 'previous.jsonl'
"""Name of the file with the results that a run with other settings replaces."""

PROVENANCE = 'provenance'
"""Field of a record with what its result depends on."""

_SYNCHRONISED = 1.0  # s after which results are safe even if the machine loses its power


class Unwritable(ValueError):
    """Results cannot be written, for instance because the disk is full."""


@dataclass(slots=True)
class _Entry:
    """The lines with the result of a task."""

    provenance: dict[str, Any]
    lines: list[tuple[int, int]] = field(default_factory=list)  # place and length in the file

    @property
    def whole(self) -> bool:
        return len(self.lines) == self.provenance['parts']


class ResultsFile:
    """The results in a folder, one task a time; one process may have it open.

    Parameters
    ----------
    folder : Path
        Is created if it is missing.

    Raises
    ------
    Unwritable
        If the folder cannot be written to, or another process does.

    Examples
    --------
    >>> import tempfile
    >>> task = ImageTask(('a.jpg',))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     results = ResultsFile(Path(folder))
    ...     results.append(task, ImageOutcome(({'image': 'a.jpg'},), files=('10 20',)))
    ...     results.records(task)
    ...     results.close()
    ({'image': 'a.jpg'},)

    Attributes
    ----------
    path : Path
        The file.
    damaged : int
        Number of lines that are not whole.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / RESULTS_FILE
        self._entries: dict[tuple[str, ...], _Entry] = {}
        self.damaged = 0
        self._fingerprints: dict[Hashable, str] = {}
        self._release = release()
        self._synchronised = time.monotonic()
        with ExitStack() as opened:
            with _writing(folder):
                folder.mkdir(parents=True, exist_ok=True)
                opened.enter_context(locked(folder))
                self._file = self._opened()
            opened.callback(lambda: self._file.close())
            self._read()
            self._lock = opened.pop_all()

    def fingerprint(self, task: ImageTask) -> str:
        """Return the fingerprint of settings, which do not change while the file is open."""
        key = task.settings, task.stacking, task.stacked, task.upright
        if key not in self._fingerprints:
            self._fingerprints[key] = settings_fingerprint(task)
        return self._fingerprints[key]

    def provenance(self, task: ImageTask) -> dict[str, Any] | None:
        """Return what the result of a task depends on; None if there is no result."""
        entry = self._entries.get(task.paths)
        return entry.provenance if entry else None

    def append(self, task: ImageTask, outcome: ImageOutcome) -> None:
        """Write the result of a task, if it has one, in the place of an earlier one.

        Raises
        ------
        Unwritable
            If it cannot be written, for instance because the disk is full.
        """
        if not outcome.records:
            return
        if task.paths in self._entries:
            self.forget({task.paths})
        provenance = {
            'version': self._release,
            'settings': self.fingerprint(task),
            'files': dict(zip(task.paths, outcome.files, strict=True)),
            'complete': not outcome.failed,
            'parts': len(outcome.records),
        }
        entry = _Entry(provenance)
        content = b''
        with _writing(self.path):
            end = self._file.seek(0, os.SEEK_END)
            for number, record in enumerate(outcome.records):
                line = _line({**record, PROVENANCE: {**provenance, 'part': number}})
                entry.lines.append((end + len(content), len(line)))
                content += line
            try:
                while content:
                    written = self._file.write(content)  # less where the disk is full
                    content = content[written:]
            except OSError:
                os.truncate(self.path, end)
                raise
            if time.monotonic() - self._synchronised > _SYNCHRONISED:
                os.fsync(self._file.fileno())
                self._synchronised = time.monotonic()
        self._entries[task.paths] = entry

    def records(self, task: ImageTask) -> tuple[dict[str, Any], ...]:
        """Return the records of a task, as they were before they were written."""
        entry = self._entries.get(task.paths)
        lines = map(self._line, entry.lines) if entry else ()
        return tuple(_without_provenance(json.loads(line)) for line in lines)

    def forget(self, tasks: Collection[tuple[str, ...]]) -> None:
        """Remove the results of the tasks with these paths, and what is damaged."""
        self._rewrite([paths for paths in self._entries if paths not in tasks])
        self.damaged = 0

    def keep_previous(self) -> None:
        """Copy the file to `PREVIOUS`."""
        previous = self.path.with_name(PREVIOUS)
        with _writing(previous):
            copyfile(self.path, previous)

    def put_in_order(self, tasks: Iterable[ImageTask]) -> None:
        """Put the results of tasks into their order, behind all other results."""
        wanted = [task.paths for task in tasks if task.paths in self._entries]
        named = set(wanted)
        order = [paths for paths in self._entries if paths not in named]
        order += dict.fromkeys(wanted)
        if order != list(self._entries):
            self._rewrite(order)

    def close(self) -> None:
        """Make the results safe on disk and leave the folder to others."""
        with self._lock, _writing(self.path):
            os.fsync(self._file.fileno())

    def _opened(self) -> IO[bytes]:
        return self.path.open('a+b', buffering=0)

    def _read(self) -> None:
        """Read where the results are, and count lines that are not whole."""
        place = 0
        with file_errors(self.path, 'read'), self.path.open('rb') as file:
            for line in file:
                self._note(line, place)
                place += len(line)
        for paths in [paths for paths, entry in self._entries.items() if not entry.whole]:
            self.damaged += len(self._entries.pop(paths).lines)

    def _note(self, line: bytes, place: int) -> None:
        """Note the line of a part of a result; the last result of a task counts."""
        try:
            record = json.loads(line)
        except (ValueError, RecursionError):
            self.damaged += 1
            return
        try:
            provenance = record[PROVENANCE]
            paths, part = tuple(provenance['files']), provenance['part']
        except (LookupError, TypeError) as error:
            raise Unwritable(
                f'{self.path} has lines that were not written with --output, accepted is a folder '
                f'without a file {RESULTS_FILE}'
            ) from error
        if part == 0:
            self._entries.pop(paths, None)
            self._entries[paths] = _Entry(provenance)
        if paths not in self._entries or not line.endswith(b'\n'):
            self.damaged += 1
            return
        self._entries[paths].lines.append((place, len(line)))

    def _rewrite(self, order: Sequence[tuple[str, ...]]) -> None:
        """Replace the file by one with the results of these tasks, atomically."""
        part = self.path.with_name(f'.{RESULTS_FILE}.part')
        entries: dict[tuple[str, ...], _Entry] = {}
        place = 0
        with _writing(self.path), part.open('wb') as file:
            for paths in order:
                entry = self._entries[paths]
                entries[paths] = _Entry(entry.provenance)
                for line in map(self._line, entry.lines):
                    file.write(line)
                    entries[paths].lines.append((place, len(line)))
                    place += len(line)
            file.flush()
            os.fsync(file.fileno())
            part.replace(self.path)
            self._file.close()
            self._file = self._opened()
        self._entries = entries

    def _line(self, where: tuple[int, int]) -> bytes:
        place, length = where
        with file_errors(self.path, 'read'):
            return os.pread(self._file.fileno(), length, place)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        with file_errors(path, 'written'):
            yield
    except ValueError as error:
        raise Unwritable(str(error)) from error


def _line(record: dict[str, Any]) -> bytes:
    return json.dumps(record).encode() + b'\n'


def _without_provenance(record: dict[str, Any]) -> dict[str, Any]:
    del record[PROVENANCE]
    return record
