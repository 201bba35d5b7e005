"""The engine of one machine: worker processes, each with one task at a time.

A worker that dies takes nothing along but its task, which another one tries once more. Each has
pipes of its own to the process that started it, so no lock outlives a worker that is killed. It
reads tasks from one and writes what becomes of them to another, and it ends when they are closed,
at the latest when the process that started it is gone. With pebble 5.2, a worker whose parent was
killed worked on, and a task whose worker had died was not tried again.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import FrameType
from typing import Any

from ahf_ros import ending
from ahf_ros.batch.engine import TRIES, Job, Report, TaskFailed, no_report
from ahf_ros.text import reason_of

SHUTDOWN_TIMEOUT = 10 * ending.GRACE
"""Time after which a worker is taken to be stuck at its end, s."""

PIPE_CLOSED = (EOFError, OSError)
"""What the pipe of a process that has ended raises."""

_PACKAGE = str(Path(__file__).parents[2])
_BEGIN = (
    'import sys; sys.path.insert(0, sys.argv[1]); '
    'from ahf_ros.batch.processes import work; work(*map(int, sys.argv[2:]))'
)


class Kind(IntEnum):
    """What a worker sends."""

    REPORT = 0
    DONE = 1
    RAISED = 2


def work(tasks: int, answers: int, alive: int) -> None:
    """Process tasks until there are no more.

    Parameters
    ----------
    tasks, answers : int
        File descriptors of the pipes.
    alive : int
        File descriptor of a pipe that is closed when the parent ends.
    """
    _heed_signals(alive)
    received, sent = Connection(tasks, writable=False), Connection(answers, readable=False)
    with suppress(*PIPE_CLOSED):
        sys.path[:] = received.recv()
        job, threads = received.recv()
        _prepare(threads)
        while True:
            result = _result_of(job, received.recv(), sent)
            ending.check()  # the result may come from a program that was ended
            sent.send(result)


def _result_of(job: Job, task: Any, sent: Connection) -> tuple[Kind, Any]:
    try:
        return Kind.DONE, job(task, partial(_report, sent))
    except ValueError as error:
        return Kind.RAISED, ValueError(str(error))
    except Exception as error:
        traceback.print_exc()  # which the exception of another process does not have
        return Kind.RAISED, RuntimeError(reason_of(error))


def _report(sent: Connection, *report: Any) -> None:
    with suppress(*PIPE_CLOSED):  # this process is about to end
        sent.send((Kind.REPORT, report))


def _heed_signals(alive: int) -> None:
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the parent gets it, too, and ends
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    signal.signal(signal.SIGTERM, _end)
    signal.signal(signal.SIGPROF, _interrupt)
    threading.Thread(target=_watch, args=(alive,), daemon=True).start()


def _watch(alive: int) -> None:
    """End this process once nobody holds the other end of a pipe."""
    os.read(alive, 1)
    _end()
    time.sleep(SHUTDOWN_TIMEOUT)
    os._exit(1)


def _end(*_: Any) -> None:
    """Let the current task come to its end; interrupt it after some time of processors, then kill.

    An exception is the second choice, because it might be lost, or leave temporary files behind.
    """
    ending.begin()
    signal.setitimer(signal.ITIMER_PROF, ending.GRACE, ending.GRACE)


def _interrupt(number: int, frame: FrameType | None) -> None:
    signal.signal(number, signal.SIG_DFL)  # the next one kills this process
    ending.interrupt(frame)


def _prepare(threads: int) -> None:
    """Send what other detectors print to standard error, and limit threads."""
    if sys.stdout and sys.stderr:  # otherwise other files may have their numbers
        os.dup2(2, 1)
    sys.stdout = sys.stderr
    import cv2

    cv2.setNumThreads(threads)


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
