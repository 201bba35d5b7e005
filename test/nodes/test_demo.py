"""The demo as a user starts it, and the picture that it makes."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.drawing.overlay import DECODED_COLOUR, MISSED_COLOUR, WRONG_COLOUR
from ahf_ros.interchange.image_files import read_image
from ahf_ros.target import FilterState, Identification, Target
from support.live import PATIENCE, errors_of, ros_environment

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

WAYS = ('traditional', 'traditional with AHF', 'ring')
GRAY = np.full((240, 320), 120, np.uint8)


def demo(*options: str) -> subprocess.CompletedProcess[str]:
    """Return what `make demo` makes of options."""
    return subprocess.run(
        [sys.executable, '-m', 'ahf_ros.nodes', 'demo', *options],
        env={**os.environ, **ros_environment()},
        capture_output=True,
        text=True,
        timeout=4 * PATIENCE,
    )


def test_the_demo_shows_one_image_in_three_ways(tmp_path: Path) -> None:
    done = demo('--output', str(tmp_path))
    assert (done.returncode, errors_of(done.stderr)) == (0, '')
    found = re.findall(
        r'^  (\w.*?)  +(\d+) of 12 right.* (\d+) missed.*; (.*), ', done.stdout, re.M
    )
    assert tuple(way for way, *_ in found) == WAYS
    (alone, filtered, ring), methods = (
        [int(right) for _, right, *_ in found],
        [method for *_, method in found],
    )
    assert alone <= 3
    assert filtered >= 11
    assert ring >= 11
    assert all(int(right) + int(missed) == 12 for _, right, missed, _ in found)
    assert methods[0] == methods[2] == 'no filter, 1 trial'
    trials = re.fullmatch(r'gamma_high \d\.\d\d, gamma_low \d\.\d\d, (\d+) trials', methods[1])
    assert 2 <= int(trials.group(1)) <= 51
    (picture,) = tmp_path.iterdir()
    assert str(picture) in done.stdout
    height, width = read_image(picture).shape
    assert width > 1600
    assert height > width * 1066 / 1600


def test_the_demo_ends_when_a_node_does(tmp_path: Path) -> None:
    command = [sys.executable, '-m', 'ahf_ros.nodes', 'demo', '--output', str(tmp_path)]
    with subprocess.Popen(
        command, env={**os.environ, **ros_environment()}, stderr=subprocess.PIPE, text=True
    ) as process:
        children = Path(f'/proc/{process.pid}/task/{process.pid}/children')
        limit = time.monotonic() + PATIENCE
        while len(nodes := children.read_text().split()) < 3 and time.monotonic() < limit:
            time.sleep(0.05)
        os.kill(int(nodes[0]), signal.SIGKILL)
        assert 'a node has ended' in process.communicate(timeout=PATIENCE)[1]
    assert process.returncode == 1
    assert not any(Path(f'/proc/{node}').exists() for node in nodes)


@pytest.mark.parametrize(('option', 'field'), [('--ambient', 'ambient'), ('--seed', 'seed')])
def test_bad_options_of_the_demo_are_named(option: str, field: str) -> None:
    done = demo(option, '-1')
    assert done.returncode == 2
    assert f'{field} is -1' in done.stderr
    assert 'accepted is' in done.stderr


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    done = demo('--output', str(tmp_path / 'file'))
    assert done.returncode == 2
    assert str(tmp_path / 'file') in done.stderr


def test_a_tile_tells_right_wrong_and_missed_targets_apart() -> None:
    from ahf_ros.nodes.demo import tile

    places = {7: 60.0, 8: 160.0, 9: 260.0}
    truth = tuple(Target(number, 0, x, 120.0, 20.0, 12.0) for number, x in places.items())
    right, other, missed = truth
    wrong = Target(5, 0, other.x, other.y, 20.0, 12.0)
    answer = Identification((wrong, right), 3, FilterState(evaluations=4))
    made = tile('a detector', GRAY, answer, truth)
    assert made.title == 'a detector'
    assert dict(made.remarks) == {
        '1 right': DECODED_COLOUR,
        '1 wrong': WRONG_COLOUR,
        '1 missed': MISSED_COLOUR,
    }
    for colour, target in zip(dict(made.remarks).values(), (right, wrong, missed), strict=True):
        near = made.picture[115:126, round(target.x) - 5 : round(target.x) + 6].astype(int)
        assert (np.abs(near - colour).max(axis=2) < 60).any()
