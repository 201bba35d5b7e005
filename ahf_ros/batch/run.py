"""A batch of images: from tasks to outcomes in their order, with results that are kept."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ahf_ros.batch.engine import Engine, Finished, TaskFailed, finished_tasks, in_order
from ahf_ros.batch.plan import Plan
from ahf_ros.batch.results_file import ResultsFile
from ahf_ros.batch.task import ImageOutcome, ImageTask, Level, Message


def outcomes_in_order(engine: Engine, tasks: Iterable[ImageTask]) -> Iterator[ImageOutcome]:
    """Yield the outcomes of tasks in their order, each as soon as those before it are known.

    Parameters
    ----------
    engine : Engine
        Its job is `ahf_ros.batch.identification.identify_images`.
    tasks : iterable of ImageTask

    Examples
    --------
    >>> from ahf_ros.batch.engine import SerialEngine
    >>> from ahf_ros.batch.identification import identify_images
    >>> tasks = [ImageTask((name,)) for name in ('a.png', 'b.png')]
    >>> outcomes = outcomes_in_order(SerialEngine(identify_images), tasks)
    >>> [it.messages[0].text[:20] for it in outcomes]
    ['a.png cannot be read', 'b.png cannot be read']
    """
    return (item.result for item in in_order(outcomes(engine, tasks)))


def kept_outcomes_in_order(
    engine: Engine, plan: Plan, results: ResultsFile
) -> Iterator[ImageOutcome]:
    """Yield the outcomes of a plan in the order of its tasks, and put the results into it.

    Parameters
    ----------
    engine : Engine
    plan : Plan
        Made by `results`.
    results : ResultsFile
        Gets each result as soon as it is known. What it has already has no messages.

    Raises
    ------
    Unwritable
        If the results cannot be written.
    """
    pending = {task.paths for task in plan.pending}
    following = in_order(recorded(outcomes(engine, plan.pending), results))
    for task in plan.tasks:
        if task.paths in pending:
            pending.remove(task.paths)
            yield next(following).result
        else:
            yield ImageOutcome(results.records(task))
    results.put_in_order(plan.tasks)


def recorded(
    finished: Iterable[Finished[ImageTask, ImageOutcome]], results: ResultsFile
) -> Iterator[Finished[ImageTask, ImageOutcome]]:
    """Yield finished tasks once their results are written."""
    for item in finished:
        results.append(item.task, item.result)
        yield item


def outcomes(
    engine: Engine, tasks: Iterable[ImageTask]
) -> Iterator[Finished[ImageTask, ImageOutcome]]:
    """Yield tasks with their outcomes as they are ready; one that is given up has a problem."""
    for item in finished_tasks(engine, tasks):
        yield Finished(item.number, item.task, outcome_of(item.task, item.result))


def outcome_of(task: ImageTask, result: ImageOutcome | TaskFailed) -> ImageOutcome:
    """Return the outcome of a task; it is a problem if the task was given up."""
    if isinstance(result, TaskFailed):
        return ImageOutcome(messages=(Message(f'{task.name}: {result.reason}', Level.PROBLEM),))
    return result
