"""The benchmark of images without targets."""

import json
from pathlib import Path

import pytest

from benchmarks.textures import main
from support.pictures.textures import lookalikes, textured_image


def test_textures_show_no_rings(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / 'figures.json'
    options = ['--seed', '7', '--count', '2', '--family', 'metashape12', '--only', 'textures']
    assert main([*options, '--json', str(file)]) == 0
    assert '0 reports in 2 images' in capsys.readouterr().out
    assert list(json.loads(file.read_text())['reports']) == ['texture 7', 'texture 8']


def test_textures_are_the_same_for_a_seed() -> None:
    for make in (textured_image, lookalikes):
        assert (make(3) == make(3)).all()
        assert (make(3) != make(4)).any()
