import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from rosbags.interfaces import Connection, MessageDefinition, MessageDefinitionFormat
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ahf_ros.bag.definitions import (
    CODED_TARGETS,
    TypeStores,
    definition_folder,
    message_types,
    typestore,
)
from ahf_ros.base.target import UNDECODED, FilterState, Identification, Target
from ahf_ros.files.target_messages import coded_target_array, identification_from, is_answered

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


def test_an_answer_of_an_older_bag_is_read_by_its_own_definition() -> None:
    """Fields are added at the end, and a bag has the definition that it was written by."""
    added = {'CodedTarget': '\n# Of square markers', 'CodedTargetArray': 'uint8 status'}
    folder, old = definition_folder(), get_typestore(Stores.ROS2_JAZZY)
    for name in ('CodedTarget', 'FilterState', 'CodedTargetArray'):
        text = (folder / f'{name}.msg').read_text().split(added.get(name, '\0'))[0]
        old.register(get_types_from_msg(text, f'ahf_ros/msg/{name}'))
    store, new = typestore(), typestore().deserialize_cdr(serialized(FOUND), CODED_TARGETS)
    fields = {name for name, _ in old.fielddefs[CODED_TARGETS][1]}
    assert fields == {name for name, _ in store.fielddefs[CODED_TARGETS][1]} - {
        *('status', 'reason', 'settled')
    }
    kinds = message_types(old)
    targets = [
        kinds.CodedTarget(
            **{name: getattr(it, name) for name, _ in old.fielddefs['ahf_ros/msg/CodedTarget'][1]}
        )
        for it in new.targets
    ]
    written = kinds.CodedTargetArray(**{it: getattr(new, it) for it in fields - {'targets'}},
                                     targets=targets)  # fmt: skip
    text, _ = old.generate_msgdef(CODED_TARGETS, ros_version=2)
    definition = MessageDefinition(MessageDefinitionFormat.MSG, text)
    topic = Connection(1, '/old', CODED_TARGETS, definition, '', 1, None, None)
    data = bytes(old.serialize_cdr(written, CODED_TARGETS))
    read = TypeStores().deserialize(topic, data)
    assert not hasattr(read, 'status')
    assert is_answered(read)
    assert identification_from(read) == identification_from(new)


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
