"""A batch of images: from tasks to outcomes in their order, with results that are kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from ahf_ros.batch.engine import Engine, Finished, TaskFailed, finished_tasks, in_order
from ahf_ros.batch.results import Results
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
    for item in in_order(finished_tasks(engine, tasks)):
        yield outcome_of(item.task, item.result)


def kept_outcomes_in_order(
    engine: Engine, tasks: Sequence[ImageTask], results: Results, say: Callable[[str], None]
) -> Iterator[ImageOutcome]:
    """Yield the outcomes of tasks in their order, of which those with a result are not done again.

    Parameters
    ----------
    engine : Engine
    tasks : sequence of ImageTask
    results : Results
        Gets each result as soon as it is known, and their order at the end. What it has already
        has no messages.
    say : callable
        Called with lines for people: what is done, and what is done again.

    Raises
    ------
    Unwritable
        If the results cannot be written.
    """

    def recorded() -> Iterator[Finished[ImageTask, ImageOutcome]]:
        for item in finished_tasks(engine, pending):
            outcome = outcome_of(item.task, item.result)
            results.append(item.task, outcome)
            yield Finished(number=item.number, task=item.task, result=outcome)

    pending, notes = results.pending(tasks)
    for note in notes:
        say(f'{results.path}: {note}')
    following = in_order(recorded())
    undone = {task.paths for task in pending}
    for task in tasks:
        if task.paths in undone:
            undone.remove(task.paths)
            yield next(following).result
        else:
            yield ImageOutcome(results.records(task))
    results.put_in_order(tasks)


def outcome_of(task: ImageTask, result: ImageOutcome | TaskFailed) -> ImageOutcome:
    """Return the outcome of a task; it is a problem if the task was given up."""
    if isinstance(result, TaskFailed):
        return ImageOutcome(messages=(Message(f'{task.name}: {result.reason}', Level.PROBLEM),))
    return result
