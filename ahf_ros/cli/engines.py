"""The engines that commands process their tasks with, and the bar that shows how far they are."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ahf_ros.base.settings.nested import updated
from ahf_ros.batch.engine import Engine, Job, Report, SerialEngine, available_cores, no_report
from ahf_ros.batch.processes import ProcessEngine
from ahf_ros.cli import tell
from ahf_ros.identification.session_settings import IdentificationSettings

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn


def shared_settings(
    settings: IdentificationSettings, jobs: int, scheduler: str
) -> IdentificationSettings:
    """Return settings for one of several processes: its share of the threads, on any machine.

    Examples
    --------
    >>> shared_settings(IdentificationSettings(), 1, 'tcp://host:8786').adaptive.threads
    1
    """
    values: dict[str, Any] = {}
    if (jobs > 1 or scheduler) and not settings.adaptive.threads:
        values['threads'] = 1 if scheduler else _threads_each(jobs)
    if scheduler and settings.detection.family_file:
        files = settings.detection.family_file.split(',')
        values['family_file'] = ','.join(str(Path(of.strip()).absolute()) for of in files)
    return updated(settings, values)


def create_engine(
    command: str,
    job: Job,
    jobs: int,
    scheduler: str,
    located: Callable[[Any, str], Any],
    report: Report = no_report,
    isolated: bool = False,
) -> Engine:
    """Return the engine for a job: the cluster of a scheduler, processes, or this process.

    `located` is as for `ahf_ros.batch.cluster.DaskEngine`, and `report` is called with the number
    of the task before what the job reports. `isolated` starts a process where there is but one,
    too: what ends it does not end the command. A ValueError says so if the cluster cannot be used.
    """
    if scheduler:
        from ahf_ros.batch.cluster import DaskEngine

        return DaskEngine(job, scheduler, report, partial(tell, command), located)
    if jobs > 1 or isolated:
        return ProcessEngine(job, jobs, report, _threads_each(jobs))
    return SerialEngine(job, report)


def _threads_each(jobs: int) -> int:
    """Return the number of threads of each of several processes on this machine."""
    return max(available_cores() // max(jobs, 1), 1)


@contextmanager
def tracker(
    shown: bool, total: int, description: str
) -> Iterator[Callable[[Iterable[Any]], Iterable[Any]]]:
    """Return what yields the items that it is given, and shows on a bar how many were taken."""
    if not (shown and sys.stderr.isatty()):  # nor is what draws bars imported
        yield iter
        return
    with progress_bar() as progress:
        yield partial(progress.track, total=total, description=description)


def progress_bar(*columns: ProgressColumn) -> Progress:
    """Return a bar on standard error that is gone when all is done; it needs a terminal."""
    from rich.console import Console
    from rich.progress import Progress

    # If standard output were redirected, JSON would go to the console of the progress bar.
    return Progress(
        *columns,
        console=Console(stderr=True),
        transient=True,
        redirect_stdout=False,
        disable=not sys.stderr.isatty(),
    )
