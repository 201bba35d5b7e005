"""Diagnostics of the node `detector`."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from diagnostic_msgs.msg import DiagnosticStatus

from ahf_ros.nodes.diagnostics import Diagnostics, Tally
from ahf_ros.target import Identification


def test_a_mirrored_image_is_a_warning() -> None:
    tally = Tally(received=1, answered=1)
    diagnostics = Diagnostics('detector', tally)
    assert diagnostics.status(1.0).level == DiagnosticStatus.OK
    tally.last = Identification((), mirrored=True)
    status = diagnostics.status(1.0)
    assert (status.level, status.message) == (
        DiagnosticStatus.WARN,
        'the last image seems to be mirrored',
    )
    assert {it.key: it.value for it in status.values}['mirrored'] == 'True'


def test_edges_that_are_far_from_where_they_should_be_are_a_warning() -> None:
    tally = Tally(received=1, answered=1, last=Identification((), edge_shift=-0.62))
    status = Diagnostics('detector', tally).status(1.0)
    assert (status.level, status.message) == (
        DiagnosticStatus.WARN,
        'edges are 0.6 px too bright: the photograph is over-exposed or blurred',
    )
    assert {it.key: it.value for it in status.values}['edge shift (px)'] == '-0.62'
    tally.last = Identification((), edge_shift=0.2)
    assert Diagnostics('detector', tally).status(1.0).level == DiagnosticStatus.OK
    assert {it.key: it.value for it in Diagnostics('detector', Tally()).status(1.0).values}[
        'edge shift (px)'
    ] == ''
