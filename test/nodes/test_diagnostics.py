"""Diagnostics of the node `detector`."""

from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from ahf_ros.base.target import Identification, Target
from ahf_ros.nodes.diagnostics import Diagnostics, Stages, Tally
from ahf_ros.nodes.pipeline import IN_A_ROW, Shortfall
from support.detector import values


@pytest.mark.parametrize(
    ('last', 'message', 'key', 'value'),
    [
        ({'mirrored': True}, 'the last image seems to be mirrored', 'mirrored', 'True'),
        (
            {'edge_shift': -0.62},
            'edges are 0.6 px too bright: the photograph is over-exposed',
            'edge shift (px)',
            '-0.62',
        ),
    ],
)
def test_what_is_wrong_with_the_last_image_is_a_warning(
    last: dict[str, Any], message: str, key: str, value: str
) -> None:
    tally = Tally(received=1, answered=1, last=Identification((), edge_shift=0.2))
    diagnostics = Diagnostics(tally)
    assert diagnostics.status(1.0).level == DiagnosticStatus.OK
    tally.last = Identification((), **last)
    status = diagnostics.status(1.0)
    assert (status.level, status.message) == (DiagnosticStatus.WARN, message)
    assert values(DiagnosticArray(status=[status]))[key] == value


def test_an_edge_shift_that_is_not_known_is_empty() -> None:
    status = Diagnostics(Tally()).status(1.0)
    assert values(DiagnosticArray(status=[status]))['edge shift (px)'] == ''


def test_times_are_of_the_last_image_and_means_since_the_last_status() -> None:
    tally, said = Tally(), []
    diagnostics = Diagnostics(tally)
    for conversions in ([0.5], [0.25, 0.75], []):
        for conversion in conversions:
            stages = Stages(arrived=0.0)
            stages.spent['conversion'] = conversion
            tally.times = stages.added(tally.times)
        told = values(DiagnosticArray(status=[diagnostics.status(1.0)]))
        said.append((told['conversion (s)'], told['mean conversion (s)']))
    assert said == [('0.5000', '0.5000'), ('0.7500', '0.5000'), ('0.7500', '')]


def test_advice_is_a_warning_while_nothing_is_identified() -> None:
    tally = Tally(advice='12 dots with a band of 10 sectors: --family cct10')
    status = Diagnostics(tally).status(1.0)
    assert (status.level, status.message) == (DiagnosticStatus.WARN, tally.advice)
    assert values(DiagnosticArray(status=[status]))['advice'] == tally.advice


def shown(*ids: int, expected: int = 0, listed: tuple[int, ...] = (), **more: Any) -> Any:
    targets = tuple(Target(number, number, 5.0, 5.0, 3.0, 3.0) for number in ids)
    return Identification(targets, expected or len(listed), expected_ids=listed, **more)


@pytest.mark.parametrize(
    ('found', 'words'),
    [
        ([shown(7, 8, expected=2)], ''),
        ([shown(7, 8)], ''),
        ([shown(7, expected=2, estimated=True)], ''),
        ([shown(expected=2)], 'show no target, N is 2: family, polarity, min_radius and max_radi'),
        ([shown(7, expected=2)], 'show 1 target, N is 2: set expected_targets to what is in v'),
        (
            [shown(7, expected=2), shown(5, 6, 7, expected=2)],
            'show 1 to 3 targets, N is 2: set expected_targets to what is in view',
        ),
        (
            [shown(7, listed=(7, 8, 9)), shown(8, listed=(7, 8, 9))],
            'lack IDs 9 of expected_ids: leave out of expected_ids what is not in view, or set '
            'network_ids to all if images show some of them',
        ),
        (
            [shown(7, listed=(7, 8)), shown(8, listed=(7, 8))],
            'show 1 target, N is 2: set expected_ids to what is in view',
        ),
        (
            [shown(listed=(7, 8), other_ids=(1, 3))],
            'show IDs 1, 3 and none of expected_ids: set expected_ids to those of the targets',
        ),
        ([shown(listed=(7, 8), other_ids=(1, 3), mirrored=True)], 'show no target, N is 2'),
    ],
)
def test_ten_images_in_a_row_without_what_is_expected_are_told(found: list, words: str) -> None:
    shortfall = Shortfall()
    for number in range(IN_A_ROW):
        assert shortfall.line == ''
        shortfall.see(found[number % len(found)])
    assert shortfall.line.startswith(f'{IN_A_ROW} images in a row {words}' if words else '')
    assert bool(shortfall.line) == bool(words)
    shortfall.see(shown(7, expected=1))
    assert shortfall.line == ''
