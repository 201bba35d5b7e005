"""The engine of many machines: workers of a scheduler of dask.distributed [1]_.

The engine keeps what it has submitted until it has the result, so it survives workers that die. It
ends with the scheduler.

References
----------
.. [1] Rocklin, Dask: Parallel Computation with Blocked algorithms and Task Scheduling, Proceedings
   of the 14th Python in Science Conference, 2015.
"""

from __future__ import annotations

import asyncio
import logging
import math
import pickle
import platform
import queue
import time
import uuid
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from ahf_ros.batch.engine import TRIES, EngineLost, Job, Report, TaskFailed, no_report
from ahf_ros.batch.remote import guarded_perform
from ahf_ros.release import release
from ahf_ros.text import reason_of

CONNECTION_ERRORS = (OSError, asyncio.TimeoutError, asyncio.CancelledError, RuntimeError)
"""What calls of a client raise whose scheduler is away."""

_CONNECT = 10.0  # s in which a scheduler has to answer

_LOOK = 2.0  # s between two looks at the workers
_WAIT = 0.1  # s after which waiting is interrupted
_AT_A_TIME = 2  # tasks for each thread of a worker: one that it works on and one that waits


def connect(address: str) -> Any:
    """Return a client of a scheduler.

    Parameters
    ----------
    address : str
        Such as tcp://host:8786.

    Raises
    ------
    ValueError
        If distributed is not installed, no scheduler answers, or it has another version.
    """
    try:
        import distributed
    except ModuleNotFoundError as error:
        raise ValueError(
            f"{error.name} is not installed, clusters need it: pip install 'ahf_ros[cluster]'"
        ) from error
    # What it logs of a scheduler that is away is said in other words.
    for name in list(logging.root.manager.loggerDict):
        if name.partition('.')[0] == 'distributed':
            logging.getLogger(name).setLevel(logging.CRITICAL)
    logging.getLogger('tornado.application').addFilter(_is_news)
    try:
        client = distributed.Client(address, timeout=_CONNECT, set_as_default=False)
    except Exception as error:  # a scheduler of another version may answer anything
        raise ValueError(
            f'scheduler is {address!r}, accepted is the address of a scheduler of '
            f'dask.distributed {distributed.__version__} that answers: {reason_of(error)}'
        ) from error
    try:
        check_version(client, address)
    except BaseException:
        client.close(timeout=1)
        raise
    return client


def refused_workers(client: Any) -> dict[str, str]:
    """Return the workers that cannot process tasks of this client, and why, by their address."""
    mine = _python(platform.python_version())
    refused = {}
    for worker, found in client.get_versions()['workers'].items():
        theirs = _python(found['host']['python'])
        if theirs != mine:
            refused[worker] = f'has Python {theirs}, accepted is {mine}'
    fit = [worker for worker in client.nthreads() if worker not in refused]
    if not fit:
        return refused
    answers = client.run(guarded_perform(), b'', '', release(), workers=fit, on_error='return')
    for worker, answer in answers.items():
        if isinstance(answer, BaseException):
            refused[worker] = f'does not work: {reason_of(answer)}'
        elif answer:
            refused[worker] = answer[1][1]
    return refused


def check_version(client: Any, address: str) -> None:
    """Refuse a scheduler of another version: pickled objects differ."""
    try:
        versions = client.get_versions()
        mine, theirs = (versions[of]['packages']['distributed'] for of in ('client', 'scheduler'))
    except Exception as error:
        raise ValueError(f'scheduler {address} cannot be asked: {reason_of(error)}') from error
    if mine != theirs:
        raise ValueError(
            f'scheduler {address} has dask.distributed {theirs}, accepted is {mine} as here'
        )


def _is_news(record: logging.LogRecord) -> bool:
    """Return whether a record is about anything but a connection that is lost or closed."""
    return not (record.exc_info and isinstance(record.exc_info[1], CONNECTION_ERRORS))


def _python(version: str) -> str:
    return '.'.join(version.split('.')[:2])


@dataclass(frozen=True, slots=True)
class _Begun:
    """A task that the scheduler has."""

    number: int
    task: Any
    workers: frozenset[str]  # that may process it; all if empty


class DaskEngine:
    """The engine that processes tasks on the workers of a scheduler.

    Parameters
    ----------
    job : callable
        A function of a module.
    address : str
        Of the scheduler, such as tcp://host:8786.
    report : callable, optional
        Called with the number of the task before what the job reports.
    say : callable, optional
        Called with lines for people: workers that are refused or missing.
    located : callable, optional
        From a result and the name of the machine that it comes from to a result that names it.

    Raises
    ------
    ValueError
        If distributed is not installed, or there is no scheduler or one of another version.
    """

    def __init__(
        self,
        job: Job,
        address: str,
        report: Report = no_report,
        say: Callable[[str], None] = no_report,
        located: Callable[[Any, str], Any] = lambda result, _: result,
    ) -> None:
        self._job = job
        self._address = address
        self._report = report
        self._say = say
        self._located = located
        self._name = uuid.uuid4().hex
        self._reports: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._begun: dict[str, _Begun] = {}
        self._waiting: list[_Begun] = []
        self._results: deque[tuple[int, Any]] = deque()
        self._refused: dict[str, str] = {}
        self._submissions = 0
        self._late: set[str] = set()
        self._deserted = False
        self._perform = guarded_perform()
        self._connect()

    @property
    def capacity(self) -> int:
        """Number of tasks that it holds at a time; it changes with the workers."""
        good = (count for name, count in self._threads.items() if name not in self._refused)
        return max(_AT_A_TIME * sum(good), 1)

    def submit(self, number: int, task: Any) -> None:
        """Hand a task to the scheduler."""
        self._begin(_Begun(number, task, frozenset()))

    def wait(self, timeout: float | None = None) -> tuple[int, Any] | None:
        """Return the next result, see `ahf_ros.batch.engine.Engine`."""
        limit = math.inf if timeout is None else time.monotonic() + timeout
        while time.monotonic() <= limit:
            self._deliver_reports()
            for future, result in self._completed.next_batch(block=False):
                self._take(future, result)
            if self._results:
                return self._results.popleft()
            self._keep_up()
            condition = self._completed.thread_condition
            with condition:
                if not self._completed.has_ready():
                    condition.wait(min(_WAIT, max(limit - time.monotonic(), 0)))
        return None

    def close(self) -> None:
        """Let go of what still runs."""
        with suppress(*CONNECTION_ERRORS):
            self._client.close(timeout=_LOOK)

    def _connect(self) -> None:
        from distributed import as_completed

        self._client = connect(self._address)
        self._connection = self._client.scheduler_comm
        self._completed = as_completed(
            loop=self._client.loop, with_results=True, raise_errors=False
        )
        self._client.subscribe_topic(self._name, lambda event: self._reports.put(event[1]))
        self._threads = dict(self._client.nthreads())
        for worker, reason in refused_workers(self._client).items():
            self._refuse(worker, reason)
        self._look()

    def _connected(self) -> bool:
        """Return whether the scheduler is still connected as it was.

        A client whose connection breaks may connect again by itself before that is seen here. Its
        tasks and the subscription to reports are lost nevertheless.
        """
        running: bool = self._client.status == 'running'
        return running and self._client.scheduler_comm is self._connection

    def _lost(self) -> EngineLost:
        return EngineLost(f'the scheduler {self._address} is away; the same command goes on')

    def _look(self) -> None:
        """Look at the workers, and say if there are none."""
        self._looked = time.monotonic()
        with suppress(*CONNECTION_ERRORS):
            self._threads = dict(self._client.nthreads())
        deserted = not self._good()
        if deserted and not self._deserted:
            self._say(f'{self._address} has no workers, waiting for them')
        self._deserted = deserted

    def _good(self) -> frozenset[str]:
        return frozenset(self._threads) - frozenset(self._refused)

    def _refuse(self, worker: str, reason: str) -> None:
        if worker not in self._refused:
            self._refused[worker] = reason
            self._say(f'worker {worker} is refused: it {reason}')

    def _begin(self, begun: _Begun) -> None:
        """Submit a task, or keep it while there is no worker that may have it."""
        if not self._connected():
            raise self._lost()
        workers = self._good() if self._refused else frozenset()
        if self._refused and not workers:
            self._waiting.append(begun)
            return
        self._submissions += 1
        key = f'identify-{self._name}-{begun.number}-{self._submissions}'
        content = pickle.dumps((self._job, begun.number, begun.task))
        self._begun[key] = _Begun(begun.number, begun.task, workers)
        self._completed.add(
            self._client.submit(
                self._perform,
                content,
                self._name,
                release(),
                key=key,
                pure=False,
                retries=TRIES - 1,
                workers=sorted(workers) or None,
            )
        )

    def _take(self, future: Any, result: Any) -> None:
        """Take what became of a task; begin it again if it is not known."""
        begun = self._begun.pop(future.key, None)
        if begun is None:
            return
        if future.status == 'finished':
            machine, outcome = result
            if machine is None:
                self._refuse(*outcome)
                self._begin(begun)
            elif isinstance(outcome, Exception):
                raise outcome
            else:
                found = self._located(pickle.loads(outcome), machine)
                self._results.append((begun.number, found))
        elif future.status == 'error':
            failed = TaskFailed(f'given up: {reason_of(result[1])}')
            self._results.append((begun.number, failed))
        else:  # cancelled
            raise self._lost()

    def _keep_up(self) -> None:
        """Look at scheduler and workers, and submit what waits."""
        if not self._connected():
            raise self._lost()
        if time.monotonic() - self._looked > _LOOK:
            self._look()
            self._fetch_again()
            for key, begun in list(self._begun.items()):
                if begun.workers and not begun.workers & self._good():
                    self._waiting.append(self._begun.pop(key))
        waiting, self._waiting = self._waiting, []
        for begun in waiting:
            self._begin(begun)

    def _fetch_again(self) -> None:
        """Ask again for results that got lost on their way, which the client does not."""
        late = {
            future.key: future
            for future in list(self._completed.futures)
            if future.key in self._begun and future.done()
        }
        again = self._late & late.keys()
        for key in again:
            self._completed.add(late[key])
        self._late = late.keys() - again

    def _deliver_reports(self) -> None:
        while not self._reports.empty():
            self._report(*self._reports.get())
