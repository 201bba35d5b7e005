from __future__ import annotations

import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from ahf_ros.bag.definitions import CODED_TARGETS, message_types, typestore
from ahf_ros.interchange.target_messages import coded_target_array
from ahf_ros.target import UNDECODED, FilterState, Identification, Target

FOUND = Identification(
    (
        Target(UNDECODED, 0, -0.25, 1e-9, 4.3, 4.1, -1.5, 0.3),
        Target(
            *(516, 2**20 - 1, 3983.123456789, 2655.5, 20.1, 19.7, 0.2, 1.0, (1e-4, 0, 0, 4e-4)),
            polarity=-1,
        ),
    ),
    54,
    FilterState(True, 2.7, 0.13, 1700.3, 2.2, 200, 12, 3.1),
    edge_shift=-0.75,
)


def serialized(found: Identification) -> bytes:
    store = typestore()
    time = store.types['builtin_interfaces/msg/Time'](sec=12, nanosec=345)
    header = store.types['std_msgs/msg/Header'](stamp=time, frame_id='camera')
    message = coded_target_array(found, 'aicon12', (2656, 3984), header, message_types(store))
    return bytes(store.serialize_cdr(message, CODED_TARGETS))


def test_a_message_comes_back_as_it_was() -> None:
    store = typestore()
    message = store.deserialize_cdr(serialized(FOUND), CODED_TARGETS)
    assert (message.width, message.height, message.family) == (3984, 2656, 'aicon12')
    assert [it.id for it in message.targets] == [UNDECODED, 516]
    assert message.targets[1].x == 3983.123456789
    assert [it.polarity for it in message.targets] == [0, -1]
    assert message.targets[1].covariance.tolist() == [1e-4, 0.0, 0.0, 4e-4]
    assert message.filter.gamma_high == pytest.approx(2.7, abs=1e-6)
    assert message.edge_shift == -0.75


@pytest.mark.parametrize('found', [FOUND, Identification(())])
def test_ros_writes_the_same_bytes(found: Identification) -> None:
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    from builtin_interfaces.msg import Time
    from rclpy.serialization import serialize_message
    from std_msgs.msg import Header

    from ahf_ros import msg

    header = Header(stamp=Time(sec=12, nanosec=345), frame_id='camera')
    message = coded_target_array(found, 'aicon12', (2656, 3984), header, msg)
    # ROS leaves the bytes between fields as they were in memory; written again they are zero.
    store = typestore()
    received = store.deserialize_cdr(serialize_message(message), CODED_TARGETS)
    assert serialized(found) == bytes(store.serialize_cdr(received, CODED_TARGETS))
