"""The engine of one machine: worker processes, each with one task at a time.

A worker that dies takes nothing along but its task, which another one tries once more. Each has a
pipe of its own to the process that started it, so no lock outlives a worker that is killed, and it
ends when that pipe is closed, at the latest when the process that started it is gone. With pebble
5.2, a worker whose parent was killed worked on, and a task whose worker had died was not tried
again.
"""

import os
import select
import signal
import subprocess
import sys
import threading
import time
import traceback
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import FrameType
from typing import Any

from ahf_ros.base import ending
from ahf_ros.base.text import reason_of
from ahf_ros.batch.engine import TRIES, Job, Report, TaskFailed, no_report

SHUTDOWN_TIMEOUT = 10 * ending.GRACE
"""Time after which a worker is taken to be stuck at its end, s."""

_PIPE_CLOSED = (EOFError, OSError)  # what the pipe of a process that has ended raises
_PACKAGE = str(Path(__file__).parents[2])
_BEGIN = (
    'import sys; sys.path.insert(0, sys.argv[1]); '
    'from ahf_ros.batch.processes import work_on; work_on(int(sys.argv[2]))'
)


class Kind(IntEnum):
    """What a worker sends."""

    REPORT = 0
    DONE = 1
    RAISED = 2


def work_on(descriptor: int) -> None:
    """Process tasks that come through a pipe until it is closed, or until a signal ends that."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the parent gets it, too, and ends
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    signal.signal(signal.SIGTERM, _end)
    signal.signal(signal.SIGPROF, _interrupt)
    threading.Thread(target=_watch, args=(descriptor,), daemon=True).start()
    work(Connection(descriptor))


def work(pipe: Connection) -> None:
    """Process tasks that come through a pipe until it is closed."""

    def report(*values: Any) -> None:
        with suppress(*_PIPE_CLOSED):  # this process is about to end
            pipe.send((Kind.REPORT, values))

    with suppress(*_PIPE_CLOSED):
        sys.path[:] = pipe.recv()
        job, threads = pipe.recv()
        if sys.stdout and sys.stderr:  # otherwise other files may have their numbers
            os.dup2(2, 1)
        sys.stdout = sys.stderr  # also of what other detectors print
        import cv2

        cv2.setNumThreads(threads)
        while True:
            task = pipe.recv()
            result: tuple[Kind, Any]
            try:
                result = Kind.DONE, job(task, report)
            except ValueError as error:
                result = Kind.RAISED, ValueError(str(error))
            except Exception as error:
                traceback.print_exc()  # which the exception of another process does not have
                result = Kind.RAISED, RuntimeError(reason_of(error))
            ending.check()  # the result may come from a program that was ended
            pipe.send(result)


def _watch(descriptor: int) -> None:
    """End this process once nobody holds the other end of the pipe."""
    closed = select.poll()
    closed.register(descriptor, 0)  # only that is told without being asked for
    closed.poll()
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


class _Spawned:
    """A process of multiprocessing, with the face of one of subprocess."""

    def __init__(self, pipe: Connection) -> None:
        self._process = get_context('spawn').Process(target=work, args=(pipe,), daemon=True)
        self._process.start()

    @property
    def returncode(self) -> int:
        """Exit status, 0 where it still runs."""
        return self._process.exitcode or 0

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end."""
        self._process.join(timeout)
        return self.returncode

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()


@dataclass(slots=True, eq=False)
class _Worker:
    """A process, the pipe to it, and the task that it has; it is idle before the first try."""

    process: subprocess.Popen[bytes] | _Spawned
    pipe: Connection
    number: int = -1
    task: Any = None
    tries: int = 0


class ProcessEngine:
    """The engine that processes tasks in worker processes.

    At most `count` workers are started, as they are needed, in each of which OpenCV uses `threads`
    threads. They end with this process, however it ends. What they print goes to standard error.
    `report` is called in this process with the number of the task before what the job reports; it
    may be replaced between two tasks.
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
            busy = {worker.pipe: worker for worker in self._workers if worker.tries}
            ready = wait(list(busy), timeout)
            if not ready:
                return None
            for pipe in ready:
                worker = busy[pipe]  # type: ignore[index]
                number = worker.number
                try:
                    kind, content = worker.pipe.recv()
                except _PIPE_CLOSED:
                    self._remove(worker)
                    if worker.tries == TRIES:
                        how = _how_ended(worker.process.returncode)
                        return number, TaskFailed(
                            f'given up, {TRIES} processes that worked on it died, the last {how}'
                        )
                    self._hand_over(number, worker.task, worker.tries + 1)
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
            worker.pipe.close()  # so it ends
        limit = time.monotonic() + SHUTDOWN_TIMEOUT
        for worker in self._workers:
            with suppress(subprocess.TimeoutExpired):
                worker.process.wait(max(limit - time.monotonic(), 0))
            worker.process.kill()
            worker.process.wait()
        self._workers.clear()

    def _hand_over(self, number: int, task: Any, tries: int) -> None:
        for worker in [it for it in self._workers if not it.tries]:
            with suppress(*_PIPE_CLOSED):  # killed while it had nothing to do
                worker.pipe.send(task)
                break
            self._remove(worker)
        else:
            worker = _start()
            self._workers.append(worker)
            with suppress(*_PIPE_CLOSED):  # `wait` finds that it has died
                worker.pipe.send(sys.path)
                worker.pipe.send((self._job, self._threads))
                worker.pipe.send(task)
        worker.number, worker.task, worker.tries = number, task, tries

    def _remove(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.pipe.close()
        worker.process.wait()


def _start() -> _Worker:
    pipe, other = Pipe()
    if not hasattr(signal, 'pthread_sigmask'):  # on Windows, where a pipe is not inherited either
        spawned = _Spawned(other)
        other.close()
        return _Worker(spawned, pipe)
    # It does not heed Ctrl-C before it can ignore it.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        process = subprocess.Popen(
            [sys.executable, '-c', _BEGIN, _PACKAGE, str(other.fileno())],
            pass_fds=[other.fileno()],
        )
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        other.close()
    return _Worker(process, pipe)


def _how_ended(status: int) -> str:
    if status >= 0:
        return f'with status {status}'
    with suppress(ValueError):
        return f'by {signal.Signals(-status).name}'
    return f'by signal {-status}'
