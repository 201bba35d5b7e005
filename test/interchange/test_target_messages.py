from __future__ import annotations

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header

from ahf_ros import msg
from ahf_ros.interchange.target_messages import coded_target_array, identification_from
from ahf_ros.msg import CodedTarget, CodedTargetArray
from ahf_ros.target import UNDECODED, FilterState, Identification, Target

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


def test_message_and_record_mean_the_same_by_undecoded() -> None:
    assert CodedTarget.UNDECODED == UNDECODED
