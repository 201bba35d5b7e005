import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.cli.identify import image_paths
from ahf_ros.files.image_files import read_image, write_image
from ahf_ros.files.target_json import read_results
from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.vision.image import as_oriented
from support.command_line import status

ROTATED = 6
"""Orientation in Exif of an image whose camera was turned by 90 degrees."""


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('inputs')
    for name in ('b.png', 'a.JPG', 'notes.txt', 'day/c.tif', 'day/[d].png'):
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b'')
    return folder


def names(*arguments: object) -> tuple[list[str], list[str]]:
    paths, problems, _ = image_paths([str(argument) for argument in arguments])
    return [Path(path).name for path in paths], problems


def test_folders_patterns_and_lists_name_images(folder: Path) -> None:
    assert names(folder) == (['a.JPG', 'b.png'], [])
    assert names(f'{folder}/*/*.tif', f'{folder}/b.png') == (['c.tif', 'b.png'], [])
    assert names(f'{folder}/**/*.png') == (['b.png', '[d].png'], [])
    assert names(folder / 'day' / '[d].png') == (['[d].png'], [])
    list_of_images = folder / 'list'
    list_of_images.write_text(f'{folder}/b.png\n\n  {folder}/day\n')
    assert names(f'@{list_of_images}') == (['b.png', '[d].png', 'c.tif'], [])


def test_what_names_no_image_is_told_and_the_rest_goes_on(folder: Path) -> None:
    empty = folder / 'empty'
    empty.mkdir()
    found, problems = names(empty, f'{folder}/*.bmp', f'@{folder}/none', folder / 'b.png')
    assert found == ['b.png']
    for problem, named in zip(problems, ('empty', '*.bmp', 'none'), strict=True):
        assert named in problem
    assert status('identify', empty) == 1


def oriented_jpeg(image: np.ndarray, orientation: int) -> bytes:
    """Return a JPEG file whose Exif header has an orientation."""
    entry = bytes([1, 0x12, 0, 3, 0, 0, 0, 1, 0, orientation, 0, 0])
    exif = b'Exif\0\0MM\0*\0\0\0\x08\0\x01' + entry + bytes(4)
    content = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, 100])[1].tobytes()
    header = b'\xff\xe1' + (len(exif) + 2).to_bytes(2, 'big') + exif
    return content[:2] + header + content[2:]


@pytest.mark.parametrize('orientation', range(1, 9))
def test_images_are_turned_as_opencv_turns_them(tmp_path: Path, orientation: int) -> None:
    path = tmp_path / 'turned.jpg'
    stored = np.random.default_rng(0).integers(0, 255, (40, 64), np.uint8)
    path.write_bytes(oriented_jpeg(stored, orientation))
    upright = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert np.array_equal(read_image(path, upright=True), upright)
    assert np.array_equal(as_oriented(read_image(path), orientation), upright)


def test_coordinates_are_those_of_stored_pixels_unless_upright_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    scene = render(SceneSettings(width=600, height=400, targets=4, dot_radius=10, seed=1))
    path = tmp_path / 'photo.jpg'
    path.write_bytes(oriented_jpeg(scene.image, ROTATED))

    def result(*options: str) -> tuple[dict[int, tuple[float, float]], str]:
        assert status('identify', '--json', '--family', 'metashape12', *options, path) == 0
        output = capsys.readouterr()
        (tmp_path / 'results.jsonl').write_text(output.out)
        (found,) = read_results(tmp_path / 'results.jsonl').values()
        return {target.id: (target.x, target.y) for target in found}, output.err

    stored, told = result()
    assert 'orientation 6 is not applied' in told
    assert 'N is not given' not in told  # `ring` needs no filter
    turned, told = result('--upright')
    assert 'orientation 6 is applied' in told
    for target in scene.targets:
        assert stored[target.id] == pytest.approx((target.x, target.y), abs=0.05)
        x, y = turned[target.id]
        assert (y, 399 - x) == pytest.approx((target.x, target.y), abs=0.05)
    assert result('--quiet') == (stored, '')


def test_options_are_known_without_what_computes() -> None:
    code = (
        'import sys; from ahf_ros.cli import commands; commands._parser([]); '
        'listed = "ahf_ros.families" in sys.modules; '
        'commands._parser(["identify"]).format_help(); '
        'print(listed, [name for name in ("numpy", "cv2", "rich") if name in sys.modules])'
    )
    output = subprocess.run([sys.executable, '-c', code], capture_output=True, check=True)
    assert output.stdout.split() == [b'False', b'[]']


@pytest.mark.parametrize(
    ('line', 'completed'), [('ahf ident', 'identify'), ('ahf identify --over', '--overlay')]
)
def test_commands_and_options_are_completed(tmp_path: Path, line: str, completed: str) -> None:
    pytest.importorskip('argcomplete')
    answer = tmp_path / 'answer'
    asked = {
        '_ARGCOMPLETE': '1',
        '_ARGCOMPLETE_STDOUT_FILENAME': str(answer),
        'COMP_LINE': line,
        'COMP_POINT': str(len(line)),
    }
    command = [sys.executable, '-m', 'ahf_ros.cli']
    subprocess.run(command, env=os.environ | asked, check=True, timeout=120)
    assert answer.read_text().split() == [completed]


def test_a_damaged_image_is_named_and_the_rest_goes_on(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scene = render(SceneSettings(width=400, height=300, targets=4, dot_radius=10.0)).image
    whole = cv2.imencode('.jpg', scene)[1].tobytes()
    (tmp_path / 'a.jpg').write_bytes(whole[: len(whole) // 2] + whole[-2:])
    (tmp_path / 'b.jpg').write_bytes(whole[: len(whole) // 2])
    (tmp_path / 'c.jpg').write_bytes(whole)
    assert status('identify', tmp_path, '--detector', 'traditional', '--json') == 1
    said = capfd.readouterr()
    assert 'a.jpg: the image is damaged: Corrupt JPEG data' in said.err
    assert 'b.jpg' in said.err
    assert 'it has no end marker, so it is cut' in said.err
    assert 'c.jpg: the image is damaged' not in said.err
    assert 'c.jpg' in said.out


def test_what_is_no_file_is_named_at_once_and_the_rest_goes_on(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scene = render(SceneSettings(width=400, height=300, targets=4, dot_radius=10.0)).image
    write_image(tmp_path / 'c.png', scene)
    os.mkfifo(tmp_path / 'a.png')
    with (tmp_path / 'b.png').open('wb') as large:
        large.truncate(2**31)
    assert status('identify', tmp_path, '--detector', 'traditional', '--json') == 1
    said = capfd.readouterr()
    assert 'a.png cannot be read: it is a named pipe' in said.err
    assert 'b.png has 2147483648 bytes, accepted are at most 2147483647' in said.err
    assert 'c.png' in said.out
    for family in (tmp_path / 'a.png', tmp_path / 'b.png', '/dev/zero'):
        assert status('identify', tmp_path / 'c.png', '--family-file', family) == 2


def test_names_cannot_command_a_terminal_or_a_spreadsheet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = render(SceneSettings(width=320, height=240, targets=3, dot_radius=8)).image
    write_image('=1+1.png', scene)
    write_image('a\x1b[31m\n.png', scene)
    Path('no\x1b.png').write_text('no image')
    options = '--family', 'metashape12', '--output', 'results'
    assert status('identify', tmp_path, *options) == 1
    said = capfd.readouterr().err
    assert 'a\\x1b[31m\\n.png' in said
    assert 'no\\x1b.png is not an image' in said
    assert status('report', 'results', '--output', 'page.html') == 0
    page = Path('page.html').read_text()
    assert 'x1b[31m' in page
    assert '\x1b' not in said + page
    assert '\\u001b' not in page
    assert status('identify', '=1+1.png', *options[:2], '--export', 'csv=csv') == 0
    assert "\n'=1+1.png," in Path('csv/targets.csv').read_text()
