"""What a batch has still to do: tasks without a result, and results that are out of date."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ahf_ros.batch.fingerprints import file_fingerprint
from ahf_ros.batch.results_file import PREVIOUS, ResultsFile
from ahf_ros.batch.task import ImageTask
from ahf_ros.release import release

_VERSION, _SETTINGS = 'another version of ahf_ros', 'other settings'
_NAMED = 10  # tasks that a note names at most


@dataclass(frozen=True, slots=True)
class Plan:
    """What a batch has still to do.

    Attributes
    ----------
    tasks : tuple of ImageTask
        All of them.
    pending : tuple of ImageTask
        Those without a result, each once.
    notes : tuple of str
        Lines for people: what is done, and what is done again and why.
    """

    tasks: tuple[ImageTask, ...]
    pending: tuple[ImageTask, ...]
    notes: tuple[str, ...]


def make_plan(tasks: Sequence[ImageTask], results: ResultsFile) -> Plan:
    """Return what is still to be done, and let go of results that are out of date.

    If settings or version are others, all earlier results are kept in `PREVIOUS`.

    Parameters
    ----------
    tasks : sequence of ImageTask
    results : ResultsFile

    Raises
    ------
    Unwritable
        If the results cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     results = ResultsFile(Path(folder))
    ...     plan = make_plan([ImageTask(('a.jpg',))], results)
    ...     results.close()
    >>> len(plan.pending), plan.notes
    (1, ())
    """
    pending: dict[tuple[str, ...], ImageTask] = {}
    again: dict[str, list[ImageTask]] = {}
    for task in tasks:
        reason = out_of_date(task, results)
        if reason is not None and task.paths not in pending:
            pending[task.paths] = task
            if reason:
                again.setdefault(reason, []).append(task)
    kept = [task for task in tasks if task.paths not in pending]
    unseen = sum(not all(map(file_fingerprint, task.paths)) for task in kept)
    notes = tuple(_notes(results, len(tasks), len(kept), unseen, again))
    if again or results.damaged:
        if _VERSION in again or _SETTINGS in again:
            results.keep_previous()
        results.forget({task.paths for of in again.values() for task in of})
    return Plan(tuple(tasks), tuple(pending.values()), notes)


def out_of_date(task: ImageTask, results: ResultsFile) -> str | None:
    """Return why a task is done again, empty if it was not done, None if it need not be.

    A file that cannot be looked at from here is taken to be unchanged.
    """
    before = results.provenance(task)
    if before is None:
        return ''
    if before.get('version') != release():
        return _VERSION
    if before.get('settings') != results.fingerprint(task):
        return _SETTINGS
    now = map(file_fingerprint, task.paths)
    if any(it and it != then for it, then in zip(now, before['files'].values(), strict=True)):
        return 'changed files'
    if not before.get('complete'):
        return 'files that could not be read or written'
    overlays = dict(zip(task.paths, task.overlays, strict=False))
    drawn = (record['image'] for record in (results.records(task) if overlays else ()))
    if not all(Path(overlays[image]).exists() for image in drawn):
        return 'missing overlays'
    return None


def _notes(
    results: ResultsFile,
    count: int,
    kept: int,
    unseen: int,
    again: Mapping[str, Sequence[ImageTask]],
) -> Iterator[str]:
    if results.damaged:
        yield f'{results.path}: left out, because damaged or unfinished: lines: {results.damaged}'
    if kept:
        yield f'{results.path}: {kept} of {count} results are there already'
    if unseen:
        yield f'{results.path}: {unseen} of these are of files that cannot be seen from here'
    for reason, tasks in again.items():
        text = f'{results.path}: {len(tasks)} of {count} results are made again because of '
        if reason in (_VERSION, _SETTINGS):
            yield f'{text}{reason}; the earlier ones are kept in {PREVIOUS}'
        else:
            more = ' and others' if len(tasks) > _NAMED else ''
            yield f'{text}{reason}: {"; ".join(task.name for task in tasks[:_NAMED])}{more}'
