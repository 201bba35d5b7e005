"""A thread with a queue of jobs: all of them, or only the latest."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import TypeVar

Result = TypeVar('Result')


@dataclass(slots=True)
class _Offer:
    """The turn of a job, which a newer job may take over."""

    job: Callable[[], None]
    prepare: Callable[[], None] | None


class Worker:
    """Runs jobs one at a time in a thread of its own.

    `offer` is for a live stream: while a job runs, only the latest one waits. `append` is for a
    stream that must be complete: jobs run in order. `call` is for requests: the job runs in any
    case, and the caller gets the result. While the worker is paused, all jobs wait.

    A job may be prepared in another thread, while the one before it runs.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: _Offer | None
        self._start()
        self._going = threading.Event()
        self._going.set()
        self._running = threading.Lock()
        self._stopped = False

    def offer(self, job: Callable[[], None], prepare: Callable[[], None] | None = None) -> bool:
        """Run `job`, which handles its own errors, unless a newer one is offered before its turn.

        Parameters
        ----------
        job : callable
        prepare : callable, optional
            Called while another job that was offered runs, for one job at a time, which is not
            dropped any more then. Must take care that both agree. Its errors are ignored.

        Returns
        -------
        bool
            Whether a waiting job was dropped.
        """
        with self._lock:
            dropped = self._waiting is not None
            if self._waiting:
                self._waiting.job, self._waiting.prepare = job, prepare
            else:
                self._waiting = _Offer(job, prepare)
                self._submit(partial(self._take_up, self._waiting))
            self._prepare_next()
        return dropped

    @property
    def waiting(self) -> bool:
        """Whether a job that was offered waits, prepared or not."""
        return self._waiting is not None or self._prepared

    def append(self, job: Callable[[], None], prepare: Callable[[], None] | None = None) -> None:
        """Run `job`, which handles its own errors, after all jobs that were appended before.

        Parameters
        ----------
        job : callable
        prepare : callable, optional
            Called before or while `job` runs, once the job appended before with such a callable
            has begun; must take care that both agree. Its errors are ignored.
        """
        if prepare is None:
            self._submit(job)
            return
        number = next(self._numbers)
        with suppress(RuntimeError):  # stopped
            self._helpers.submit(self._ahead, prepare, number)
        self._submit(partial(self._begin, job, number))

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
        self._start()

    def stop(self) -> None:
        """Drop the waiting jobs and return when the running one has ended."""
        self._stopped = True
        self._going.set()
        with self._begins:
            self._begins.notify_all()
        self._thread.shutdown(cancel_futures=True)
        self._helpers.shutdown(cancel_futures=True)

    def _submit(self, job: Callable[[], Result]) -> Future[Result]:
        try:
            return self._thread.submit(self._in_turn, job)
        except RuntimeError:  # stopped
            future: Future[Result] = Future()
            future.cancel()
            return future

    def _start(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1)
        # Two, because the current job may wait for its own preparation.
        self._helpers = ThreadPoolExecutor(max_workers=2)
        self._numbers = count(1)
        self._begun = 0  # number of the last job with a preparation that has begun
        self._begins = threading.Condition()
        self._waiting = None  # the latest, unless it is being prepared
        self._prepared = False  # whether one is being prepared or waits for its turn after that
        self._taken_up = False  # whether one runs

    def _begin(self, job: Callable[[], None], number: int) -> None:
        with self._begins:
            self._begun = number
            self._begins.notify_all()
        job()

    def _ahead(self, prepare: Callable[[], None], number: int) -> None:
        with self._begins:
            self._begins.wait_for(lambda: self._begun >= number - 1 or self._stopped)
        if not self._stopped:
            prepare()

    def _in_turn(self, job: Callable[[], Result]) -> Result:
        while True:
            self._going.wait()
            with self._running:
                if self._stopped:
                    raise CancelledError
                if self._going.is_set():
                    return job()

    def _take_up(self, offer: _Offer) -> None:
        with self._lock:
            if self._waiting is offer:
                self._waiting = None
            else:
                self._prepared = False
            self._taken_up = True
            self._prepare_next()
        offer.job()
        with self._lock:
            self._taken_up = False

    def _prepare_next(self) -> None:
        """Prepare the offer that waits, if one runs and none is prepared; needs the lock."""
        offer = self._waiting
        if offer and offer.prepare and self._taken_up and not self._prepared:
            self._waiting, self._prepared = None, True
            with suppress(RuntimeError):  # stopped
                self._helpers.submit(offer.prepare)
