"""`ahf register` on scans of a wall that differ by how the scanner stands."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.cli import main
from ahf_ros.interchange.cloud_files import read_cloud, write_pcd, write_ply
from ahf_ros.interchange.image_files import write_image
from ahf_ros.orientation.camera import rotation_matrices
from ahf_ros.synthetic.camera import tilted_camera
from ahf_ros.synthetic.scene import SceneSettings, render

SCENE = SceneSettings(width=640, height=480, targets=6, dot_radius=10.0, tilt=30.0, seed=3)
TURN = rotation_matrices(np.array([[0.1, -0.2, 0.3]]))[0]
SHIFT = np.array([0.1, 0.2, -0.3])  # m
DISTANCE = 0.8  # m


def wall() -> np.ndarray:
    """Return the points (480, 640, 3) of the wall that the scene shows, m, with noise."""
    setup = np.random.default_rng(np.random.SeedSequence(SCENE.seed).spawn(5)[0])
    focal_length = SCENE.focal_length * SCENE.width
    tilt = math.radians(SCENE.tilt)
    camera = tilted_camera(640, 480, focal_length, tilt, SCENE.distortion, setup)
    rows, columns = np.mgrid[:480, :640]
    pixels = np.column_stack((columns.ravel(), rows.ravel())).astype(float)
    points = np.column_stack((camera.wall(pixels), np.ones(len(pixels)))) @ camera.pose.T
    points *= DISTANCE / focal_length
    points *= 1 + 1e-4 * np.random.default_rng(0).standard_normal((len(points), 1))
    return points.reshape(480, 640, 3)


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
        cloud = np.zeros((480, 640), [(axis, '<f4') for axis in 'xyz'])
        for axis, letter in enumerate('xyz'):
            cloud[letter] = moved[..., axis]
        (made / name).write_bytes(write(cloud))
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
