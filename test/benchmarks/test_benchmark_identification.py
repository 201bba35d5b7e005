"""The benchmark of identification: its figures, its hook for other programs, its seeds."""

from __future__ import annotations

import json
import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from ahf_ros.target import Target, TrueTarget

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / 'benchmarks' / 'identification.py'
NORMAL = ('--quick', '--lights', 'normal', '--groups', 'light')


def benchmark(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(SCRIPT), *map(str, arguments)],
        capture_output=True,
        text=True,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        timeout=300,
    )


@pytest.fixture(scope='module')
def script(monkeypatch_module) -> dict:
    monkeypatch_module.syspath_prepend(str(SCRIPT.parent))
    return runpy.run_path(str(SCRIPT))


@pytest.fixture(scope='module')
def monkeypatch_module():
    with pytest.MonkeyPatch.context() as patch:
        yield patch


def test_a_detector_and_the_same_one_as_a_command(tmp_path):
    command = f'{sys.executable} -m ahf_ros.cli identify --json --family {{family}}'
    rows = []
    for number, method in enumerate([('--detector', 'traditional'), ('--command', command)]):
        path = tmp_path / f'{number}.json'
        options = ('--detector', 'traditional') if number else ()
        words = (method[0], ' '.join([method[1], *options]))
        done = benchmark(*NORMAL, *words, '--seeds', 1, '--json', path)
        assert done.returncode == 0, done.stderr
        assert 'Development seeds: 1.' in done.stdout
        assert '| light | normal 0.3 | 6 of 6 | 0 | 0 |' in done.stdout
        report = json.loads(path.read_text())
        assert report['test'] is False
        rows += report['rows']
    own, other = rows
    assert (own['right'], own['wrong'], own['false_positives']) == (6, 0, 0)
    assert own['rmse_xy'] == pytest.approx(other['rmse_xy'])
    assert own['nees'] > 0
    assert other['nees'] == pytest.approx(own['nees'])
    assert other['seconds'] > 0


def test_seeds_for_tests_and_for_development_are_kept_apart():
    done = benchmark(*NORMAL, '--seeds', 1, 101)
    assert done.returncode == 2
    assert 'accepted are all below 101 or none' in done.stderr


def test_every_row_is_a_scene_that_can_be_made(script):
    for quick in ([], ['--quick']):
        rows = script['chosen_scenes'](script['parser']().parse_args(quick))
        assert len({row[:2] for row in rows}) == len(rows) >= 50


def test_squares_are_in_units_of_the_covariance(script):
    truth = [TrueTarget(1, 100.0, 100.0), TrueTarget(2, 200.0, 100.0)]
    right = Target(1, 71, 100.2, 99.9, 5, 5, covariance=(0.04, 0.0, 0.0, 0.01))
    unknown = Target(2, 75, 200.0, 100.0, 5, 5)
    assert script['normalised_squares'](truth, [right, unknown]) == pytest.approx([2.0])
