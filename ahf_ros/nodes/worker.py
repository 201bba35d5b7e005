"""A thread with a queue of jobs: all of them, or only the latest."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Result = TypeVar('Result')


class Worker:
    """Runs jobs one at a time in a thread of its own.

    `offer` is for a live stream: while a job runs, only the latest one waits. `append` is for a
    stream that must be complete: jobs run in order. `call` is for requests: the job runs in any
    case, and the caller gets the result.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._lock = threading.Lock()
        self._latest: Callable[[], None] | None = None

    def offer(self, job: Callable[[], None]) -> bool:
        """Run `job`, which handles its own errors, unless a newer one is offered before its turn.

        Returns
        -------
        bool
            Whether a waiting job was dropped.
        """
        with self._lock:
            dropped = self._latest is not None
            self._latest = job
        if not dropped:
            self._submit(self._run_latest)
        return dropped

    def append(self, job: Callable[[], None]) -> None:
        """Run `job`, which handles its own errors, after all jobs that were appended before."""
        self._submit(job)

    def call(self, job: Callable[[], Result]) -> Result:
        """Run `job` and return its result, or raise its error.

        Raises
        ------
        concurrent.futures.CancelledError
            If the worker is stopped before the turn of `job`.
        """
        return self._submit(job).result()

    def stop(self) -> None:
        """Drop the waiting jobs and return when the running one has ended."""
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
