"""Figures against truth: what counts as what, on cases small enough to count by hand."""

import math
from typing import Any

import pytest

from ahf_ros.base.target import UNDECODED, Target, TrueTarget
from ahf_ros.scenes import evaluation
from ahf_ros.scenes.evaluation import (
    FALSE,
    FOUND,
    RIGHT,
    WRONG,
    Score,
    evaluate,
    judge,
    score,
    table,
    total,
)

TRUTH = (TrueTarget(1, 10.0, 10.0), TrueTarget(2, 50.0, 10.0), TrueTarget(3, 90.0, 10.0))


def report(number: int, x: float, y: float = 10.0) -> Target:
    return Target(number, 0, x, y, 5.0, 5.0)


def kinds(*reported: Target, truth: tuple[TrueTarget, ...] = TRUTH) -> list[str]:
    return [verdict.kind for verdict in judge(truth, reported)]


def test_all_right() -> None:
    figures = score(TRUTH, [report(1, 10), report(2, 50), report(3, 90)])
    assert (figures.expected, figures.reported, figures.found, figures.right) == (3, 3, 3, 3)
    assert (figures.correctness, figures.recall, figures.decoding) == (1.0, 1.0, 1.0)
    assert (figures.wrong, figures.false_positives, figures.rmse) == (0, 0, (0.0, 0.0, 0.0))


def test_the_figures_of_the_paper() -> None:
    # n = 4 reported: one right, one with another's ID, one undecoded, one where nothing is
    reported = [report(1, 11), report(7, 51), report(UNDECODED, 89), report(8, 200)]
    figures = score(TRUTH, reported)
    assert (figures.reported, figures.found, figures.right) == (4, 3, 1)
    assert (figures.correctness, figures.recall, figures.decoding) == (3 / 4, 1.0, 1 / 3)
    assert (figures.wrong, figures.false_positives) == (1, 1)


def test_errors_are_those_of_the_right_ones() -> None:
    reported = [report(1, 13, 10), report(2, 50, 14), report(9, 90.5)]
    figures = score(TRUTH, reported)
    assert figures.errors == ((3.0, 0.0), (0.0, 4.0))
    assert figures.rmse == pytest.approx((math.sqrt(4.5), math.sqrt(8), math.sqrt(12.5)))


TWINS = (TrueTarget(1, 10.0, 10.0), TrueTarget(1, 50.0, 10.0))
NEAR = (TrueTarget(1, 10.0, 10.0), TrueTarget(2, 13.0, 10.0))


@pytest.mark.parametrize(
    ('truth', 'reported', 'expected'),
    [
        pytest.param(TRUTH, [report(1, 14.9)], [RIGHT], id='within the tolerance'),
        pytest.param(TRUTH, [report(1, 15.0)], [RIGHT], id='at the tolerance'),
        pytest.param(TRUTH, [report(1, 15.1)], [FALSE], id='beyond the tolerance'),
        pytest.param(TRUTH, [report(1, 12), report(1, 11)], [FALSE, RIGHT], id='twice'),
        pytest.param(TRUTH, [report(-1, 10), report(1, 11)], [FALSE, RIGHT], id='undecoded, too'),
        pytest.param(TRUTH, [report(5, 10), report(1, 11)], [WRONG, RIGHT], id='a wrong ID, too'),
        pytest.param(TRUTH, [report(2, 10), report(1, 300)], [WRONG, FALSE], id='right far away'),
        pytest.param(NEAR, [report(2, 11.4), report(1, 11.6)], [RIGHT, RIGHT], id='neighbours'),
        pytest.param(TWINS, [report(1, 10), report(1, 50)], [RIGHT, RIGHT], id='an ID twice'),
    ],
)
def test_what_counts_as_what(truth: Any, reported: Any, expected: Any) -> None:
    assert kinds(*reported, truth=truth) == expected


def test_a_target_that_is_reported_twice_is_right_once() -> None:
    figures = score(TRUTH, [report(1, 12), report(1, 11)])
    assert (figures.right, figures.false_positives, figures.errors) == (1, 1, ((1.0, 0.0),))


@pytest.mark.parametrize('reported', [[], [report(2, 50)], [report(UNDECODED, 50)]])
def test_what_is_not_confirmed_counts_neither_for_nor_against(reported: Any) -> None:
    truth = (TRUTH[0], TrueTarget(2, 50.0, 10.0, confirmed=False))
    figures = score(truth, [report(1, 10), *reported])
    assert figures == Score(1, 1, 1, 1, 0, 0, ((0.0, 0.0),))


def test_a_wrong_id_in_the_place_of_one_that_is_not_confirmed_is_wrong() -> None:
    truth = (TrueTarget(2, 50.0, 10.0, confirmed=False),)
    figures = score(truth, [report(4, 50)])
    assert (figures.wrong, figures.reported, figures.found) == (1, 1, 0)


def test_nothing_there_and_nothing_reported() -> None:
    figures = score((), ())
    assert figures == Score(0, 0, 0, 0, 0, 0)
    assert (figures.correctness, figures.recall, figures.decoding) == (None, None, None)
    assert figures.rmse is None


def test_images_add_up() -> None:
    first = score(TRUTH, [report(1, 13)])
    second = score(TRUTH, [report(2, 50, 14), report(9, 400)])
    together = total([first, second])
    assert together == Score(6, 3, 2, 2, 0, 1, ((3.0, 0.0), (0.0, 4.0)))
    assert total([]) == Score(0, 0, 0, 0, 0, 0)


def test_every_image_of_either_side_has_figures() -> None:
    scores = evaluate({'a.png': TRUTH, 'b.png': TRUTH}, {'b.png': [], 'c.png': [report(1, 10)]})
    assert list(scores) == ['a.png', 'b.png', 'c.png']
    assert scores['a.png'].recall == scores['b.png'].recall == 0.0
    assert (scores['c.png'].expected, scores['c.png'].false_positives) == (0, 1)


def test_the_table_shows_wrong_and_false_ones_and_names_that_are_printable() -> None:
    figures = score(TRUTH, [report(1, 10), report(7, 50)])
    lines = table({'a.png': figures, '\x1b[31m\n': score((), ())}).splitlines()
    assert [' '.join(line.split()) for line in lines[:3]] == [
        'image N n I d C % R % D % wrong false RMSE X px Y XY',
        'a.png 3 2 2 1 100.0 66.7 33.3 1 0 0.0000 0.0000 0.0000',
        '\\x1b[31m\\n 0 0 0 0 - - - 0 0 - - -',
    ]
    assert lines[3].split()[0] == 'total'
    assert len({len(line) for line in lines}) == 1


def test_no_number_of_targets_takes_all_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evaluation, 'MAXIMUM_PAIRS', 8)
    assert kinds(*(report(number, 10.0) for number in range(8)))[:2] == [WRONG, RIGHT]
    with pytest.raises(
        ValueError, match=r'9 pairs of 9 reports and 3 targets in x, accepted are 8'
    ):
        judge(TRUTH, [report(number, 10.0) for number in range(9)])


@pytest.mark.parametrize('tolerance', [0, -1, math.nan])
def test_a_tolerance_that_makes_no_sense_is_refused(tolerance: float) -> None:
    with pytest.raises(ValueError, match=r'tolerance is .*, accepted is a number above 0'):
        judge(TRUTH, [], tolerance=tolerance)


def test_verdicts_name_the_target() -> None:
    verdicts = judge(TRUTH, [report(UNDECODED, 91), report(5, 300)])
    assert [verdict.kind for verdict in verdicts] == [FOUND, FALSE]
    assert [verdict.target for verdict in verdicts] == [TRUTH[2], None]
