"""A worker process: reads tasks from a pipe, and writes what becomes of them to another one.

`ahf_ros.batch.processes` starts it. It ends when the pipes are closed, at the latest when the
process that started it is gone.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import traceback
from contextlib import suppress
from enum import IntEnum
from functools import partial
from multiprocessing.connection import Connection
from types import FrameType
from typing import Any

from ahf_ros import ending
from ahf_ros.batch.engine import Job
from ahf_ros.text import reason_of

SHUTDOWN_TIMEOUT = 10 * ending.GRACE
"""Time after which a worker is taken to be stuck at its end, s."""

PIPE_CLOSED = (EOFError, OSError)
"""What the pipe of a process that has ended raises."""


class Kind(IntEnum):
    """What a worker sends."""

    REPORT = 0
    DONE = 1
    RAISED = 2


def main(tasks: int, answers: int, alive: int) -> None:
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
