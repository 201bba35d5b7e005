"""The families of a batch, settled before its images are identified each on their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

from ahf_ros.batch.engine import Engine, finished_tasks, in_order
from ahf_ros.batch.results import outcome_of
from ahf_ros.batch.task import ImageOutcome, ImageTask
from ahf_ros.codes.families import AUTO
from ahf_ros.filtering.settling import FIRST
from ahf_ros.session_settings import IdentificationSettings
from ahf_ros.settings.nested import updated
from ahf_ros.target import UNDECODED

_LOOK = {'ahf': False, 'expected_targets': 0, 'estimate_expected': False}


def settled_tasks(engine: Engine, tasks: Sequence[ImageTask]) -> Sequence[ImageTask]:
    """Return tasks with the families that the first of them show, where all are looked for.

    The result does not depend on the engine. A single task settles its families itself, and so do
    all tasks if the first ones show no target. Where looking has identified what the families of
    all show, the task carries its outcome.
    """
    if len(tasks) < 2:
        return tasks
    settings = tasks[0].settings
    if not AUTO == settings.detection.family == settings.detector:
        return tasks
    first = [replace(task, overlays=(), settings=_looking(task)) for task in tasks[:FIRST]]
    outcomes = [outcome_of(it.task, it.result) for it in in_order(finished_tasks(engine, first))]
    shown = [_shown(outcome) for outcome in outcomes]
    together = frozenset().union(*chain(*shown))
    families = tuple(name for name in settings.detection.families if name in together)
    settled = [replace(task, families=families) for task in tasks]
    for number, (look, outcome) in enumerate(zip(first, outcomes, strict=True)):
        if look == tasks[number] and {together} == set(shown[number]):
            settled[number] = replace(settled[number], outcome=outcome)
    return settled


def _looking(task: ImageTask) -> IdentificationSettings:
    """Return the settings with which a task is looked at: without a search for a filter."""
    if task.settings.number or task.settings.estimate_expected:
        return updated(task.settings, _LOOK)
    return task.settings  # which leads to no search


def _shown(outcome: ImageOutcome) -> list[frozenset[str]]:
    return [
        frozenset(it['family'] for it in record['targets'] if it['id'] != UNDECODED)
        for record in outcome.records
    ]
