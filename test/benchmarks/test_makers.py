"""The counts of readings by kind, maker and class of confidence."""

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.base.target import TrueTarget
from benchmarks.confidence import readings_of
from benchmarks.makers import BOUNDS, markdown, records
from benchmarks.report import about
from support.pictures.conditions import Scene
from support.scenes import SMALL, rendered


def test_readings_are_counted_by_kind_maker_and_class() -> None:
    stated = np.array([0.3, 0.6, 0.95, 0.98, 1.0])
    right = np.array([True, False, True, True, True])
    rows = records(iter([('one', 'ring', stated, right), ('two', 'gsi', stated[:2], right[:2])]))
    counts = [
        (it['kind'], it['maker'], it['confidence'], it['readings'], it['right']) for it in rows
    ]
    assert counts == [
        ('ring', 'one', '0.5 to 0.7', 1, 0),
        ('ring', 'one', '0.9 to 0.97', 1, 1),
        ('ring', 'one', '0.97 to 1.0', 2, 2),
        ('gsi', 'two', '0.5 to 0.7', 1, 0),
    ]
    assert rows[2]['expected'] == pytest.approx(1.98)
    table = markdown(about([301]) | {'rows': rows})
    assert '| ring | one | 0.97 to 1.0 | 2 | 2 | 2.0 | 0.990 | 1.000 |' in table
    assert BOUNDS[0] == 0.5


def test_targets_that_nobody_is_asked_for_do_not_count() -> None:
    shown = rendered(SMALL)
    family = SMALL.family
    asked = Scene('here', shown.image, shown.targets, family)
    first, *others = map(TrueTarget.of, shown.targets)
    some = [*others, replace(first, confirmed=False)]
    condition, values, right, hidden = readings_of(asked)
    assert right.sum() >= len(shown.targets)
    assert len(condition) == len(values) == len(right) == len(hidden)
    assert readings_of(asked._replace(truth=some))[2].sum() < right.sum()
