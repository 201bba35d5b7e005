"""The families of a batch, settled before its images are identified each on their own."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ahf_ros.base.settings.nested import updated
from ahf_ros.base.target import UNDECODED
from ahf_ros.batch.engine import Engine, finished_tasks, in_order
from ahf_ros.batch.results import outcome_of
from ahf_ros.batch.task import ImageOutcome, ImageTask
from ahf_ros.families.evidence import Reading
from ahf_ros.identification.session_settings import IdentificationSettings
from ahf_ros.identification.settling import FIRST, evident_together

_LOOK = {'ahf': False, 'expected_targets': 0, 'estimate_expected': False}
_MOST = 12  # images that are looked at before any is identified


def settled_tasks(engine: Engine, tasks: Sequence[ImageTask]) -> Sequence[ImageTask]:
    """Return tasks with the families that the first of them show, where all are looked for.

    They are looked at a few at a time, until they show a family, each alone or all together. The
    result does not depend on the engine. A single task settles its families itself, and so do all
    tasks if the first ones show no target. Where looking has identified what the families of
    all show, the task carries its outcome.
    """
    if len(tasks) < 2:
        return tasks
    settings = tasks[0].settings
    if not settings.settles:
        return tasks
    looks: list[ImageTask] = []
    outcomes: list[ImageOutcome] = []
    together: frozenset[str] = frozenset()
    while not together and len(looks) < min(_MOST, len(tasks)):
        following = tasks[len(looks) : len(looks) + FIRST]
        some = [replace(task, overlays=(), settings=_looking(task)) for task in following]
        outcomes += [
            outcome_of(it.task, it.result) for it in in_order(finished_tasks(engine, some))
        ]
        looks += some
        joint = evident_together([list(_readings(it)) for it in outcomes])
        together = frozenset(joint).union(*(it for of in outcomes for it in _shown(of)))
    families = tuple(name for name in settings.detection.families if name in together)
    settled = [replace(task, families=families) for task in tasks]
    for number, (look, outcome) in enumerate(zip(looks, outcomes, strict=True)):
        if look == tasks[number] and {together} == set(_shown(outcome)):
            settled[number] = replace(settled[number], outcome=outcome)
    return settled


def _looking(task: ImageTask) -> IdentificationSettings:
    """Return the settings with which a task is looked at: without a search for a filter."""
    if task.settings.number or task.settings.estimate_expected:
        return updated(task.settings, _LOOK)
    return task.settings  # which leads to no search


def _shown(outcome: ImageOutcome) -> list[frozenset[str]]:
    """Return the families of what is reported, of each record."""
    return [
        frozenset(it['family'] for it in record['targets'] if it['id'] != UNDECODED)
        for record in outcome.records
    ]


def _readings(outcome: ImageOutcome) -> Iterator[Reading]:
    """Yield what was read in images, also where they alone are no evidence for its family."""
    for record in outcome.records:
        for it in record['targets']:
            yield it['family'], it['id'], it['confidence']
        for it in record['unsettled']:
            yield it['likely_family'], it['likely_id'], it['confidence']
