"""Diagnostics of the node `detector`."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from ahf_ros.nodes.diagnostics import Diagnostics, Tally
from ahf_ros.target import Identification
from support.detector import values


@pytest.mark.parametrize(
    ('last', 'message', 'key', 'value'),
    [
        ({'mirrored': True}, 'the last image seems to be mirrored', 'mirrored', 'True'),
        (
            {'edge_shift': -0.62},
            'edges are 0.6 px too bright: the photograph is over-exposed or blurred',
            'edge shift (px)',
            '-0.62',
        ),
    ],
)
def test_what_is_wrong_with_the_last_image_is_a_warning(
    last: dict[str, Any], message: str, key: str, value: str
) -> None:
    tally = Tally(received=1, answered=1, last=Identification((), edge_shift=0.2))
    diagnostics = Diagnostics('detector', tally)
    assert diagnostics.status(1.0).level == DiagnosticStatus.OK
    tally.last = Identification((), **last)
    status = diagnostics.status(1.0)
    assert (status.level, status.message) == (DiagnosticStatus.WARN, message)
    assert values(DiagnosticArray(status=[status]))[key] == value


def test_an_edge_shift_that_is_not_known_is_empty() -> None:
    status = Diagnostics('detector', Tally()).status(1.0)
    assert values(DiagnosticArray(status=[status]))['edge shift (px)'] == ''


def test_advice_is_a_warning_while_nothing_is_identified() -> None:
    tally = Tally(advice='12 dots with a band of 10 sectors: --family cct10')
    status = Diagnostics('detector', tally).status(1.0)
    assert (status.level, status.message) == (DiagnosticStatus.WARN, tally.advice)
    assert values(DiagnosticArray(status=[status]))['advice'] == tally.advice
