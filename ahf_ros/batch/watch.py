"""A batch without an end: the images that arrive in a folder."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping

from ahf_ros import ending
from ahf_ros.batch.arrivals import Alarm, Arrivals
from ahf_ros.batch.engine import Engine
from ahf_ros.batch.plan import make_plan, out_of_date
from ahf_ros.batch.results_file import ResultsFile
from ahf_ros.batch.run import outcome_of
from ahf_ros.batch.task import ImageOutcome, ImageTask, Message

_BUSY = 0.2  # s after which waiting for a result is interrupted


def watch(
    engine: Engine,
    arrivals: Arrivals,
    alarm: Alarm,
    results: ResultsFile,
    task_of: Callable[[str], ImageTask],
    interval: float,
    say: Callable[[str], None],
) -> Iterator[ImageOutcome]:
    """Yield the outcome of each image that arrives, once its result is written, without an end.

    Parameters
    ----------
    engine : Engine
        Its job is `ahf_ros.batch.identification.identify_images`.
    arrivals : Arrivals
    alarm : Alarm
    results : ResultsFile
        What it has already is not done again.
    task_of : callable
        From the path of an image to its task.
    interval : float
        Time between two looks at the folder where nothing happens, s.
    say : callable
        Called with lines for people.

    Raises
    ------
    Unwritable
        If the results cannot be written.
    """
    running: dict[int, ImageTask] = {}
    waiting: deque[ImageTask] = deque()
    begun = 0
    looked = -interval
    while True:
        now = time.monotonic()
        if not running or now - looked >= interval:
            looked = now
            plan = make_plan(list(map(task_of, _taken(arrivals, alarm, say))), results)
            if plan.notes:
                yield ImageOutcome(messages=tuple(map(Message, plan.notes)))
            waiting += plan.pending
        while len(running) < engine.capacity and (task := _next(waiting, running, results)):
            running[begun] = task
            engine.submit(begun, task)
            begun += 1
        if not running:
            alarm.wait(min(interval, _BUSY) if arrivals.settling else interval)
            continue
        found = engine.wait(_BUSY)
        ending.check()
        if found is not None:
            task = running.pop(found[0])
            outcome = outcome_of(task, found[1])
            results.append(task, outcome)
            yield outcome


def _next(
    waiting: deque[ImageTask], running: Mapping[int, ImageTask], results: ResultsFile
) -> ImageTask | None:
    """Return a task that still has to be done and whose image is not being identified."""
    for _ in range(len(waiting)):
        task = waiting.popleft()
        if any(task.paths == other.paths for other in running.values()):
            waiting.append(task)
        elif out_of_date(task, results) is not None:
            return task
    return None


def _taken(arrivals: Arrivals, alarm: Alarm, say: Callable[[str], None]) -> list[str]:
    """Return what has arrived, and say when the folder goes away and comes back."""
    before = arrivals.away
    paths = arrivals.take()
    if arrivals.away and not before:
        say(f'the folder cannot be read, waiting for it: {arrivals.away}')
    if before and not arrivals.away:
        say('the folder is back')
        alarm.set()
    return paths
