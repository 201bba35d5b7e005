import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header

from ahf_ros import msg
from ahf_ros.base.target import UNDECODED, FilterState, Identification, SquareMarker, Target
from ahf_ros.files.target_messages import (
    coded_target_array,
    identification_from,
    is_answered,
    unanswered,
)
from ahf_ros.msg import CodedTarget, CodedTargetArray

COVARIANCE = (1e-4, 0.0, 0.0, 4e-4)
# Values that 32-bit numbers hold exactly.
FOUND = Identification(
    (
        Target(UNDECODED, 0, -0.25, 1e-9, 4.5, 4.25, -1.5, 0.5),
        *(
            Target(
                *(516, 2**20 - 1, 3983.123456789, 2655.5, 20.0, 19.5, 0.25, 1.0, COVARIANCE),
                'aicon14',
                polarity=sign,
            )
            for sign in (1, -1)
        ),
    ),
    54,
    FilterState(True, 2.75, 0.5, 1700.25, 2.25, 200, 12, 3.5),
    True,
    True,
    edge_shift=-0.75,
)


def test_nothing_is_lost_on_the_way() -> None:
    header = Header(frame_id='camera')
    sent = coded_target_array(FOUND, 'metashape20,aicon14', (2656, 3984), header, msg)
    received = deserialize_message(serialize_message(sent), CodedTargetArray)
    assert identification_from(received) == FOUND
    assert received.header == header
    assert (received.width, received.height) == (3984, 2656)
    assert received.family == 'metashape20,aicon14'


def test_nothing_identified_is_a_message_too() -> None:
    sent = coded_target_array(Identification(()), 'aicon12', (10, 20), Header(), msg)
    assert identification_from(sent) == Identification(())


def test_square_markers_keep_their_corners() -> None:
    corners = ((10.0, 20.0), (30.0, 21.0), (31.0, 41.0), (9.0, 40.0))
    for family in ('apriltag_36h11', 'aruco_4x4_50'):
        marker = SquareMarker(
            *(3, 3, 20.0, 30.5, 10.0, 9.5, 0.25, 1.0, COVARIANCE, family),
            corners=corners,
            hamming=2,
            decision_margin=55.5,
        )
        found = Identification((FOUND.targets[1], marker))
        sent = coded_target_array(found, family, (50, 60), Header(), msg)
        received = deserialize_message(serialize_message(sent), CodedTargetArray)
        assert identification_from(received).targets == found.targets
        # Bottom left of the upright marker first, which is at (9, 40) where OpenCV prints it.
        first = (30.0, 21.0) if family == 'apriltag_36h11' else (9.0, 40.0)
        assert tuple(received.targets[1].corners[:2]) == first
        assert np.isnan(received.targets[0].corners).all()
    sent.targets[1].corners = np.zeros(8)  # as a program of others leaves them
    assert type(identification_from(sent).targets[1]) is Target


def test_an_image_that_was_not_identified_is_a_message_too() -> None:
    sent = unanswered('DROPPED', 'too late', 'aicon12', Header(frame_id='camera'), msg)
    assert (sent.status, sent.reason) == (CodedTargetArray.DROPPED, 'too late')
    assert (sent.header.frame_id, sent.family, sent.width) == ('camera', 'aicon12', 0)
    assert not is_answered(sent)
    assert is_answered(CodedTargetArray())


def test_message_and_record_mean_the_same_by_undecoded() -> None:
    assert CodedTarget.UNDECODED == UNDECODED
