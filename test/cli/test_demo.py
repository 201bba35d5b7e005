"""The demo as a user starts it, and the picture that it makes."""

import re
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.base.target import FilterState, Identification, Target
from ahf_ros.cli.demo import WAYS, tile
from ahf_ros.files.image_files import read_image
from ahf_ros.views.drawing.overlay import DECODED_COLOUR, MISSED_COLOUR, WRONG_COLOUR
from support.command_line import status

pytestmark = pytest.mark.lasting

GRAY = np.full((240, 320), 120, np.uint8)


def test_the_demo_shows_one_image_in_three_ways(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert status('demo', '--output', tmp_path) == 0
    said = capsys.readouterr()
    assert said.err == ''
    found = re.findall(r'^  (\w.*?)  +(\d+) of 12 right.* (\d+) missed.*; (.*), ', said.out, re.M)
    assert [way for way, *_ in found] == list(WAYS)
    alone, filtered, ring = (int(right) for _, right, *_ in found)
    assert alone <= 3
    assert filtered >= 11
    assert ring >= 11
    assert all(int(right) + int(missed) == 12 for _, right, missed, _ in found)
    methods = [method for *_, method in found]
    assert methods[0] == methods[2] == 'no filter, 1 trial'
    trials = re.fullmatch(r'gamma_high \d\.\d\d, gamma_low \d\.\d\d, (\d+) trials', methods[1])
    assert 2 <= int(trials.group(1)) <= 51
    (picture,) = tmp_path.iterdir()
    assert str(picture) in said.out
    height, width = read_image(picture).shape
    assert width > 1600
    assert height > width * 1066 / 1600


@pytest.mark.parametrize(
    ('option', 'words'),
    [
        (['--ambient', '-1'], 'ambient is -1.0, accepted is'),
        (['--seed', '-1'], 'seed is -1, accepted is'),
        (['--output', __file__], __file__),  # a folder that cannot be made
    ],
)
def test_bad_options_of_the_demo_are_named(
    option: list[str], words: str, capsys: pytest.CaptureFixture
) -> None:
    assert status('demo', *option) == 2
    assert words in capsys.readouterr().err


def test_a_tile_tells_right_wrong_and_missed_targets_apart() -> None:
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
