"""The results of a batch: in the order of its tasks, and in a folder where a later run goes on.

Each line of the file is a record of `ahf identify --json` with one more field, `provenance`: what
the result depends on. A result counts as long as that is what it would depend on today. A line
that a killed process left unfinished does not count.
"""

import hashlib
import json
import os
import sys
import time
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import copyfileobj
from typing import Any

from ahf_ros.base.inputs import check_output
from ahf_ros.base.opening import check_regular, file_errors
from ahf_ros.base.release import release
from ahf_ros.base.settings.nested import flat_values
from ahf_ros.base.writing import locked, whole_file
from ahf_ros.batch.engine import Engine, Finished, TaskFailed, finished_tasks, in_order
from ahf_ros.batch.identification import file_fingerprint
from ahf_ros.batch.task import ImageOutcome, ImageTask, Level, Message
from ahf_ros.files.files import RESULTS_FILE

PREVIOUS = 'previous.jsonl'
"""Name of the file with the results that a run with other settings replaces."""

_PROVENANCE = 'provenance'  # field of a record with what its result depends on
_NAMED = 10  # tasks that a note names at most
_SYNCHRONISED = 1.0  # s after which results are safe even if the machine loses its power


class Unwritable(ValueError):
    """Results cannot be written, for instance because the disk is full."""


@dataclass(frozen=True, slots=True)
class _Entry:
    """The result of a task: consecutive lines, and their place and length in the file."""

    provenance: dict[str, Any]
    place: int
    length: int
    lines: int


class Results:
    """The results in a folder, which is created if it is missing; one process may have it open.

    Whatever cannot be written raises `Unwritable`, also because another process has the folder
    open. `path` is the file.

    Examples
    --------
    >>> import tempfile
    >>> task = ImageTask(('a.jpg',))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     results = Results(Path(folder))
    ...     results.append(task, ImageOutcome(({'image': 'a.jpg'},), files=('10 20',)))
    ...     results.records(task), results.pending([task])
    ...     results.close()
    (({'image': 'a.jpg'},), ([], ['1 of 1 results are there already']))
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / RESULTS_FILE
        self._entries: dict[tuple[str, ...], _Entry] = {}
        self._damaged = 0
        self._dependencies: dict[Hashable, dict[str, str]] = {}
        self._synchronised = time.monotonic()
        with ExitStack() as opened:
            with _writing(folder):
                folder.mkdir(parents=True, exist_ok=True)
                opened.enter_context(locked(folder))
                check_output(self.path)
                if self.path.exists():
                    check_regular(self.path, sys.maxsize)
                self._file = self.path.open('a+b', buffering=0)
            opened.callback(lambda: self._file.close())
            self._read()
            self._lock = opened.pop_all()

    def has(self, task: ImageTask) -> bool:
        """Return whether a task need not be done again.

        A file that cannot be looked at from here is taken to be unchanged.
        """
        entry = self._entries.get(task.paths)
        if entry is None or not self._is_of_today(task) or not entry.provenance['complete']:
            return False
        now, then = map(file_fingerprint, task.paths), entry.provenance['files'].values()
        overlays = dict(zip(task.paths, task.overlays, strict=False))
        drawn = (record['image'] for record in (self.records(task) if overlays else ()))
        return all(it in ('', before) for it, before in zip(now, then, strict=True)) and all(
            Path(overlays[image]).exists() for image in drawn
        )

    def pending(self, tasks: Sequence[ImageTask]) -> tuple[list[ImageTask], list[str]]:
        """Return the tasks that have to be done, each once, and what there is to say about it.

        Their earlier results are removed. If settings or version were others, all earlier results
        are kept in `PREVIOUS`.
        """
        pending = {task.paths: task for task in tasks if not self.has(task)}
        kept = sum(task.paths not in pending for task in tasks)
        again = [task for task in pending.values() if task.paths in self._entries]
        notes = []
        if self._damaged:
            notes.append(f'left out, because damaged or unfinished: lines: {self._damaged}')
        if kept:
            notes.append(f'{kept} of {len(tasks)} results are there already')
        if again:
            names = '; '.join(task.name for task in again[:_NAMED])
            more = ' and others' if len(again) > _NAMED else ''
            notes.append(f'{len(again)} results are out of date and made again: {names}{more}')
        if not all(map(self._is_of_today, again)):
            previous = self.path.with_name(PREVIOUS)
            with _writing(previous), self.path.open('rb') as source, whole_file(previous) as copy:
                copyfileobj(source, copy)
            notes.append(f'settings or version are others, earlier results are kept in {previous}')
        if again or self._damaged:
            self._rewrite([paths for paths in self._entries if paths not in pending])
        return list(pending.values()), notes

    def append(self, task: ImageTask, outcome: ImageOutcome) -> None:
        """Write the result of a task, if it has one, in the place of an earlier one."""
        if not outcome.records:
            return
        if task.paths in self._entries:
            self._rewrite([paths for paths in self._entries if paths != task.paths])
        provenance = {
            **self._dependencies_of(task),
            'files': dict(zip(task.paths, outcome.files, strict=True)),
            'complete': not outcome.failed,
            'parts': len(outcome.records),
        }
        content = b''.join(
            json.dumps({**record, _PROVENANCE: {**provenance, 'part': number}}).encode() + b'\n'
            for number, record in enumerate(outcome.records)
        )
        with _writing(self.path):
            end = self._file.seek(0, os.SEEK_END)
            try:
                written = 0
                while written < len(content):
                    written += self._file.write(content[written:])  # less where the disk is full
            except OSError:
                self._file.truncate(end)
                raise
            if time.monotonic() - self._synchronised > _SYNCHRONISED:
                os.fsync(self._file.fileno())
                self._synchronised = time.monotonic()
        self._entries[task.paths] = _Entry(
            provenance=provenance, place=end, length=len(content), lines=len(outcome.records)
        )

    def records(self, task: ImageTask) -> tuple[dict[str, Any], ...]:
        """Return the records of a task, as they were before they were written."""
        entry = self._entries.get(task.paths)
        records = map(json.loads, self._content(entry).splitlines() if entry else ())
        return tuple(
            {name: value for name, value in record.items() if name != _PROVENANCE}
            for record in records
        )

    def put_in_order(self, tasks: Iterable[ImageTask]) -> None:
        """Put the results of tasks into their order, behind those of others."""
        wanted = dict.fromkeys(task.paths for task in tasks if task.paths in self._entries)
        order = [*(paths for paths in self._entries if paths not in wanted), *wanted]
        if order != list(self._entries):
            self._rewrite(order)

    def close(self) -> None:
        """Make the results safe on disk and leave the folder to others."""
        with self._lock, _writing(self.path):
            os.fsync(self._file.fileno())

    def _dependencies_of(self, task: ImageTask) -> dict[str, str]:
        """Return version and fingerprint of settings, which do not change while this is open."""
        key = task.settings, task.stacking, task.stacked, task.upright, task.families
        if key not in self._dependencies:
            self._dependencies[key] = {'version': release(), 'settings': _fingerprint(task)}
        return self._dependencies[key]

    def _is_of_today(self, task: ImageTask) -> bool:
        """Return whether the result of a task has the version and settings of today."""
        provenance = self._entries[task.paths].provenance
        return self._dependencies_of(task).items() <= provenance.items()

    def _read(self) -> None:
        """Read where the results are, and count lines that are not whole."""
        place = 0
        with file_errors(self.path, 'read'), self.path.open('rb') as file:
            for line in file:
                self._note(line, place)
                place += len(line)
        for paths, entry in list(self._entries.items()):
            if entry.lines < entry.provenance['parts']:
                self._damaged += self._entries.pop(paths).lines

    def _note(self, line: bytes, place: int) -> None:
        """Note the line of a part of a result; the last result of a task counts."""
        try:
            record = json.loads(line)
        except (ValueError, RecursionError):
            self._damaged += 1
            return
        try:
            provenance = record[_PROVENANCE]
            paths, part = tuple(provenance['files']), provenance['part']
        except (LookupError, TypeError) as error:
            raise Unwritable(
                f'{self.path} has lines that were not written with --output, accepted is a folder '
                f'without a file {RESULTS_FILE}'
            ) from error
        before = self._entries.pop(paths, None)
        if part == 0:
            before = _Entry(provenance=provenance, place=place, length=0, lines=0)
        if before and line.endswith(b'\n') and place == before.place + before.length:
            self._entries[paths] = replace(
                before, length=before.length + len(line), lines=before.lines + 1
            )
        else:
            self._damaged += 1 + (before.lines if before else 0)

    def _rewrite(self, order: Iterable[tuple[str, ...]]) -> None:
        """Replace the file by one with the results of these tasks, atomically."""
        entries: dict[tuple[str, ...], _Entry] = {}
        with _writing(self.path):
            try:
                with whole_file(self.path) as file:
                    for paths in order:
                        entry = self._entries[paths]
                        entries[paths] = replace(entry, place=file.tell())
                        file.write(self._content(entry))
                    self._file.close()  # Windows replaces no open file
            finally:
                self._file = self.path.open('a+b', buffering=0)
        self._entries, self._damaged = entries, 0

    def _content(self, entry: _Entry) -> bytes:
        with file_errors(self.path, 'read'):
            self._file.seek(entry.place)
            return self._file.read(entry.length)


def _fingerprint(task: ImageTask) -> str:
    """Return a text that differs where settings of a task lead to other results."""
    values = flat_values(task.settings)
    prints = task.settings.detection.prints.values()
    values['family_file'] = ' '.join(of.digest for of in prints if of.file)
    del values['threads']  # which does not change results
    movement = task.stacking.stack_movement
    values |= {'stack_movement': movement, 'stacked': task.stacked, 'upright': task.upright}
    if task.families:
        values['families'] = task.families
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        with file_errors(path, 'written'):
            yield
    except ValueError as error:
        raise Unwritable(str(error)) from error


def outcomes_in_order(engine: Engine, tasks: Iterable[ImageTask]) -> Iterator[ImageOutcome]:
    """Yield the outcomes of tasks in their order, each as soon as those before it are known.

    Examples
    --------
    >>> from ahf_ros.batch.engine import SerialEngine
    >>> from ahf_ros.batch.identification import identify_images
    >>> tasks = [ImageTask((name,)) for name in ('a.png', 'b.png')]
    >>> outcomes = outcomes_in_order(SerialEngine(identify_images), tasks)
    >>> [it.messages[0].text[:20] for it in outcomes]
    ['a.png cannot be read', 'b.png cannot be read']
    """
    for item in in_order(finished_tasks(engine, tasks)):
        yield outcome_of(item.task, item.result)


def kept_outcomes_in_order(
    engine: Engine, tasks: Sequence[ImageTask], results: Results, say: Callable[[str], None]
) -> Iterator[ImageOutcome]:
    """Yield the outcomes of tasks in their order; those with a result are not done again.

    `results` get each result as soon as it is known, and the order of the tasks at the end. What
    they have already has no messages. `say` is called with lines for people: what is done, and
    what is done again.
    """

    def recorded() -> Iterator[Finished[ImageTask, ImageOutcome]]:
        for item in finished_tasks(engine, pending):
            outcome = outcome_of(item.task, item.result)
            results.append(item.task, outcome)
            yield replace(item, result=outcome)

    pending, notes = results.pending(tasks)
    for note in notes:
        say(f'{results.path}: {note}')
    following = in_order(recorded())
    undone = {task.paths for task in pending}
    for task in tasks:
        if task.paths in undone:
            undone.remove(task.paths)
            yield next(following).result
        else:
            yield ImageOutcome(results.records(task))
    results.put_in_order(tasks)


def outcome_of(task: ImageTask, result: ImageOutcome | TaskFailed) -> ImageOutcome:
    """Return the outcome of a task; it is a problem if the task was given up."""
    if isinstance(result, TaskFailed):
        return ImageOutcome(messages=(Message(f'{task.name}: {result.reason}', Level.PROBLEM),))
    return result
