"""What processes tasks: the contract of engines, and the loop that feeds them."""

import math
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from ahf_ros.base import ending

TRIES = 2
"""How often a task is tried whose process dies."""

_LIMIT = Path('/sys/fs/cgroup/cpu.max')  # of a container: time of processors, and in which time

Task = TypeVar('Task')
Result = TypeVar('Result')

Report = Callable[..., None]
"""Called by a job on the way, with what is to be known of it before its end."""

Job = Callable[[Any, Report], Any]
"""A function of a module, from a task to its result. Both can be pickled."""


@dataclass(frozen=True, slots=True)
class TaskFailed:
    """Result of a task whose process died each time, and what became of it."""

    reason: str


class EngineLost(RuntimeError):
    """An engine cannot go on; what it has not finished is left to another run."""


class Engine(Protocol):
    """Processes several tasks at a time, in any order."""

    @property
    def capacity(self) -> int:
        """Number of tasks that it holds at a time."""
        ...

    def submit(self, number: int, task: Any) -> None:
        """Begin a task; there are fewer than `capacity`."""
        ...

    def wait(self, timeout: float | None = None) -> tuple[int, Any] | None:
        """Return the number of a task that is finished, and its result or `TaskFailed`.

        After `timeout` seconds it may return None. It raises what the job has raised.
        """
        ...

    def close(self) -> None:
        """End what still runs, at once."""
        ...


@dataclass(frozen=True, slots=True)
class Finished(Generic[Task, Result]):
    """A task and its result."""

    number: int
    task: Task
    result: Result


def finished_tasks(
    engine: Engine, tasks: Iterable[Task], ahead: int = 1000
) -> Iterator[Finished[Task, Any]]:
    """Yield tasks with their results or `TaskFailed`, each as soon as it is finished.

    Tasks are drawn as the engine can take them, and at most `ahead` are begun from the first one
    on that is not finished.

    Examples
    --------
    >>> engine = SerialEngine(lambda task, report: task**2)
    >>> [it.result for it in finished_tasks(engine, [1, 2, 3])]
    [1, 4, 9]
    """
    waiting = enumerate(tasks)
    running: dict[int, Task] = {}
    following: tuple[int, Task] | None = next(waiting, None)
    while following or running:
        while (
            following
            and len(running) < engine.capacity
            and following[0] - min(running, default=following[0]) < ahead
        ):
            running.update([following])
            engine.submit(*following)
            following = next(waiting, None)
        ending.check()  # before it waits
        found = engine.wait()
        ending.check()  # the result may come from a program that was ended
        if found is not None:
            number, result = found
            yield Finished(number=number, task=running.pop(number), result=result)


def in_order(finished: Iterable[Finished[Task, Result]]) -> Iterator[Finished[Task, Result]]:
    """Yield finished tasks in the order of their numbers, each as soon as those before it are.

    Examples
    --------
    >>> [it.number for it in in_order(Finished(number, None, None) for number in (1, 2, 0))]
    [0, 1, 2]
    """
    early: dict[int, Finished[Task, Result]] = {}
    following = 0
    for item in finished:
        early[item.number] = item
        while following in early:
            yield early.pop(following)
            following += 1


def available_cores() -> int:
    """Return the number of processor cores that this process, or its container, may use."""
    cores = os.cpu_count() or 1
    if hasattr(os, 'sched_getaffinity'):  # not on macOS
        cores = len(os.sched_getaffinity(0))
    with suppress(OSError, ValueError):  # no control groups, or no limit, which is 'max'
        quota, period = map(int, _LIMIT.read_text().split())
        cores = min(cores, math.ceil(quota / period))
    return max(cores, 1)


def no_report(*_: Any) -> None:
    """Take a report for which nobody waits."""


class SerialEngine:
    """The engine that processes tasks in this process, one after the other.

    `report` is called with the number of the task before what the job reports.
    """

    capacity = 1

    def __init__(self, job: Job, report: Report = no_report) -> None:
        self._job = job
        self._report = report
        self._submitted: list[tuple[int, Any]] = []

    def submit(self, number: int, task: Any) -> None:
        """Keep the task until the result is asked for."""
        self._submitted.append((number, task))

    def wait(self, timeout: float | None = None) -> tuple[int, Any]:
        """Process the task, however long it takes."""
        number, task = self._submitted.pop(0)
        return number, self._job(task, lambda *report: self._report(number, *report))

    def close(self) -> None:
        """Forget tasks that were not begun."""
        self._submitted.clear()
