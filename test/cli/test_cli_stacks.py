"""Stacks of images on the command line."""

import json
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.cli.identify import stacked
from ahf_ros.files.image_files import read_image, write_image
from support.command_line import status

FAMILY = '--family=metashape12'
NAMES = [f'stripe_0.02_{seed}_{phase}.png' for seed in (1, 2) for phase in range(4)]


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with four phases of two scenes, and their truth."""
    folder = tmp_path_factory.mktemp('phases')
    scene = '--width 480 --height 360 --targets 4 --dot-radius 12 --light stripe --ambient 0.02'
    assert status('render', folder, *scene.split(), '--seed=1', '--count=2', '--phases=4') == 0
    return folder


def test_phases_are_one_scene_in_light_that_moves(folder: Path) -> None:
    assert sorted(path.name for path in folder.glob('*.png')) == sorted(NAMES)
    first, second = (read_image(folder / name).astype(float) for name in NAMES[:2])
    assert np.abs(first - second).mean() > 20
    lines = (folder / 'truth.csv').read_text().splitlines()
    places = {name: [line for line in lines if line.startswith(name)] for name in NAMES[:2]}
    values = [[line.split(',', 1)[1] for line in of] for of in places.values()]
    assert len(values[0]) == 4
    assert values[0] == values[1]


def test_every_stack_is_one_result_that_names_its_images(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [str(folder / name) for name in NAMES]
    assert status('identify', *paths, FAMILY, '--stack', 4, '--expected-targets', 4, '--json') == 0
    (tmp_path / 'results.jsonl').write_text(capsys.readouterr().out)
    results = [json.loads(line) for line in (tmp_path / 'results.jsonl').open()]
    assert [result['images'] for result in results] == [paths[:4], paths[4:]]
    assert [result['image'] for result in results] == [paths[0], paths[4]]
    assert [len(result['targets']) for result in results] == [4, 4]
    assert {result['combination'] for result in results} == {'even_light'}
    assert [result['split'] for result in results] == ['', '']
    status('evaluate', folder / 'truth.csv', tmp_path / 'results.jsonl', '--json')
    total = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (total['right'], total['wrong'], total['expected']) == (32, 0, 32)


def test_names_and_folders_say_what_belongs_together(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [str(folder / name) for name in reversed(NAMES)]
    status('identify', *paths, FAMILY, '--stack-by', r'(.*)_\d', '--json')
    results = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [result['images'] for result in results] == [paths[:4], paths[4:]]
    assert [len(result['targets']) for result in results] == [4, 4]


def test_a_stack_of_several_sizes_is_split_and_what_is_unreadable_is_left_out(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths, seen = [str(folder / name) for name in NAMES[:3]], tmp_path / 'seen'
    write_image(tmp_path / 'other.png', read_image(paths[0])[:-8])
    (tmp_path / 'broken.png').write_bytes(b'nothing')
    paths += [str(tmp_path / 'other.png'), str(tmp_path / 'broken.png')]
    assert status('identify', *paths, FAMILY, '--stack=5', '--json', '--overlay', seen) == 1
    output, errors = capsys.readouterr()
    first, second = (json.loads(line) for line in output.splitlines())
    assert (first['images'], second['images']) == (paths[:3], paths[3:4])
    reason = 'image 4 of the stack is 480 x 352 px, accepted is the size of the first'
    assert second['split'].startswith(reason)
    for said in (reason, 'broken.png', '4 of 5 images of a stack'):
        assert said in errors
    assert sorted(path.name for path in seen.iterdir()) == [
        'other_overlay.png',
        'stripe_0.02_1_0_overlay.png',
    ]


def test_groups_are_in_the_order_of_their_first_images() -> None:
    images = ['b/x1.png', 'a/x1.png', 'b/x2.png', 'b/x3.png']
    assert stacked(images, 'folder', 1) == [['b/x1.png', 'b/x2.png', 'b/x3.png'], ['a/x1.png']]
    assert stacked(images, 'folder', 2)[0] == ['b/x1.png', 'b/x2.png']
    assert stacked(images, '', 3) == [images[:3], images[3:]]
    assert stacked(images, '', 1) == [[image] for image in images]
    assert stacked(images, r'(x)\d', 1) == [[images[0], *images[2:]], ['a/x1.png']]


@pytest.mark.parametrize(
    ('by', 'message'),
    [
        ('(', "stack_by is '(', accepted is folder or a regular expression"),
        ('abc', 'a regular expression with a group'),
        ('(y).', "which does not match 'stripe"),
    ],
)
def test_bad_groups_are_named(
    folder: Path, capsys: pytest.CaptureFixture[str], by: str, message: str
) -> None:
    assert status('identify', folder / NAMES[0], '--stack-by', by) == 2
    assert message in capsys.readouterr().err


def test_a_missing_file_is_no_part_of_a_stack(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = [tmp_path / 'missing.png', tmp_path / 'gone.png']
    assert status('identify', *missing, '--stack=2') == 1
    said = capsys.readouterr().err.splitlines()
    assert [line.rpartition('/')[2] for line in said] == [
        f'{path.name} cannot be read: No such file or directory' for path in missing
    ]
    image = str(folder / NAMES[0])
    assert status('identify', *missing, image, FAMILY, '--stack=2', '--json') == 1
    output, errors = capsys.readouterr()
    assert [json.loads(line)['images'] for line in output.splitlines()] == [[image]]
    assert errors.count('No such file') == 2
    assert 'of 2 images of a stack' in errors  # which began with a file that is there
