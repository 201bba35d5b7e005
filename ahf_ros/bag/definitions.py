"""Message definitions, for reading and writing bags without ROS."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag1,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

import ahf_ros
from ahf_ros.base.text import reason_of
from ahf_ros.files.target_messages import MessageTypes

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

CODED_TARGETS = 'ahf_ros/msg/CodedTargetArray'
COMPRESSED_IMAGE = 'sensor_msgs/msg/CompressedImage'
IMAGE = 'sensor_msgs/msg/Image'

MAXIMUM_DEFINITION = 2**17
"""Characters of a definition of a type that is parsed, which takes seconds."""

_NAMES = ('CodedTarget', 'CodedTargetArray', 'FilterState')
_IDL_SEPARATOR = '=' * 80 + '\n'
_HEADER = 'std_msgs/msg/Header'
_RENAMED = {'tf/msg/tfMessage': 'tf2_msgs/msg/TFMessage'}  # from ROS 1 to ROS 2
_FOREVER = QosTime(2**31 - 1, 2**32 - 1)
_LATCHED = Qos(
    history=QosHistory.UNKNOWN,
    depth=0,
    reliability=QosReliability.RELIABLE,
    durability=QosDurability.TRANSIENT_LOCAL,
    deadline=_FOREVER,
    lifespan=_FOREVER,
    liveliness=QosLiveliness.AUTOMATIC,
    liveliness_lease_duration=_FOREVER,
    avoid_ros_namespace_conventions=False,
)


def definition_folder() -> Path:
    """Return the folder of the .msg files of this package, which has to have them.

    In the sources it is beside the package; in an installation it is below `share`.
    """
    package = Path(ahf_ros.__file__).resolve().parent
    # The second is for a package in PREFIX/lib/python3.12/site-packages/ahf_ros.
    places = [package.parent / 'msg', *(it / 'share/ahf_ros/msg' for it in package.parents[3:4])]
    for folder in places:
        if all((folder / f'{name}.msg').is_file() for name in _NAMES):
            return folder
    raise FileNotFoundError(f'no .msg files of ahf_ros in {" or ".join(map(str, places))}')


@cache
def typestore() -> Typestore:
    """Return the message types of ROS 2 Jazzy and of this package; nobody adds any."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in _NAMES:
        text = (definition_folder() / f'{name}.msg').read_text(encoding='utf-8')
        store.register(get_types_from_msg(text, f'ahf_ros/msg/{name}'))
    return store


def message_types(store: Typestore) -> MessageTypes:
    """Return the message classes for `ahf_ros.files.target_messages`."""
    classes: Any = {name: store.types[f'ahf_ros/msg/{name}'] for name in _NAMES}
    return SimpleNamespace(**classes)


class TypeStores:
    """Types of recorded messages, from the bag if it defines them, otherwise from ROS 2 Jazzy.

    Each topic has its own types, so a damaged or different definition affects no other.
    """

    def __init__(self) -> None:
        self._stores: dict[tuple[str, MessageDefinition], Typestore] = {}

    def of(self, item: Connection) -> Typestore:
        """Return the types of a topic; an unknown one that is not well defined is a ValueError."""
        key = (item.msgtype, item.msgdef)
        if key not in self._stores:
            try:
                self._stores[key] = _defined(item)
            except Exception as error:
                # With bad definitions, the parser may raise anything.
                if item.msgtype not in typestore().fielddefs:
                    raise ValueError(
                        f'{item.topic}: the definition of {item.msgtype} is not accepted: '
                        f'{reason_of(error)}'
                    ) from error
                self._stores[key] = typestore()
        return self._stores[key]

    def deserialize(self, item: Connection, data: bytes) -> Any:
        """Return a message of a topic; data that do not match their type are a ValueError."""
        store = self.of(item)
        try:
            return store.deserialize_cdr(data, item.msgtype)
        except Exception as error:
            # With damaged data, the generated code may raise anything.
            raise ValueError(f'the message is no {item.msgtype}: {reason_of(error)}') from error


def as_ros2(item: Connection) -> tuple[Connection, Callable[[bytes], bytes]]:
    """Return a topic of ROS 1 as one of ROS 2, and what converts its messages.

    Only the header differs: in ROS 2 it has no number. A definition that is not accepted raises
    anything.
    """
    assert isinstance(item.ext, ConnectionExtRosbag1)
    name = _RENAMED.get(item.msgtype, item.msgtype)
    types = get_types_from_msg(item.msgdef.data, name)
    types[_HEADER] = typestore().fielddefs[_HEADER]
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    text, _ = store.generate_msgdef(name, ros_version=2)
    converted = item._replace(
        msgtype=name,
        msgdef=MessageDefinition(MessageDefinitionFormat.MSG, text),
        digest=store.hash_rihs01(name),
        ext=ConnectionExtRosbag2('cdr', [_LATCHED] if item.ext.latching else []),
    )
    return converted, lambda data: bytes(store.ros1_to_cdr(data, name))


def _defined(item: Connection) -> Typestore:
    """Return the types in the definition of a topic."""
    text = item.msgdef.data
    if len(text) > MAXIMUM_DEFINITION:
        raise ValueError(f'it has {len(text)} characters, accepted are {MAXIMUM_DEFINITION}')
    if item.msgdef.format == MessageDefinitionFormat.NONE:
        raise ValueError('neither the bag nor ROS 2 Jazzy defines it')
    types: dict[str, Any] = {}
    if item.msgdef.format == MessageDefinitionFormat.MSG:
        types = get_types_from_msg(text, item.msgtype)
    elif text.startswith(f'{_IDL_SEPARATOR}IDL: '):
        for part in text.split(_IDL_SEPARATOR)[1:]:
            types.update(get_types_from_idl(part.split('\n', 1)[1]))
    else:
        types = get_types_from_idl(text)
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store
