"""One thread that works off jobs, of which only the latest may wait."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Result = TypeVar('Result')


class Worker:
    """Runs jobs one at a time, beside the threads that answer parameters and services.

    A live stream offers its jobs: while one runs, only the latest waits. A request calls its job:
    it runs in any case, and its caller gets the result.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._lock = threading.Lock()
        self._latest: Callable[[], None] | None = None

    def offer(self, job: Callable[[], None]) -> bool:
        """Run `job`, which handles its own errors, unless a later one is offered before its turn.

        Returns
        -------
        bool
            Whether an earlier job was waiting and is dropped.
        """
        with self._lock:
            dropped = self._latest is not None
            self._latest = job
        if not dropped:
            self._submit(self._run_latest)
        return dropped

    def call(self, job: Callable[[], Result]) -> Result:
        """Run `job` and return its result, or raise its error.

        Raises
        ------
        concurrent.futures.CancelledError
            If the worker is stopped before the turn of `job`.
        """
        return self._submit(job).result()

    def stop(self) -> None:
        """Drop the jobs that wait and return when the one that runs has ended."""
        self._thread.shutdown(cancel_futures=True)

    def _submit(self, job: Callable[[], Result]) -> Future[Result]:
        try:
            return self._thread.submit(job)
        except RuntimeError:  # stopped
            future: Future[Result] = Future()
            future.cancel()
            return future

    def _run_latest(self) -> None:
        with self._lock:
            job, self._latest = self._latest, None
        if job is not None:
            job()
