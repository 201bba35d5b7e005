"""The attack, with few inputs of each kind."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from benchmarks import attack

ROOT = Path(__file__).resolve().parents[2]


def test_nothing_fails(capfd: pytest.CaptureFixture[str]) -> None:
    few = ('--bags', '15', '--results', '50', '--messages', '50', '--images', '40')
    assert attack.main([*few, '--no-tests']) == 0
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


def test_all_areas_are_tried_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[tuple[str, int]] = []

    def note(area: str, count: int, *_: object) -> attack.Tally:
        tried.append((area, count))
        return attack.Tally(area, count, count, 0)

    monkeypatch.setattr(attack, '_tallied', note)
    monkeypatch.setattr(attack, '_fuzzed', note)
    monkeypatch.setattr(attack, 'run_tests', lambda name: note(name, 1))
    assert attack.main([]) == 0
    areas = 'bags', 'results of detectors', 'Image messages', 'compressed images', 'image files'
    assert tried == [(area, 10_000) for area in areas] + [(name, 1) for name in attack.TESTS]
    assert all((ROOT / name).is_file() for name in attack.TESTS)
