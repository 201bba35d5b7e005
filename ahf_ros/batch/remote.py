"""What runs on a worker of a cluster: a task, in a process of its own.

The process shields the worker from images that kill, so that the limits of `TRIES` hold on a
cluster whatever its configuration is, and gives each thread of the worker its own interpreter.
"""

from __future__ import annotations

import pickle
import socket
import threading
from collections.abc import Callable
from typing import Any

from ahf_ros.batch.engine import Job
from ahf_ros.batch.processes import ProcessEngine

_engines = threading.local()


def perform(content: bytes, topic: str) -> tuple[str, Any]:
    """Process a task, and return it with the name of the machine.

    Parameters
    ----------
    content : bytes
        The pickled job, number and task.
    topic : str
        Topic of the reports of the job.

    Returns
    -------
    machine : str
    outcome : bytes or ValueError
        What the job returns or `TaskFailed`, pickled; or what it raises.
    """
    from distributed import get_worker

    worker = get_worker()
    job, number, task = pickle.loads(content)
    engine = _engine_of(job)
    engine.report = lambda _, *report: worker.log_event(topic, (number, *report))
    engine.submit(number, task)
    try:
        found = engine.wait()
        assert found is not None  # there is no limit of time
        outcome: Any = pickle.dumps(found[1])
    except (ValueError, RuntimeError) as error:
        outcome = error
    return f'{socket.gethostname()}, {worker.address}', outcome


def _engine_of(job: Job) -> ProcessEngine:
    """Return the engine of this thread, whose process has the imports of its last task."""
    before: tuple[Job, ProcessEngine] | None = getattr(_engines, 'last', None)
    if before and before[0] == job:
        return before[1]
    if before:
        before[1].close()
    engine = ProcessEngine(job, 1)
    _engines.last = job, engine
    return engine


def guarded_perform() -> Callable[[bytes, str, str], Any]:
    """Return a function that performs a task where the same release is installed.

    It is pickled with its code, because it is defined in a function. So the scheduler need not
    have this package, and a worker without it can say so.
    """

    def identify(content: bytes, topic: str, release: str) -> Any:
        from contextlib import suppress

        from distributed import get_worker

        address = ''
        with suppress(ValueError):  # it is only asked
            address = get_worker().address
        try:
            from ahf_ros.batch.remote import perform
            from ahf_ros.release import release as installed
        except ImportError as error:
            return None, (address, f'has no ahf_ros: {error}')
        if installed() != release:
            return None, (address, f'has ahf_ros {installed()}, accepted is {release}')
        return perform(content, topic) if content else None

    return identify
