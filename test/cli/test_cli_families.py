"""Families whose data files are found by their names."""

import json
from pathlib import Path

import pytest

from ahf_ros import SceneSettings, identify, render
from ahf_ros.base.target import reach_of
from ahf_ros.prints.dots import DOTS_DESIGN
from ahf_ros.prints.families import files_by_name
from ahf_ros.views.report.page import _reach
from ahf_ros.views.report.results import result_from_json
from support.command_line import status

MINE = 'family: mine\nbits: 10\nband: [1.6, 2.4]\nwords: all\nnumbers: {first_bit: lowest}\n'


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the user's folder of families, with one."""
    monkeypatch.setenv('XDG_CONFIG_HOME', str(tmp_path / 'config'))
    folder = tmp_path / 'config' / 'ahf_ros' / 'families'
    folder.mkdir(parents=True)
    (folder / 'mine.yaml').write_text(MINE)
    return folder


def test_a_family_of_the_user_is_rendered_identified_and_printed(
    home: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    size = '--width', 640, '--height', 480, '--targets', 4, '--dot-radius', 12
    assert status('render', tmp_path / 'images', '--family', 'mine', *size) == 0
    capsys.readouterr()
    assert status('identify', tmp_path / 'images', '--family', 'mine', '--json') == 0
    record = json.loads(capsys.readouterr().out)
    assert [it['family'] for it in record['targets']] == ['mine'] * 4
    assert (record['reach'], record['codes']['mine']['bits']) == ({'mine': 2.4}, 10)
    result = result_from_json(record, tmp_path, 'record')
    assert [_reach(name, [result]) for name in ('mine', 'aicon14', 'other')] == [2.4, 3.0, 1.0]
    assert status('targets', '--family', 'mine', '-o', tmp_path / 'sheet.svg') == 0


def test_a_design_in_the_place_of_the_usual_one_keeps_its_name_in_results(tmp_path: Path) -> None:
    file = tmp_path / 'wide.json'
    design = json.loads(DOTS_DESIGN.read_text()) | {'family': 'wide', 'border_radius': 3.6}
    file.write_text(json.dumps(design))
    for name in ('wide', 'dots'):
        scene = SceneSettings(
            width=500, height=400, targets=2, dot_radius=9, family=name, family_file=str(file)
        )
        found = identify(render(scene).image, family=name, family_file=str(file))
        assert (found.looked_for, [it.family for it in found]) == ('wide', ['wide'] * 2)
        assert (list(found.prints), reach_of(found[0], found.prints)) == (['wide'], 3.6)


def test_a_family_beside_the_photographs_comes_first(
    home: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    images = tmp_path / 'images'
    size = '--width', 640, '--height', 480, '--targets', 4, '--dot-radius', 12
    assert status('render', images, '--family', 'mine', *size) == 0
    (images / 'families').mkdir()
    (images / 'families' / 'mine.json').write_text('{')
    assert status('identify', images, '--family', 'mine') == 2
    assert 'mine.json' in capsys.readouterr().err


def test_files_that_are_given_or_not_needed_are_not_looked_for(home: Path) -> None:
    given = str(home / 'mine.yaml')
    assert files_by_name('mine', given, [home]) == given
    assert files_by_name('mine, auto, Metashape12, tag36h11', '', [home]) == given
    assert files_by_name('auto', '', [home]) == ''
    for name in ('other', '../families/mine', ''):
        assert files_by_name(name, '', [home]) == ''
