"""The search of one hard image on many cores: an engine tries the filters.

The search itself stays in one process and is the same as with threads: each thread waits for a
worker instead of computing. A worker reads the image itself, so only values and targets travel.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ahf_ros.batch.engine import Engine, Report, SerialEngine, TaskFailed, no_report
from ahf_ros.batch.fingerprints import file_fingerprint
from ahf_ros.batch.identification import detector_of, identify_images, located, read_checked
from ahf_ros.batch.task import ImageOutcome, ImageTask
from ahf_ros.filtering.chromosome import Values
from ahf_ros.filtering.trials import Elsewhere, Trials
from ahf_ros.imaging.stack import ImageStack
from ahf_ros.session import create_identifier
from ahf_ros.settings.nested import updated
from ahf_ros.target import Target

_MAXIMUM = 256  # threads that settings accept
_WAIT = 0.005  # s after which waiting for a result is interrupted for more tasks


@dataclass(frozen=True, slots=True)
class CandidateTask:
    """A filter to try.

    Attributes
    ----------
    images : ImageTask
        The images of a stack, or one.
    files : tuple of str
        Their fingerprints.
    halved : bool
        Whether images are at half their size.
    values : tuple of float
        Values of the genes.
    """

    images: ImageTask
    files: tuple[str, ...]
    halved: bool
    values: Values


def try_filter(task: CandidateTask, report: Report = no_report) -> list[Target]:
    """Return the targets that an image shows through a filter.

    Parameters
    ----------
    task : CandidateTask
    report : callable, optional
        Not called; a job of an engine has it.

    Raises
    ------
    ValueError
        If an image cannot be read or is not accepted.
    """
    trials = _trials(task.images, task.files, task.halved)
    found: list[Target] = trials.found(task.values)
    return found


@lru_cache(maxsize=1)
def _trials(task: ImageTask, files: tuple[str, ...], halved: bool) -> Trials:
    """Return trials of the images, whose logarithm is kept for the next filter."""
    stack = ImageStack(tuple(read_checked(path, task)[0] for path in task.paths))
    identifier = create_identifier(detector=detector_of(task.settings), settings=task.settings)
    trials = identifier.trials_of(stack)
    return trials.reduced() if halved else trials


class Tries:
    """Lets an engine try filters, for several threads at once.

    Parameters
    ----------
    engine : Engine
        Its job is `try_filter`. It is closed with this.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._asked: queue.SimpleQueue[tuple[CandidateTask, Future[Any]] | None]
        self._asked = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def elsewhere(self, task: ImageTask, images: Mapping[str, np.ndarray]) -> Elsewhere:
        """Return what tries filters on images of a task.

        Parameters
        ----------
        task : ImageTask
        images : mapping of str to ndarray
            The images by their paths.
        """
        files = {path: file_fingerprint(located(path, task)) for path in images}

        def try_elsewhere(stack: ImageStack, halved: bool, values: Values) -> list[Target]:
            paths = tuple(
                path for path, image in images.items() if any(image is it for it in stack.images)
            )
            part = ImageTask(paths, task.settings, upright=task.upright, folder=task.folder)
            fingerprints = tuple(files[path] for path in paths)
            future: Future[Any] = Future()
            self._asked.put((CandidateTask(part, fingerprints, halved, values), future))
            result = future.result()
            if isinstance(result, TaskFailed):
                raise ValueError(f'a filter of the search: {result.reason}')
            targets: list[Target] = result
            return targets

        return try_elsewhere

    def close(self) -> None:
        """End the engine."""
        self._asked.put(None)
        self._thread.join()
        self._engine.close()

    def _serve(self) -> None:
        running: dict[int, Future[Any]] = {}
        number = 0
        while True:
            try:
                while len(running) < self._engine.capacity:
                    asked = self._asked.get(block=not running)
                    if asked is None:
                        return  # nobody waits any more
                    number += 1
                    running[number] = asked[1]
                    self._engine.submit(number, asked[0])
            except queue.Empty:
                pass
            try:
                found = self._engine.wait(_WAIT)
                if found and found[0] in running:
                    running.pop(found[0]).set_result(found[1])
            except (ValueError, RuntimeError) as error:  # of one of them, it is not known which
                for future in running.values():
                    future.set_exception(error)
                running.clear()


class SpreadSearch:
    """The engine that identifies images here, one after the other, with their searches elsewhere.

    Parameters
    ----------
    engine : Engine
        Its job is `try_filter`. It is closed with this.
    """

    capacity = 1

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._tries = Tries(engine)
        self._here = SerialEngine(self._identified)

    def submit(self, number: int, task: Any) -> None:
        """Keep the task until the result is asked for."""
        self._here.submit(number, task)

    def wait(self, timeout: float | None = None) -> tuple[int, Any]:
        """Identify the images of the task, however long it takes."""
        return self._here.wait()

    def close(self) -> None:
        """End the engine."""
        self._tries.close()

    def _identified(self, task: ImageTask, report: Report) -> ImageOutcome:
        # Each thread waits for one filter.
        settings = updated(task.settings, {'threads': min(self._engine.capacity, _MAXIMUM)})
        return identify_images(replace(task, settings=settings), report, self._tries.elsewhere)
