"""Several bags at a time: processes that end with the one that started them."""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

PATIENCE = 0.2
"""Time between two looks at whether a process has ended, s."""

GRACE = 3.0
"""Time that a process has to end in order once its parent is gone, s."""

Job = Callable[[Any, Callable[..., None]], Any]
"""Does a task and reports on the way."""

_reports: Any = None  # in a worker: the queue to its parent


def results(
    job: Job, tasks: Sequence[Any], count: int, report: Callable[..., None]
) -> Iterator[tuple[Any, Any]]:
    """Yield each task with what becomes of it, as soon as it is known.

    Parameters
    ----------
    job : callable
        A function of a module. What it reports goes to `report`, with the number of the task
        before it.
    tasks : sequence
    count : int
        Number of processes.
    report : callable

    Yields
    ------
    task, result
        The result is a ValueError where the process has died.
    """
    context = multiprocessing.get_context('spawn')
    reports = context.Queue()
    alive, held = context.Pipe(duplex=False)  # closed when this process ends, however it does
    pool = ProcessPoolExecutor(count, context, _begin, (reports, alive))
    try:
        running = {
            pool.submit(_work, job, task, number): task for number, task in enumerate(tasks)
        }
        while running:
            try:
                report(*reports.get(timeout=PATIENCE))
                continue
            except queue.Empty:
                ended = [future for future in running if future.done()]
            for future in ended:
                task = running.pop(future)
                try:
                    yield task, future.result()
                except BrokenProcessPool:
                    yield task, ValueError(f'{task.source}: the process that worked on it died')
    except BaseException:
        held.close()
        raise
    finally:
        pool.shutdown()
        held.close()


def _begin(reports: Any, alive: Connection) -> None:
    """Prepare a worker: it ends in order by a signal, and as soon as its parent is gone."""
    global _reports
    _reports = reports
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the parent gets it, too, and ends
    signal.signal(signal.SIGTERM, _end)
    threading.Thread(target=_watch, args=(alive,), daemon=True).start()


def _watch(alive: Connection) -> None:
    """End this process once nobody holds the other end of a pipe."""
    alive.poll(None)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(GRACE)
    os._exit(1)


def _end(number: int, _: Any) -> None:
    from ahf_ros.detectors.external.program import end_programs

    end_programs()
    raise SystemExit(128 + number)


def _work(job: Job, task: Any, number: int) -> Any:
    return job(task, partial(_put, number))


def _put(*report: Any) -> None:
    _reports.put(report)
