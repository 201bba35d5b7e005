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
