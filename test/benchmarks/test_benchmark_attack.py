"""The attack, with few inputs of each kind."""

from __future__ import annotations

import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from benchmarks import attack


def test_nothing_fails(capfd: pytest.CaptureFixture[str]) -> None:
    few = ('--bags', '15', '--results', '50', '--messages', '50', '--images', '40')
    assert attack.main([*few]) == 0
    lines = capfd.readouterr().out.splitlines()
    rows = [line.strip('| ').split(' | ') for line in lines[2:]]
    assert [(row[0], row[1], row[3]) for row in rows] == [
        ('bags', '15', '0'),
        ('results of detectors', '50', '0'),
        ('Image messages', '50', '0'),
        ('compressed images', '50', '0'),
        ('image files', '40', '0'),
    ]


def test_a_failure_is_counted_and_named() -> None:
    tally = attack._tallied('area', 3, lambda number: 1 // number > 0)
    assert (tally.tried, tally.accepted, tally.failed) == (3, 1, 1)
    assert 'ZeroDivisionError' in tally.reasons[0]
