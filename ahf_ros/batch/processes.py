"""The engine of one machine: worker processes, each with one task at a time.

A worker that dies takes nothing along but its task, which another one tries once more. Each has
pipes of its own to the process that started it, so no lock outlives a worker that is killed.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from ahf_ros.batch.engine import TRIES, Job, Report, TaskFailed, no_report
from ahf_ros.batch.worker import PIPE_CLOSED, SHUTDOWN_TIMEOUT, Kind

_PACKAGE = str(Path(__file__).parents[2])
_BEGIN = (
    'import sys; sys.path.insert(0, sys.argv[1]); '
    'from ahf_ros.batch.worker import main; main(*map(int, sys.argv[2:]))'
)


@dataclass(slots=True, eq=False)
class _Worker:
    """A process, the pipes to it, and the task that it has."""

    process: subprocess.Popen[bytes]
    tasks: Connection
    answers: Connection
    alive: Connection
    number: int = -1
    task: Any = None
    tries: int = 0

    @property
    def busy(self) -> bool:
        return self.tries > 0

    def close(self) -> None:
        for pipe in (self.tasks, self.answers, self.alive):
            pipe.close()


class ProcessEngine:
    """The engine that processes tasks in worker processes.

    Workers are started as they are needed. They end with this process, however it ends. What they
    print goes to standard error.

    Parameters
    ----------
    job : callable
        A function of a module.
    count : int
        Maximum number of workers.
    report : callable, optional
        Called in this process with the number of the task before what the job reports.
    threads : int
        Number of threads that OpenCV uses in each worker.

    Attributes
    ----------
    report : callable
        As above; it may be replaced between two tasks.
    """

    def __init__(self, job: Job, count: int, report: Report = no_report, threads: int = 1) -> None:
        self.capacity = count
        self._job = job
        self.report = report
        self._threads = threads
        self._workers: list[_Worker] = []

    def submit(self, number: int, task: Any) -> None:
        """Hand a task to a worker that has none."""
        self._hand_over(number, task, 1)

    def wait(self, timeout: float | None = None) -> tuple[int, Any] | None:
        """Return the next result, see `ahf_ros.batch.engine.Engine`."""
        while True:
            busy = {worker.answers: worker for worker in self._workers if worker.busy}
            ready = wait(list(busy), timeout)
            if not ready:
                return None
            for pipe in ready:
                worker = busy[pipe]  # type: ignore[index]
                number = worker.number
                try:
                    kind, content = worker.answers.recv()
                except PIPE_CLOSED:
                    if given_up := self._replaced(worker):
                        return number, given_up
                    continue
                if kind == Kind.REPORT:
                    self.report(number, *content)
                    continue
                worker.tries, worker.task = 0, None
                if kind == Kind.RAISED:
                    raise content
                return number, content

    def close(self) -> None:
        """End all workers."""
        for worker in self._workers:
            worker.close()  # so it ends
        limit = time.monotonic() + SHUTDOWN_TIMEOUT
        for worker in self._workers:
            with suppress(subprocess.TimeoutExpired):
                worker.process.wait(max(limit - time.monotonic(), 0))
            worker.process.kill()
            worker.process.wait()
        self._workers.clear()

    def _hand_over(self, number: int, task: Any, tries: int) -> None:
        idle = [worker for worker in self._workers if not worker.busy]
        while idle:
            worker = idle.pop()
            with suppress(*PIPE_CLOSED):  # killed while it had nothing to do
                worker.tasks.send(task)
                break
            self._remove(worker)
        else:
            worker = _start()
            self._workers.append(worker)
            with suppress(*PIPE_CLOSED):  # `wait` finds that it has died
                worker.tasks.send(sys.path)
                worker.tasks.send((self._job, self._threads))
                worker.tasks.send(task)
        worker.number, worker.task, worker.tries = number, task, tries

    def _replaced(self, worker: _Worker) -> TaskFailed | None:
        """Hand the task of a worker that died to another one, or give it up."""
        self._remove(worker)
        if worker.tries < TRIES:
            self._hand_over(worker.number, worker.task, worker.tries + 1)
            return None
        how = _how_ended(worker.process.returncode)
        return TaskFailed(f'given up, {TRIES} processes that worked on it died, the last {how}')

    def _remove(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.close()
        worker.process.wait()


def _start() -> _Worker:
    (tasks, to_worker), (from_worker, answers), (alive, held) = (os.pipe() for _ in range(3))
    inherited = (tasks, answers, alive)
    try:
        with _unheard_interrupts():
            process = subprocess.Popen(
                [sys.executable, '-c', _BEGIN, _PACKAGE, *map(str, inherited)],
                pass_fds=inherited,
            )
    finally:
        for descriptor in inherited:
            os.close(descriptor)
    return _Worker(
        process,
        Connection(to_worker, readable=False),
        Connection(from_worker, writable=False),
        Connection(held, readable=False),
    )


@contextmanager
def _unheard_interrupts() -> Iterator[None]:
    """Start processes that do not heed Ctrl-C before they can ignore it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _how_ended(status: int) -> str:
    if status >= 0:
        return f'with status {status}'
    with suppress(ValueError):
        return f'by {signal.Signals(-status).name}'
    return f'by signal {-status}'
