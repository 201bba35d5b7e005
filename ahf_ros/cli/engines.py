"""The engines that commands process their tasks with."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ahf_ros.batch.engine import Engine, Job, Report, SerialEngine, available_cores, no_report
from ahf_ros.batch.processes import ProcessEngine
from ahf_ros.session_settings import IdentificationSettings
from ahf_ros.settings.nested import updated


def threads_each(jobs: int) -> int:
    """Return the number of threads of each of several processes on this machine."""
    return max(available_cores() // max(jobs, 1), 1)


def shared_settings(
    settings: IdentificationSettings, jobs: int, scheduler: str
) -> IdentificationSettings:
    """Return settings for one of several processes: its share of the threads, on any machine.

    Parameters
    ----------
    settings : IdentificationSettings
    jobs : int
        Number of processes on this machine.
    scheduler : str
        Address of a scheduler; empty for this machine.

    Examples
    --------
    >>> shared_settings(IdentificationSettings(), 1, 'tcp://host:8786').adaptive.threads
    1
    """
    values: dict[str, Any] = {}
    if (jobs > 1 or scheduler) and not settings.adaptive.threads:
        values['threads'] = 1 if scheduler else threads_each(jobs)
    if scheduler and settings.detection.family_file:
        values['family_file'] = str(Path(settings.detection.family_file).absolute())
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
    """Return the engine for a job: a cluster, processes, or this process.

    Parameters
    ----------
    command : str
        Name of the command, for messages.
    job : callable
    jobs : int
        Number of processes on this machine.
    scheduler : str
        Address of the scheduler of a cluster; empty for this machine.
    located : callable
        As for `ahf_ros.batch.cluster.DaskEngine`.
    report : callable, optional
        Called with the number of the task before what the job reports.
    isolated : bool
        Whether one process is started, too, where there is but one.

    Raises
    ------
    ValueError
        If the cluster cannot be used.
    """
    if scheduler:
        from ahf_ros.batch.cluster import DaskEngine

        def say(text: str) -> None:
            print(f'ahf {command}: {text}', file=sys.stderr)

        return DaskEngine(job, scheduler, report, say, located)
    if jobs > 1 or isolated:
        return ProcessEngine(job, jobs, report, threads_each(jobs))
    return SerialEngine(job, report)
