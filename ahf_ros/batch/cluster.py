"""The engine of many machines: workers of a scheduler of dask.distributed [1]_.

The engine keeps what it has submitted until it has the result, so it survives workers that die. It
ends with the scheduler. On a worker, each task is in a process of its own. That shields the worker
from images that kill, so the limits of `TRIES` hold on a cluster whatever its configuration is,
and gives each thread of the worker its own interpreter.

References
----------
.. [1] Rocklin, Dask: Parallel Computation with Blocked algorithms and Task Scheduling, Proceedings
   of the 14th Python in Science Conference, 2015.
"""

import asyncio
import logging
import math
import pickle
import queue
import socket
import threading
import time
import uuid
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from typing import Any

from ahf_ros.base.extras import need
from ahf_ros.base.text import reason_of
from ahf_ros.batch.engine import TRIES, EngineLost, Job, Report, TaskFailed, no_report
from ahf_ros.batch.processes import ProcessEngine

# What calls of a client raise whose scheduler is away.
_CONNECTION_ERRORS = (OSError, asyncio.TimeoutError, asyncio.CancelledError, RuntimeError)

_CONNECT = 10.0  # s in which a scheduler has to answer
_LOOK = 2.0  # s between two looks at the workers
_WAIT = 0.1  # s after which waiting is interrupted
_AT_A_TIME = 2  # tasks for each thread of a worker: one that it works on and one that waits

_thread = threading.local()  # of a worker


def connect(address: str) -> Any:
    """Return a client of a scheduler, whose address is such as tcp://host:8786.

    It raises a `MissingExtra` if distributed is not installed, a ValueError if no scheduler
    answers or it has another version.
    """
    need('cluster')
    import distributed

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


def refused_workers(client: Any) -> dict[str, str]:
    """Return why a worker cannot process tasks of this client, empty if it can, by its address."""
    versions = client.get_versions(packages=['ahf_ros'])
    mine = _installed(versions['client'])
    refused = {}
    for worker, found in versions['workers'].items():
        others = [
            f'{name} {theirs}, accepted is {mine[name]}'
            for name, theirs in _installed(found).items()
            if theirs != mine[name]
        ]
        refused[worker] = f'has {others[0]}' if others else ''
    return refused


def _installed(versions: dict[str, Any]) -> dict[str, str]:
    python = '.'.join(versions['host']['python'].split('.')[:2])
    return {'Python': python, 'ahf_ros': versions['packages']['ahf_ros'] or 'not installed'}


def _is_news(record: logging.LogRecord) -> bool:
    """Return whether a record is about anything but a connection that is lost or closed."""
    return not (record.exc_info and isinstance(record.exc_info[1], _CONNECTION_ERRORS))


def perform(content: bytes, topic: str) -> tuple[str, Any]:
    """Process a task on a worker, and return the name of the machine and what became of the task.

    `content` is the pickled job, number and task, `topic` that of the reports of the job. What the
    job returns, or `TaskFailed`, is pickled; what it raises is not.
    """
    from distributed import get_worker

    worker = get_worker()
    job, number, task = pickle.loads(content)
    last: tuple[Any, Any] = getattr(_thread, 'last', (None, None))
    before, engine = last
    if job != before:  # a process has the imports of its last task
        if engine:
            engine.close()
        engine = ProcessEngine(job, 1)
        _thread.last = job, engine
    engine.report = lambda _, *report: worker.log_event(topic, (number, *report))
    engine.submit(number, task)
    try:
        outcome: Any = pickle.dumps(engine.wait()[1])
    except (ValueError, RuntimeError) as error:
        outcome = error
    return f'{socket.gethostname()}, {worker.address}', outcome


def _performer() -> Callable[[bytes, str], Any]:
    """Return `perform` pickled with its code, so the scheduler need not have this package."""

    def identify(content: bytes, topic: str) -> Any:
        from ahf_ros.batch.cluster import perform

        return perform(content, topic)

    return identify


class DaskEngine:
    """The engine that processes tasks on the workers of a scheduler.

    `report` is called with the number of the task before what the job reports, `say` with lines
    for people: workers that are refused or missing. `located` makes of a result and the name of
    the machine that it comes from a result that names it. It raises what `connect` does.
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
        self._topic = uuid.uuid4().hex
        self._events: queue.SimpleQueue[Any] = queue.SimpleQueue()  # reports and ended futures
        # Number, task and the workers that may process it, by key.
        self._begun: dict[str, tuple[int, Any, set[str]]] = {}
        self._waiting: list[tuple[int, Any]] = []
        self._threads: dict[str, int] = {}  # of each worker that may process tasks
        self._refused: dict[str, str] = {}  # why, by worker; empty for those above
        self._deserted = False
        self._perform = _performer()
        self._client = connect(address)
        self._connection = self._client.scheduler_comm
        self._client.subscribe_topic(self._topic, lambda event: self._events.put(event[1]))
        self._look()

    @property
    def capacity(self) -> int:
        """Number of tasks that it holds at a time; it changes with the workers."""
        return max(_AT_A_TIME * sum(self._threads.values()), 1)

    def submit(self, number: int, task: Any) -> None:
        """Hand a task to the scheduler, or keep it while there is no worker that may have it."""
        self._check_connected()
        if not self._threads:
            self._waiting.append((number, task))
            return
        future = self._client.submit(
            self._perform,
            pickle.dumps((self._job, number, task)),
            self._topic,
            key=f'identify-{uuid.uuid4().hex}',
            retries=TRIES - 1,
            workers=list(self._threads),
        )
        self._begun[future.key] = number, task, set(self._threads)
        future.add_done_callback(self._events.put)

    def wait(self, timeout: float | None = None) -> tuple[int, Any] | None:
        """Return the next result, see `ahf_ros.batch.engine.Engine`."""
        limit = math.inf if timeout is None else time.monotonic() + timeout
        while time.monotonic() <= limit:
            self._check_connected()
            if time.monotonic() - self._looked > _LOOK:
                self._look()
            waiting, self._waiting = self._waiting, []
            for number, task in waiting:
                self.submit(number, task)
            with suppress(queue.Empty):
                event = self._events.get(timeout=min(_WAIT, max(limit - time.monotonic(), 0)))
                if isinstance(event, tuple):
                    self._report(*event)
                elif found := self._result_of(event):
                    return found
        return None

    def close(self) -> None:
        """Let go of what still runs."""
        with suppress(*_CONNECTION_ERRORS):
            self._client.close(timeout=_LOOK)

    def _check_connected(self) -> None:
        """Go on, unless the scheduler is not connected any more as it was.

        A client whose connection breaks may connect again by itself before that is seen here. Its
        tasks and the subscription to reports are lost nevertheless.
        """
        same = self._client.scheduler_comm is self._connection
        if not same or self._client.status != 'running':
            raise self._lost()

    def _lost(self) -> EngineLost:
        return EngineLost(f'the scheduler {self._address} is away; the same command goes on')

    def _look(self) -> None:
        """Look at the workers, say if there are none, and keep the tasks of those that left."""
        self._looked = time.monotonic()
        with suppress(*_CONNECTION_ERRORS):
            threads = self._client.nthreads()
            if not threads.keys() <= self._refused.keys():
                for worker, reason in refused_workers(self._client).items():
                    if reason and worker not in self._refused:
                        self._say(f'worker {worker} is refused: it {reason}')
                    self._refused[worker] = reason
            self._threads = {
                worker: count
                for worker, count in threads.items()
                if self._refused.get(worker) == ''
            }
        if not self._threads and not self._deserted:
            self._say(f'{self._address} has no workers, waiting for them')
        self._deserted = not self._threads
        for key, (number, task, workers) in list(self._begun.items()):
            if not workers & self._threads.keys():
                del self._begun[key]
                self._waiting.append((number, task))

    def _result_of(self, future: Any) -> tuple[int, Any] | None:
        """Return what became of a task, None if its workers have left or it is asked for again."""
        if future.key not in self._begun:
            return None
        if future.status == 'cancelled':
            raise self._lost()
        if future.status == 'error':
            result: Any = TaskFailed(f'given up: {reason_of(future.exception())}')
        else:
            try:
                machine, outcome = future.result(timeout=_CONNECT)
            except (*_CONNECTION_ERRORS, CancelledError):  # it got lost on its way
                future.add_done_callback(self._events.put)
                return None
            if isinstance(outcome, Exception):
                raise outcome
            result = self._located(pickle.loads(outcome), machine)
        number, _, _ = self._begun.pop(future.key)
        return number, result
