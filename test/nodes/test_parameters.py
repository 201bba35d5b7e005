"""Parameters that a node does not have are named, with what may be meant."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from ahf_ros.nodes.parameters import unknown_parameters
from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.settings.nested import flat_parameters

KNOWN = [item.name for item in flat_parameters(DetectorNodeSettings)]


def test_a_typing_error_is_named_with_the_nearest_name() -> None:
    assert list(unknown_parameters(['expected_target', 'seed', 'zzz', 'qqq'], KNOWN)) == [
        'no parameter is named expected_target; the nearest is expected_targets',
        'no parameter is named qqq, zzz; is that a parameter of another node?',
    ]
    assert list(unknown_parameters(KNOWN, KNOWN)) == []
