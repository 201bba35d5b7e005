"""Figures of before and after side by side."""

import json
from copy import deepcopy
from typing import Any

import pytest

from benchmarks import comparison, identification
from support import ROOT

RECORDED = json.loads((ROOT / 'docs' / 'figures' / 'ring.json').read_text())


def changed(place: int, **changes: Any) -> dict[str, Any]:
    report = deepcopy(RECORDED)
    report['rows'][place].update(changes)
    return report


def test_nothing_is_worse_than_itself() -> None:
    assert comparison.worse(RECORDED, RECORDED) == []
    lines = comparison.markdown(RECORDED, RECORDED).splitlines()
    rows = [line for line in lines if line.startswith('| light')]
    first = RECORDED['rows'][0]
    figures = [str(first[name]) for name in ('right', 'wrong', 'false_positives')]
    twice = [f'{figure}, {figure}' for figure in [*figures, f'{first["rmse_xy"]:.4f}']]
    assert rows[0].startswith('| light | normal 0.3 | 54 | ' + ' | '.join(twice) + ' |')
    assert rows[0].endswith('| 1.00 | 1.00 |')
    assert lines[-1] == 'Nothing is worse.'


def test_one_target_may_be_lost_and_no_id_may_be_wrong() -> None:
    assert comparison.worse(RECORDED, changed(0, right=53)) == []
    found = comparison.worse(RECORDED, changed(0, right=52, wrong=1, false_positives=2))
    assert found == [
        'light, normal 0.3: 52 right, 54 before',
        'light, normal 0.3: 1 wrong, 0 before',
        'light, normal 0.3: 2 false positives, 0 before',
    ]


def test_other_images_are_no_comparison() -> None:
    assert comparison.worse(RECORDED, changed(0, expected=50)) == [
        'light, normal 0.3: 50 targets shown, 54 before'
    ]
    with pytest.raises(ValueError, match=r'seeds is \[1\], accepted is \[101\] as before'):
        comparison.worse(RECORDED, {**RECORDED, 'seeds': [1]})
    with pytest.raises(ValueError, match='no row in common'):
        comparison.worse(RECORDED, {**RECORDED, 'rows': []})


def test_the_median_of_the_times_counts() -> None:
    assert comparison.worse(RECORDED, changed(0, seconds=100.0)) == []
    slow = deepcopy(RECORDED)
    for row in slow['rows']:
        row['seconds'] *= 1.1
    found = comparison.worse(RECORDED, slow)
    assert found == ['time: 1.10 times that of before, in the median of all rows']
    assert comparison.markdown(RECORDED, slow).endswith(f'Worse:\n{found[0]}')


def test_rows_that_were_not_measured_again_are_counted() -> None:
    part = {**RECORDED, 'rows': RECORDED['rows'][:3]}
    assert len(comparison.pairs(RECORDED, part)) == 3
    told = f'{len(RECORDED["rows"]) - 3} rows of before were not measured again.'
    assert told in comparison.markdown(RECORDED, part)


def test_a_benchmark_of_other_images_is_refused_before_it_measures(
    capsys: pytest.CaptureFixture[str],
) -> None:
    recorded = str(ROOT / 'docs' / 'figures' / 'ring.json')
    with pytest.raises(SystemExit):
        identification.main(['--quick', '--compare', recorded])
    assert 'width is 1200, accepted is 3984 as before' in capsys.readouterr().err
