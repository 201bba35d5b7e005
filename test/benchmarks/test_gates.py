"""A gate is found where it is, opened, and judged by what it loses and saves."""

import ast
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.base.target import Target
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks import gates
from benchmarks.changed import replace, verdicts
from benchmarks.gates import (
    GATES,
    Difference,
    Gate,
    Picture,
    Seen,
    difference,
    row,
    seen,
    value_of,
    written,
)

CLOSED = Gate('every word', 'families.ring.hypotheses:CERTAIN', '1.1')
NO_MATTER = Gate('blobs of few pixels', 'vision.small_dots:_MINIMUM_PIXELS', '1')
SCENE = SceneSettings(width=480, height=320, targets=3, dot_radius=9.0)


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp('gates')


@pytest.fixture(scope='module')
def named(folder: Path) -> dict[str, Picture]:
    shown = render(SCENE)
    truth = tuple((str(it.id), it.x, it.y) for it in shown.targets)
    return written([Picture('scene', shown.image, truth, 'metashape12')], folder)


@pytest.mark.parametrize('detector', GATES)
def test_every_gate_is_there_and_no_two_are_the_same(detector: str) -> None:
    for gate in GATES[detector]:
        assert value_of(gate.place) != gate.opened, gate
        compile(gate.opened, gate.place, 'eval')
    assert len({(it.place, it.opened) for it in GATES[detector]}) == len(GATES[detector])
    assert len({it.about for it in GATES[detector]}) == len(GATES[detector])


def test_a_gate_that_drops_all_targets_loses_them(folder: Path, named: dict[str, Picture]) -> None:
    # As if the gate was closed in the sources.
    closed, opened = seen(folder, CLOSED), seen(folder)
    made = difference(closed, opened, named)
    assert (made.targets, made.gained, made.lost, made.bad) == (3, 3, 0, 0)
    assert made.loses and made.pictures == ['scene']
    cells = row(CLOSED, made, 1, 1)
    assert cells[:6] == (
        'every word',
        '`families.ring.hypotheses:CERTAIN`',
        '`0.75`',
        '`1.1`',
        '3',
        '0',
    )
    assert 'loses' in cells[-1]


def test_a_gate_at_which_nothing_happens_saves_nothing(
    folder: Path, named: dict[str, Picture]
) -> None:
    made = difference(seen(folder), seen(folder, NO_MATTER), named)
    assert (made.gained, made.lost, made.bad) == (0, 0, 0)
    assert made.saves_nothing and not made.loses


def test_a_detector_that_an_open_gate_breaks_has_no_pictures(
    folder: Path, named: dict[str, Picture], capfd: pytest.CaptureFixture[str]
) -> None:
    broken = Gate('all', 'vision.dot_search:whole_dots', 'None')
    assert seen(folder, broken) == {}
    assert 'not callable' in capfd.readouterr().err
    assert 'does not work open' in row(broken, difference({}, {}, named), 0, 1)[-1]


def test_names_lie_in_modules_functions_and_tuples() -> None:
    assert value_of('vision.ellipses:_MINIMUM_STEP') == '0.1'
    assert value_of('vision.ellipses:_INLIER') == '0.06'  # one of two in a line
    assert value_of('families.ring.contests:resolve') == 'a function'
    assert value_of('families.ring.contests:resolve.kept') == 'owners(len(ids), on_it)'
    for missing in ('vision.ellipses:_NO', 'vision.no:_MINIMUM_STEP', 'vision.ellipses:no.a'):
        with pytest.raises(KeyError):
            value_of(missing)


def test_an_expression_stands_for_a_constant_a_function_or_a_part_of_one() -> None:
    source = 'A, B = 1, 2\ndef f(x):\n    good = x > A\n    return good\ndef g():\n    return B\n'
    tree = ast.parse(source)
    for name, expression in (('B', '3 + ORIGINAL'), ('f.good', 'x'), ('g', 'lambda: A + B')):
        replace(tree, name, expression)
    made: dict = {}
    tree = ast.fix_missing_locations(tree)
    exec(compile(tree, 'made', 'exec'), made)
    assert (made['f'](0), made['g']()) == (0, 6)


def test_reports_are_judged_as_the_yardstick_does() -> None:
    place = dict(semi_major=1.0, semi_minor=1.0, angle=0.0, confidence=1.0)
    found = [
        Target(id=1, code=9, x=0.0, y=3.0, **place),
        Target(id=1, code=9, x=0.0, y=4.0, **place),  # again
        Target(id=2, code=8, x=50.0, y=50.0, **place),  # of another one
        Target(id=3, code=7, x=90.0, y=90.0, **place),  # where there is none
        Target(id=-1, code=0, x=95.0, y=90.0, **place),
    ]
    truth = (('1', 0.0, 0.0), ('7', 50.0, 52.0), ('code 6', 200.0, 0.0))
    assert verdicts(found, truth) == ({0: 3.0}, 2, 1)
    assert verdicts(found, (('code 9', None, None), ('2', None, None))) == ({0: 0.0, 1: 0.0}, 0, 2)


def test_pictures_are_chosen_by_a_part_of_their_names() -> None:
    assert gates.chosen('yardstick r10_stripe.png', [])
    assert gates.chosen('yardstick r10_stripe.png', ['phone', 'r10'])
    assert not gates.chosen('yardstick r10_stripe.png', ['phone'])
    some = gates.pictures('gsi', [1], Path('nowhere'), ['rendered gsi 6 normal'])
    assert [it.name for it in some] == ['rendered gsi 6 normal 1']
    assert {gates.kind_of_detector(it) for it in ('aruco_4x4_50', 'apriltag_36h11')} == {'square'}


def test_some_targets_are_covered_and_some_pictures_show_none(tmp_path: Path) -> None:
    asked = ['gray 128 over 2 whole sectors', 'textured_image 1 3', 'text_page 1 0']
    shown = list(gates.pictures('square', [1], tmp_path, asked))
    covered = [it for it in shown if 'gray 128' in it.name]
    assert {it.family for it in covered} == {'aruco_4x4_50', 'apriltag_36h11'}
    assert sum(len(it.truth) for it in covered) == 2 * gates.COVERED
    empty = [it.name for it in shown if not it.truth]
    assert sorted(empty) == ['text_page 1 0', 'textured_image 1 3']
    assert not any('over' in it.name for it in gates.pictures('gsi', [1], tmp_path, asked))


def test_two_in_a_thousand_may_die() -> None:
    assert not Difference(targets=1000, gained=2).loses
    assert Difference(targets=1000, gained=3).loses
    assert not Difference(calls=90, more=100).saves_nothing
    assert not Difference(calls=100, more=100, bad=1).saves_nothing


def test_only_pictures_that_were_done_in_time_count() -> None:
    both = {name: Seen({0: 0.0}, 0, 0, 10, 1.0) for name in ('a', 'b')}
    of = Picture('', np.zeros((1, 1)), (('1', 0.0, 0.0),), 'metashape12')
    made = difference(both, {'a': both['a']}, {'a': of, 'b': of})
    assert (made.targets, made.calls, made.more) == (1, 10, 10)


def test_the_page_says_what_was_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = render(SCENE)
    truth = tuple((str(it.id), it.x, it.y) for it in shown.targets)
    picture = Picture('small scene', shown.image, truth, 'metashape12')
    monkeypatch.setattr(gates, 'pictures', lambda *_: iter([picture]))
    asked = ['--detectors', 'ring', '--gates', NO_MATTER.place, '--output', str(tmp_path / 'page')]
    monkeypatch.setattr('sys.argv', ['gates', *asked])
    gates.main()
    text = (tmp_path / 'page.md').read_text()
    assert text.strip() == capsys.readouterr().out.strip()
    assert 'Commit ' in text and 'Pictures: small scene.' in text
    assert 'As it is, 3 of 3 targets are right and 0 reports wrong or false' in text
    assert f'`{NO_MATTER.place}` | `4` | `1` | 0 | 0 | +0 |' in text
