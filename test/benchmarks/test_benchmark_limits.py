"""The benchmark of the limits of light: every row is a scene, and files hold what is printed."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import limits


@pytest.mark.parametrize('family', ['metashape12', 'gsi', 'dots'])
@pytest.mark.parametrize('setting', limits.SETTINGS)
def test_every_row_is_a_scene_that_can_be_made(family: str, setting: Any) -> None:
    options = ['--family', family, '--targets', '50', '--setting', setting]
    for group, count, twice in (('light', 32, 0), ('edge shift', 64, 8), ('exposure', 6, 0)):
        made = limits.parser().parse_args([*options, '--group', group])
        cells = limits.cells(made)
        scenes = {limits.scene(made, row, light, 1) for row, light in cells}
        assert (len(cells), len(cells) - len(scenes)) == (count, twice)  # one half of an image


def test_the_halves_of_an_image_may_be_shifted_in_opposite_directions() -> None:
    made = limits.parser().parse_args(['--group', 'edge shift', '--targets', '20'])
    both, less = (
        limits.case(made, f'radius 10, {name} px', 'normal').make(1)[0]
        for name in ('-1 and +1', '-1')
    )
    middle = both.shape[1] // 2
    assert np.array_equal(both[:, :middle], less[:, :middle])
    assert (both[:, middle:] < 128).sum() > 1.2 * (less[:, middle:] < 128).sum()


def test_rows_of_other_groups_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        limits.main(['--group', 'exposure', '--rows', 'radius 6, 0.3'])
    assert "accepted are those of the group 'exposure'" in capsys.readouterr().err


def test_files_hold_what_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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
