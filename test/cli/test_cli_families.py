"""Families whose data files are found by their names."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ahf_ros.codes.families import files_by_name
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
    targets = json.loads(capsys.readouterr().out)['targets']
    assert [it['family'] for it in targets] == ['mine'] * 4
    assert status('targets', '--family', 'mine', '-o', tmp_path / 'sheet.svg') == 0


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
