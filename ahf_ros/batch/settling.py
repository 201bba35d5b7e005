"""The families of a batch, settled before its images are identified each on their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ahf_ros.batch.engine import Engine, finished_tasks
from ahf_ros.batch.results import outcome_of
from ahf_ros.batch.task import ImageTask
from ahf_ros.codes.families import AUTO
from ahf_ros.filtering.settling import FIRST
from ahf_ros.settings.nested import updated
from ahf_ros.target import UNDECODED

_LOOK = {'ahf': False, 'expected_targets': 0, 'estimate_expected': False}


def settled_tasks(engine: Engine, tasks: Sequence[ImageTask]) -> Sequence[ImageTask]:
    """Return tasks with the families that the first of them show, where all are looked for.

    The result does not depend on the engine. A single task settles its families itself, and so do
    all tasks if the first ones show no target.
    """
    if len(tasks) < 2:
        return tasks
    settings = tasks[0].settings
    if not AUTO == settings.detection.family == settings.detector:
        return tasks
    first = [
        replace(task, overlays=(), settings=updated(task.settings, _LOOK))
        for task in tasks[:FIRST]
    ]
    shown: set[str] = set()
    for item in finished_tasks(engine, first):
        for record in outcome_of(item.task, item.result).records:
            shown |= {it['family'] for it in record['targets'] if it['id'] != UNDECODED}
    families = tuple(name for name in settings.detection.families if name in shown)
    return [replace(task, families=families) for task in tasks]
