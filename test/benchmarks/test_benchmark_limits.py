"""The benchmark of the limits of light: every row is a scene, and files hold what is printed."""

from __future__ import annotations

import json
from itertools import product

import pytest

from benchmarks import limits


@pytest.mark.parametrize('family', ['metashape12', 'gsi', 'dots'])
def test_every_row_is_a_scene_that_can_be_made(family):
    options = ['--family', family, '--targets', '50']
    for setting in limits.SETTINGS:
        made = limits.parser().parse_args([*options, '--setting', setting])
        cells = list(product(made.rows, made.lights))
        scenes = {limits.scene(made, row, light, 1) for row, light in cells}
        assert len(scenes) == len(cells) == 32


def test_files_hold_what_is_printed(tmp_path, capsys):
    output = tmp_path / 'limits_0.12'
    some = ['--rows', 'radius 10, 0.12', '--lights', 'stripe', '--targets', '4', '--seeds', '1']
    assert limits.main([*some, '--detector', 'traditional', '--output', str(output)]) == 0
    printed = capsys.readouterr().out
    assert (tmp_path / 'limits_0.12.md').read_text() == printed
    assert 'Development seeds: 1.' in printed
    report = json.loads((tmp_path / 'limits_0.12.json').read_text())
    (row,) = report['rows']
    assert (row['expected'], row['right'] + row['wrong'] <= 4) == (4, True)
    assert limits.markdown(report) + '\n' == printed


def test_seeds_for_tests_and_for_development_are_kept_apart(capsys):
    assert limits.main(['--seeds', '1', '101']) == 2
    assert 'accepted are all below 101 or none' in capsys.readouterr().err
