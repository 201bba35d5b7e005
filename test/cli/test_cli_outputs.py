"""No output takes the place of an input: each pair of options of all commands that name such."""

import argparse
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from ahf_ros.bag.definitions import IMAGE, typestore
from ahf_ros.bag.registration import POINT_CLOUD
from ahf_ros.cli import commands
from ahf_ros.cli.options import input_files, input_name, input_path, output_path
from ahf_ros.files.cloud_files import write_ply
from ahf_ros.files.files import csv_table
from ahf_ros.files.image_files import write_image
from ahf_ros.files.truth_files import write_truth
from ahf_ros.network.files.network_results import write_network
from ahf_ros.prints.gsi import point_family, positions_of
from ahf_ros.scenes.scene import render
from support import ROOT, bags
from support.command_line import ahf, status
from support.networks import records, simulated, solution
from support.results import record, save_image, save_lines, target
from support.wall import SCENE, as_cloud, moved

LINES = {
    'identify': 'identify scans/a.png --family-file gsi.json --control points.csv '
    '--output out --overlay drawn --export csv=csv',
    'watch': 'watch photos --family-file gsi.json --output out --overlay drawn --settling 0',
    'bag': 'bag in.mcap out --register registered --family-file gsi.json --coordinates wall.csv',
    'render': 'render out --family gsi --family-file gsi.json --targets 1 --dot-radius 5 '
    '--width 400 --height 400',
    'evaluate': '',
    'export': 'export results.jsonl csv=csv --control points.csv',
    'report': 'report results.jsonl -o page.html --images photos --truth truth.csv',
    'orient': 'orient seen.jsonl -o out --calibration camera.yaml --cameras cameras.csv '
    '--images photos --scale-bars bars.csv --control known.csv --robot-poses poses.csv '
    '--stations stations.csv --export ply=ply',
    'measure': 'measure net -o out --nominal points.csv --lengths lengths.csv',
    'register': 'register scans -o out --family-file gsi.json --coordinates wall.csv',
    'compare': 'compare net net2 -o out.csv',
    'learn-family': 'learn-family list.csv -o mine.yaml --base gsi.json',
    'demo': '',
    'doctor': '',
    'targets': 'targets --family gsi --family-file gsi.json --ids 1 -o a.svg --geometry g.json',
}
"""A line of each command with all its inputs and outputs; empty for those that lack either."""

WRITTEN = {
    'identify output': 'out/results.jsonl',
    'identify overlay': 'drawn/a_overlay.png',
    'identify export': 'csv/targets.csv',
    'watch output': 'out/results.jsonl',
    'watch overlay': 'drawn/view_0_overlay.png',
    'bag output': 'out/metadata.yaml',
    'bag register': 'registered/targets.csv',
    'render folder': 'out/normal_0.3_0.png',
    'export export': 'csv/targets.csv',
    'report output': 'page.html',
    'orient output': 'out/poses.csv',
    'orient export': 'ply/targets.ply',
    'measure output': 'out/lengths.csv',
    'register output': 'out/transforms.json',
    'compare output': 'out.csv',
    'learn-family output': 'mine.yaml',
    'targets output': 'a.svg',
    'targets geometry': 'g.json',
}
"""One of the files that each output writes."""

NO_FILES = {
    *('cloud_topic', 'command', 'control_crs', 'detector', 'dot_radius', 'expected_ids', 'family'),
    *('focal_length', 'datum', 'distance', 'align_on', 'frame', 'ids', 'labels', 'light', 'maker'),
    *('network_ids', 'output_topic', 'page', 'permissible', 'polarity', 'robot_frames', 'side'),
    *('scheduler', 'search', 'sizes', 'stable', 'stack_by', 'stack_window', 'storage', 'title'),
    *('name', 'topic', 'unit'),
}
"""Options whose texts name no file."""

IN = {'net': 'network.json', 'net2': 'points.csv', 'photos': 'view_0.jpg', 'scans': 'a.ply'}
"""A file that a folder stands for."""


def actions(command: str) -> Iterator[tuple[str, bool]]:
    """Yield the options of a command that name files, and whether these are outputs."""
    (parsers,) = commands._parser([command])._subparsers._group_actions
    for action in parsers.choices[command]._actions:
        kind = action.type
        if action.nargs == 0 or action.choices or action.metavar in ('N', 'X'):
            continue
        if kind in (input_name, input_path, input_files):
            yield action.dest, False
        elif kind is output_path or {'FORMAT=DIR', 'FILE'} & {action.metavar}:
            yield action.dest, True
        else:
            assert action.dest in NO_FILES, f'{command} {action.dest}: what does it name?'


def inputs() -> Iterator[tuple[str, str, list[str]]]:
    """Yield each input of each command that has outputs, with these."""
    for command in commands.COMMANDS:
        found = dict(actions(command))
        outputs = [f'{command} {name}' for name, writes in found.items() if writes]
        for given in (name for name, writes in found.items() if not writes and outputs):
            yield command, given, outputs


@pytest.fixture(scope='module')
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with inputs of all commands."""
    made = tmp_path_factory.mktemp('stage')
    for name in ('photos', 'scans'):
        (made / name).mkdir()
    shutil.copyfile(ROOT / 'ahf_ros' / 'prints' / 'gsi.json', made / 'gsi.json')
    save_image(made / 'photos' / 'view_0.jpg')
    picture = render(SCENE).image
    write_image(made / 'scans' / 'a.png', picture)
    (made / 'scans' / 'a.ply').write_bytes(write_ply(as_cloud(moved(0))))
    assert status('register', made / 'scans', '-o', made / 'wall') == 0
    shutil.move(made / 'wall' / 'targets.csv', made / 'wall.csv')
    shutil.rmtree(made / 'wall')
    network, _ = simulated(3, 8)
    save_lines(made / 'seen.jsonl', *records(network))
    save_lines(made / 'results.jsonl', record('view_0.jpg', target(1)))
    for name in ('net', 'net2'):
        write_network(made / name, solution())
    shutil.copyfile(made / 'net' / 'camera_ros.yaml', made / 'camera.yaml')
    write_truth(made / 'truth.csv', {'view_0.jpg': ()})
    points = dict(zip(network.targets, solution(3, 8).state.points.tolist(), strict=True))
    tables = {
        'points.csv': [['id', 'x', 'y', 'z'], *([name, *xyz] for name, xyz in points.items())],
        'known.csv': [
            ['id', 'x', 'y', 'z', 'unit'],
            *([name, *xyz, 'mm'] for name, xyz in points.items()),
        ],
        'bars.csv': [
            ['id_1', 'id_2', 'length', 'sigma'],
            ['1', '2', np.linalg.norm(np.subtract(points['1'], points['2'])), 0.01],
        ],
        'lengths.csv': [['id_1', 'id_2', 'length'], ['1', '2', 300.0]],
        'cameras.csv': [['image', 'camera'], *([name, 'camera'] for name in network.photographs)],
        'stations.csv': [['image', 'station'], *([it, it] for it in network.photographs)],
        'poses.csv': [['image', *'xyz', 'rx', 'ry', 'rz'], ['view_0.jpg', 0, 0, 0, 0, 0, 0]],
        'list.csv': surveyed(),
    }
    for name, rows in tables.items():
        (made / name).write_bytes(csv_table([list(map(str, row)) for row in rows]))
    bags.write_ros2(made / 'bag', recorded())
    shutil.move(next((made / 'bag').glob('*.mcap')), made / 'in.mcap')
    shutil.rmtree(made / 'bag')
    return made


def surveyed() -> Iterator[list[object]]:
    """Yield a point list of three point-distributed targets."""
    family = point_family()
    for number in (1, 2, 18):
        word = family.word(number)
        dots = dict(zip(family.template_names, family.template, strict=True))
        dots |= zip(positions_of(word), family.positions[family.decoding_dots(word)], strict=True)
        for name, (x, y) in dots.items():
            yield [f'CODE{number}' if name == 'E' else f'NUGGET{number}_{name}', x, y, number]


def recorded() -> list[bags.Recorded]:
    """Return an image and its cloud."""
    store, time = typestore(), 10**9
    image = bags.image(store, render(SCENE).image, time)
    cloud = bags.cloud(store, as_cloud(moved(0)), time)
    return [('/image', IMAGE, time, image), ('/points', POINT_CLOUD, time, cloud)]


def line_of(command: str, given: str) -> tuple[list[str], argparse.Namespace]:
    """Return the words of a line of a command that has an input, and what is parsed of them."""
    words = LINES[command].split()
    if command == 'orient':  # which accepts one of two
        place = words.index('--stations' if given == 'robot_poses' else '--robot-poses')
        del words[place : place + 2]
    return words, commands._parser(words).parse_args(words)


@pytest.mark.parametrize(('command', 'given', 'outputs'), list(inputs()))
def test_an_input_stays(
    stage: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    command: str,
    given: str,
    outputs: list[str],
) -> None:
    """One of the files that each output writes is another name of the input.

    What was not refused, as the command has ended before, is tried again, until all is refused.
    """
    shutil.copytree(stage, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    words, options = line_of(command, given)
    value = getattr(options, given)
    file = Path(value[0] if isinstance(value, list) else value)
    file = file / IN[file.name] if file.is_dir() else file
    before = {it: it.read_bytes() for it in tmp_path.rglob('*') if it.is_file()}
    left = {it: Path(WRITTEN[it]) for it in outputs}
    while left:
        for output in left.values():
            output.parent.mkdir(exist_ok=True)
            output.unlink(missing_ok=True)
            output.hardlink_to(file)
        if command == 'watch':  # it would not end
            done = ahf(*words, timeout=60)
            assert done.returncode
            said = done.stderr
        else:
            assert status(*words)
            said = capfd.readouterr().err
        refused = {
            name
            for name, output in left.items()
            if f'{output} cannot be written: it is an input, {tmp_path / file}' in said
            or (name == 'bag output' and f'{output.parent} exists' in said)
        }
        assert refused, said
        for name in refused:
            assert left[name].samefile(file)
            left.pop(name).unlink()
    assert {it: it.read_bytes() for it in before} == before
