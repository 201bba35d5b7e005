"""A thread with a queue of jobs."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from typing import TypeVar

Result = TypeVar('Result')


class Worker:
    """Runs jobs in order, one at a time, in a thread of its own; while it is paused, they wait."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._turn = threading.Condition()  # held while a job runs
        self._paused = self._stopped = False

    def append(self, job: Callable[[], Result]) -> Future[Result]:
        """Run `job`, unless the worker is stopped first, which cancels it."""
        try:
            return self._thread.submit(self._in_turn, job)
        except RuntimeError:  # stopped
            future: Future[Result] = Future()
            future.cancel()
            return future

    def call(self, job: Callable[[], Result]) -> Result:
        """Run `job` and return its result, or raise its error.

        Raises a `concurrent.futures.CancelledError` if the worker is stopped before its turn.
        """
        return self.append(job).result()

    def pause(self) -> None:
        """Let jobs wait, and return when the running one has ended."""
        self._paused = True
        with self._turn:
            pass

    def resume(self) -> None:
        """Run the jobs that wait."""
        with self._turn:
            self._paused = False
            self._turn.notify()

    def discard(self) -> None:
        """Drop the waiting jobs and return when the running one has ended; the worker goes on."""
        self.stop()
        self._paused = self._stopped = False
        self._thread = ThreadPoolExecutor(max_workers=1)

    def stop(self) -> None:
        """Drop the waiting jobs and return when the running one has ended."""
        self._stopped = True
        with self._turn:
            self._turn.notify()
        self._thread.shutdown(cancel_futures=True)

    def _in_turn(self, job: Callable[[], Result]) -> Result:
        with self._turn:
            self._turn.wait_for(lambda: self._stopped or not self._paused)
            if self._stopped:
                raise CancelledError
            return job()
