"""A number is changed wherever it is used, and what that changes is seen."""

import math
import sys
from pathlib import Path

import pytest

from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks.gates import Gate, Picture, Seen, seen, written
from benchmarks.sensitivity import Change, changed, main, modules, numbers

CERTAIN = 'families.ring.hypotheses:CERTAIN'
PAIR = 'vision.log_edges:_STRONG_EDGE'  # one of two in a line
SCENE = SceneSettings(width=480, height=320, targets=3, dot_radius=9.0)


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp('sensitivity')
    shown = render(SCENE)
    truth = tuple((str(it.id), it.x, it.y) for it in shown.targets)
    written([Picture('scene', shown.image, truth, 'metashape12')], made)
    return made


def test_a_change_reaches_whatever_uses_the_number_and_nothing_else(folder: Path) -> None:
    every = [name for module in modules('ring') for name in numbers(module)]
    assert {CERTAIN, PAIR} <= set(every) and len(every) == len(set(every))
    before = seen(folder)
    same = Change.between(before, seen(folder, Gate('', CERTAIN, '0.75')))
    assert same.same_bits and not same.matters and str(same) == 'same bits'
    none = Change.between(before, seen(folder, Gate('', CERTAIN, '1.1')))
    assert (none.gained, none.lost, none.bad, none.matters) == (0, 3, 0, True)
    # More than any step, but a threshold that cv2.Canny takes on one core as well, in 16 bits.
    assert Change.between(before, seen(folder, Gate('', PAIR, '30.0'))).lost == 3
    blurred = seen(folder, Gate('', 'vision.profiles:USUAL_BLUR', '2.0'))  # circle_fit imports it
    assert not Change.between(before, blurred).same_bits


@pytest.mark.parametrize('place', [f'{CERTAIN}_NOT', 'cli.bag:PERIOD'])
def test_what_cannot_be_changed_does_not_work(
    folder: Path, place: str, capsys: pytest.CaptureFixture[str]
) -> None:
    made = Change.between(seen(folder), seen(folder, Gate('', place, '1.0')))
    assert made.matters and str(made) == 'does not work'
    assert place.rpartition(':')[2] in capsys.readouterr().err


@pytest.mark.parametrize(
    ('place', 'halved', 'doubled'),
    [
        ('vision.dots:_SAME', '0.15', '0.6'),
        ('families.ring.detector:_PART', '64', '256'),
        ('vision.profiles:BLURS', '(0.25, 2.0)', '(1.0, 8.0)'),
        ('families.ring.borders:_BESIDE', '1', '6'),
    ],
)
def test_numbers_are_halved_and_doubled(place: str, halved: str, doubled: str) -> None:
    made = [changed(place, factor) for factor in (0.5, 2.0)]
    assert [it and it.opened for it in made] == [halved, doubled]


def test_the_distance_of_a_share_from_one_is_changed() -> None:
    made = [changed(CERTAIN, factor) for factor in (0.5, 2.0)]
    assert [it and float(it.opened) for it in made] == [0.875, 0.5]


def test_what_counts_as_a_change() -> None:
    before = {'one': Seen({0: 0.1, 1: 0.2}, 0, 0, 1000, 1.0)}
    moved = {'one': Seen({0: 0.1, 1: 0.2001}, 0, 0, 1004, 1.0)}
    made = Change.between(before, moved)
    assert not made.matters and not made.same_bits and str(made) == 'nothing'
    worse = {'one': Seen({0: 0.1, 2: 0.3}, 1, 0, 900, 1.0)}
    made = Change.between(before, worse)
    assert (made.gained, made.lost, made.bad, made.calls) == (1, 1, 1, 0.9)
    assert str(made) == '+1, -1, +1 wrong or false, error 1.414, calls 0.900'
    assert math.isnan(Change.between(before, {}).error) and Change.between(before, {}).matters


def test_numbers_that_do_not_exist_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, 'argv', ['sensitivity', '--numbers', 'NO_NUMBER', '--seeds', '1'])
    with pytest.raises(SystemExit):
        main()
    assert 'NO_NUMBER' in capsys.readouterr().err
