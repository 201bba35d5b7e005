"""A thread with a queue of jobs."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from typing import TypeVar

Result = TypeVar('Result')


class Worker:
    """Runs jobs in order, one at a time, in a thread of its own.

    While the worker is paused, all jobs wait.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._going = threading.Event()
        self._going.set()
        self._running = threading.Lock()
        self._stopped = False

    def append(self, job: Callable[[], None]) -> None:
        """Run `job`, which handles its own errors, unless the worker is stopped first."""
        self._submit(job)

    def call(self, job: Callable[[], Result]) -> Result:
        """Run `job` and return its result, or raise its error.

        Raises
        ------
        concurrent.futures.CancelledError
            If the worker is stopped before the turn of `job`.
        """
        return self._submit(job).result()

    def pause(self) -> None:
        """Let jobs wait, and return when the running one has ended."""
        self._going.clear()
        with self._running:
            pass

    def resume(self) -> None:
        """Run the jobs that wait."""
        self._going.set()

    def discard(self) -> None:
        """Drop the waiting jobs and return when the running one has ended; the worker goes on."""
        self.stop()
        self._stopped = False
        self._thread = ThreadPoolExecutor(max_workers=1)

    def stop(self) -> None:
        """Drop the waiting jobs and return when the running one has ended."""
        self._stopped = True
        self._going.set()
        self._thread.shutdown(cancel_futures=True)

    def _submit(self, job: Callable[[], Result]) -> Future[Result]:
        try:
            return self._thread.submit(self._in_turn, job)
        except RuntimeError:  # stopped
            future: Future[Result] = Future()
            future.cancel()
            return future

    def _in_turn(self, job: Callable[[], Result]) -> Result:
        while True:
            self._going.wait()
            with self._running:
                if self._stopped:
                    raise CancelledError
                if self._going.is_set():
                    return job()
