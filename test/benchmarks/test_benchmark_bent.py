"""The benchmark of bent sheets: every row is a picture, and files hold what is printed."""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from benchmarks import bent


@pytest.mark.parametrize(
    ('family', 'targets'),
    [('metashape12', 54), ('gsi', 24), ('dots', 54), ('aruco_4x4_50', 54), ('cctag3', 54)],
)
def test_every_row_is_a_picture_that_can_be_made(family: str, targets: int) -> None:
    cells = list(product(bent.POLARITIES, bent.LIGHTS, (10.0, 6.0), range(1, 40)))
    made = {bent.settings(family, *cell, targets) for cell in cells}
    assert (len(cells), len(made)) == (2 * 9 * 2 * 39,) * 2


def test_the_lights_of_a_seed_have_the_same_sheets_and_lens() -> None:
    first, second = (
        bent.case('metashape12', 'dark', light, 6.0).make(3) for light in bent.LIGHTS[:2]
    )
    assert first[1] == second[1]
    assert not np.array_equal(first[0], second[0])


def test_files_hold_what_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / 'bent'
    some = ['--lights', 'normal 0.3', '--sizes', '6', '--polarities', 'bright', '--seeds', '1']
    assert bent.main([*some, '--output', str(output)]) == 0
    printed = capsys.readouterr().out
    assert (tmp_path / 'bent.md').read_text() == printed
    report = json.loads((tmp_path / 'bent.json').read_text())
    (row,) = report['rows']
    assert (row['expected'], row['right'] > 48, row['wrong'], row['calls'] > 1000) == (54, 1, 0, 1)
    assert row['measured'] == row['right'] >= row['far']
    assert bent.markdown(report) + '\n' == printed
