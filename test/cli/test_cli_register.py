"""`ahf register` on scans of a wall that differ by how the scanner stands."""

import json
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.cli import main
from ahf_ros.files.cloud_files import read_cloud, write_pcd, write_ply
from ahf_ros.files.image_files import write_image
from ahf_ros.scenes.scene import render
from support.wall import SCENE, SHIFT, TURN, as_cloud, wall


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return three scans: b is moved, c is in millimetres."""
    made = tmp_path_factory.mktemp('scans')
    points, image = wall(), render(SCENE).image
    for name, moved, write in (
        ('a.ply', points, write_ply),
        ('b.pcd', (points - SHIFT) @ TURN, write_pcd),
        ('c.ply', 1000 * points, write_ply),
    ):
        (made / name).write_bytes(write(as_cloud(moved)))
        write_image(made / f'{name[0]}.png', image)
    return made


def run(*arguments: object) -> int:
    return main(['register', *map(str, arguments)])


def test_scans_are_registered_and_those_that_do_not_fit_are_named(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert run(folder, '-o', tmp_path, '--adjust', '--family', SCENE.family) == 1
    errors = capsys.readouterr().err
    assert f'{folder / "c.ply"}: targets are 1000 times as far apart' in errors
    assert '2 scans and 6 targets adjusted, sigma0 ' in errors
    second = json.loads((tmp_path / 'transforms.json').read_text())['scans'][1]
    assert second['translation'] == pytest.approx(SHIFT.tolist(), abs=1e-3)
    assert np.array(second['matrix'])[:3, :3] == pytest.approx(TURN, abs=1e-3)
    first, moved = (read_cloud(tmp_path / f'scan_{it}.ply') for it in (1, 2))
    assert moved['x'] == pytest.approx(first['x'], abs=1e-3)
    names = sorted(it.name for it in tmp_path.iterdir())
    assert [it for it in names if it.endswith('pcd')] == ['scan_1.pcd', 'scan_2.pcd']


@pytest.mark.parametrize(
    ('names', 'words'),
    [
        ((), 'has no PLY or PCD file'),
        (('a.ply',), 'has 1 clouds and 0 images of its name, accepted are one and one'),
        (('a.ply', 'a.pcd', 'a.png'), 'has 2 clouds and 1 images'),
    ],
)
def test_folders_that_are_not_accepted_are_named(
    names: tuple[str, ...], words: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    for name in names:
        (tmp_path / name).touch()
    assert run(tmp_path, '-o', tmp_path / 'out') == 2
    assert words in capsys.readouterr().err
    assert run(tmp_path / 'none', '-o', tmp_path / 'out') == 2
    assert run(tmp_path, '-o', tmp_path) == 2


def test_damaged_files_are_named(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    (tmp_path / 'a.ply').write_bytes(b'ply')
    (tmp_path / 'a.png').write_bytes((folder / 'a.png').read_bytes())
    assert run(tmp_path, '-o', tmp_path / 'out') == 1
    assert f'{tmp_path / "a.ply"}: the header has no line end_header' in capsys.readouterr().err
