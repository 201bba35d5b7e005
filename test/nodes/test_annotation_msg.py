from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip('visualization_msgs', reason='ROS 2 is not installed')

from std_msgs.msg import Header
from visualization_msgs.msg import ImageMarker, Marker

from ahf_ros import msg
from ahf_ros.interchange.point_clouds import COVARIANCE
from ahf_ros.interchange.target_messages import coded_target_array
from ahf_ros.localisation import Positions
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.messages import target_annotations, target_labels, target_points
from ahf_ros.target import UNDECODED, Identification, Target

SEEN = Target(18, 71, 100.0, 50.0, 20.0, 10.0, math.pi / 2, confidence=0.75)
LOST = Target(UNDECODED, 0, 10.0, 20.0, 5.0, 5.0)
HEADER = Header(frame_id='scanner')


def answer(*targets: Target) -> CodedTargetArray:
    return coded_target_array(Identification(targets), 'metashape12', (100, 200), HEADER, msg)


def lines(marker: ImageMarker) -> np.ndarray:
    """Return both ends of the lines of a marker, shape (n, 2, 2)."""
    return np.array([(point.x, point.y) for point in marker.points]).reshape(-1, 2, 2)


def test_a_dot_is_outlined_in_the_coordinates_of_viewers() -> None:
    drawn = lines(target_annotations(answer(LOST)))
    away = np.hypot(*(drawn - (10.5, 20.5)).reshape(-1, 2).T)
    assert away == pytest.approx(np.full(len(away), 5.0))
    assert (drawn[1:, 0] == drawn[:-1, 1]).all()  # closed
    assert drawn[-1, 1] == pytest.approx(drawn[0, 0])


def test_the_ellipse_is_turned() -> None:
    marker = target_annotations(answer(SEEN))
    drawn = lines(marker)
    assert drawn[:, :, 1].max() == pytest.approx(70.5)
    assert drawn[:, :, 0].max() == pytest.approx(110.5)
    assert (marker.header, marker.type) == (HEADER, ImageMarker.LINE_LIST)
    assert len(marker.outline_colors) == len(drawn)


def test_colours_tell_undecoded_targets() -> None:
    marker = target_annotations(answer(LOST, SEEN))
    first, last = marker.outline_colors[0], marker.outline_colors[-1]
    assert first.r > first.g > first.b
    assert last.g > max(last.r, last.b)


def test_without_targets_there_are_no_lines() -> None:
    marker = target_annotations(answer())
    assert (marker.points, marker.outline_colors) == ([], [])
    assert marker.action == ImageMarker.ADD


FOUND = Positions(
    np.array([(1.0, 2.0, 3.0), (math.nan,) * 3]),
    np.array([0.1, math.nan]),
    np.array([0.5, 0.5]),
    np.array([[(1.0, 2.0, 3.0), (2.0, 4.0, 5.0), (3.0, 5.0, 6.0)], np.full((3, 3), math.nan)]),
)


def test_points_carry_ids_and_are_nan_where_they_are_not_known() -> None:
    message = target_points(answer(SEEN, LOST).targets, FOUND, HEADER)
    assert (message.header, message.width, message.is_dense) == (HEADER, 2, False)
    first, second = np.frombuffer(message.data, 'f4,f4,f4,i4,8f4').tolist()
    assert first[:4] == (1, 2, 3, 18)
    assert first[4].tolist() == pytest.approx([0.75, 0.1, *range(1, 7)])
    assert (second[3], second[4][0]) == (UNDECODED, 1.0)
    assert np.isnan(second[4][1:]).all()
    assert math.isnan(second[0])
    names = ['x', 'y', 'z', 'id', 'confidence', 'deviation', *COVARIANCE]
    assert [field.name for field in message.fields] == names
    assert (message.point_step, message.row_step, len(message.data)) == (48, 96, 96)
    empty = Positions(np.empty((0, 3)), np.empty(0), np.empty(0), np.empty((0, 3, 3)))
    assert target_points((), empty, HEADER).is_dense


def test_labels_stand_where_positions_are_known() -> None:
    clear, label = target_labels(answer(SEEN, LOST).targets, FOUND, HEADER).markers
    assert clear.action == Marker.DELETEALL
    place = label.pose.position
    assert (label.text, place.x, place.y, place.z) == ('18', 1.0, 2.0, 3.0)
    assert label.scale.z == 30.0
    assert label.type == Marker.TEXT_VIEW_FACING
