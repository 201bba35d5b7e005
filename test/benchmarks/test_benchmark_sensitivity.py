"""A constant is changed wherever it is used, and nothing else is."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from ahf_ros.scenes.scene import SceneSettings
from benchmarks.sensitivity import (
    Outcome,
    changed,
    constants,
    main,
    outcome,
    outcome_table,
    ranked,
    rendered,
    written,
)

CERTAIN = 'ahf_ros.families.ring.hypotheses.CERTAIN'
SCALE = 'ahf_ros.vision.profiles.USUAL_BLUR'  # circle_fit imports it
PAIR = 'ahf_ros.vision.log_edges._STRONG_EDGE'  # one of two in a line
SCENE = SceneSettings(width=480, height=320, targets=3, dot_radius=9.0)


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(rendered([SCENE]), tmp_path_factory.mktemp('sensitivity') / 'scenes')


def test_a_change_reaches_whatever_uses_the_constant_and_nothing_else(folder: Path) -> None:
    assert CERTAIN in dict(constants())
    found = outcome(folder)
    assert (found.right, found.wrong, found.false) == (3, 0, 0)
    assert outcome(folder, CERTAIN, dict(constants())[CERTAIN]) == found
    assert outcome(folder, CERTAIN, 1.1) == Outcome(0, 0, 0, None)
    assert outcome(folder, SCALE, 2.0).rmse != found.rmse
    assert PAIR in dict(constants())
    # More than any step, but a threshold that cv2.Canny takes on one core as well, in 16 bits.
    assert outcome(folder, PAIR, 30.0) == Outcome(0, 0, 0, None)


@pytest.mark.parametrize('name', [f'{CERTAIN}_NOT', 'ahf_ros.cli.bag.PERIOD'])
def test_what_cannot_be_changed_is_no_outcome(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert outcome(folder, name, 1.0) == Outcome()
    assert name.rpartition('.')[2] in capsys.readouterr().err


def test_constants_up_to_one_approach_it() -> None:
    assert [changed(CERTAIN, 0.98, factor) for factor in (0.5, 2.0)] == pytest.approx([0.99, 0.96])
    assert changed('ahf_ros.vision.dots._SAME', 0.3, 0.5) == 0.15


def test_what_costs_most_comes_first() -> None:
    tried = {
        'harmless': [Outcome(9, 0, 0), Outcome(10, 0, 0)],
        'wrong': [Outcome(8, 1, 0), Outcome(9, 0, 0)],
        'missed': [Outcome(9, 0, 0), Outcome(7, 0, 0)],
        'fails': [Outcome(), Outcome()],
    }
    assert ranked(tried) == ['wrong', 'missed', 'harmless', 'fails']


def test_the_table_shows_what_changed() -> None:
    lines = outcome_table(
        {CERTAIN: 0.98}, Outcome(9, 0, 0, 0.01), {CERTAIN: [Outcome(), Outcome(8, 1, 0)]}
    )
    assert lines.splitlines()[-2:] == [
        '| none changed |  | 9 (0.010) | 9 (0.010) |',
        '| `families.ring.hypotheses.CERTAIN` | 0.98 | fails | 8, 1 wrong |',
    ]


def test_names_that_do_not_exist_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, 'argv', ['sensitivity', 'NO_CONSTANT'])
    with pytest.raises(SystemExit):
        main()
    assert 'no such constants: NO_CONSTANT' in capsys.readouterr().err
