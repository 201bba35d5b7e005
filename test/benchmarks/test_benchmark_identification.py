"""The benchmark of identification: its figures, its hook for other programs, its seeds."""

import json
import sys
from pathlib import Path

import pytest

from ahf_ros.base.target import Target, TrueTarget
from benchmarks import identification
from benchmarks.rows import normalised_squares

NORMAL = ('--quick', '--lights', 'normal', '--groups', 'light')


def test_a_detector_and_the_same_one_as_a_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = f'{sys.executable} -m ahf_ros.cli identify --json --family {{family}}'
    rows = []
    for number, method in enumerate([('--detector', 'traditional'), ('--command', command)]):
        path = tmp_path / f'{number}.json'
        options = ('--detector', 'traditional') if number else ()
        words = (method[0], ' '.join([method[1], *options]))
        assert identification.main([*NORMAL, *words, '--seeds', '1', '--json', str(path)]) == 0
        printed = capsys.readouterr().out
        assert 'Development seeds: 1.' in printed
        assert '| light | normal 0.3 | 6 of 6 | 0 | 0 |' in printed
        report = json.loads(path.read_text())
        assert report['test'] is False
        rows += report['rows']
    own, other = rows
    assert (own['right'], own['wrong'], own['false_positives']) == (6, 0, 0)
    assert own['rmse_xy'] == pytest.approx(other['rmse_xy'])
    assert own['nees'] > 0
    assert other['nees'] == pytest.approx(own['nees'])
    assert other['seconds'] > 0


def test_seeds_for_tests_and_for_development_are_kept_apart(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit, match='2'):
        identification.main([*NORMAL, '--seeds', '1', '101'])
    assert 'accepted are all below 101 or none' in capsys.readouterr().err


def test_every_row_is_a_scene_that_can_be_made() -> None:
    for quick in ([], ['--quick']):
        rows = identification.chosen_cases(identification.parser().parse_args(quick))
        assert len({(row.group, row.name) for row in rows}) == len(rows) >= 50


def test_squares_are_in_units_of_the_covariance() -> None:
    truth = [TrueTarget(1, 100.0, 100.0), TrueTarget(2, 200.0, 100.0)]
    right = Target(1, 71, 100.2, 99.9, 5, 5, covariance=(0.04, 0.0, 0.0, 0.01))
    unknown = Target(2, 75, 200.0, 100.0, 5, 5)
    assert normalised_squares(truth, [right, unknown]) == pytest.approx([2.0])
