"""Message definitions, for reading and writing bags without ROS."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag1,
    MessageDefinition,
    MessageDefinitionFormat,
)
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

import ahf_ros
from ahf_ros.interchange.target_messages import MessageTypes

CODED_TARGETS = 'ahf_ros/msg/CodedTargetArray'
COMPRESSED_IMAGE = 'sensor_msgs/msg/CompressedImage'
IMAGE = 'sensor_msgs/msg/Image'

LONGEST_DEFINITION = 2**17
"""Characters of a definition of a type that is parsed, which takes seconds."""

_NAMES = ('CodedTarget', 'CodedTargetArray', 'FilterState')
_IDL_SEPARATOR = '=' * 80 + '\n'


def definition_folder() -> Path:
    """Return the folder of the .msg files of this package.

    In the sources it is beside the package; in an installation it is below `share`.

    Raises
    ------
    FileNotFoundError
        If the files are missing.
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
    types = {}
    for name in _NAMES:
        text = (definition_folder() / f'{name}.msg').read_text(encoding='utf-8')
        types.update(get_types_from_msg(text, f'ahf_ros/msg/{name}'))
    store.register(types)
    return store


def message_types(store: Typestore) -> MessageTypes:
    """Return the message classes for `ahf_ros.interchange.target_messages`."""
    classes: Any = {name: store.types[f'ahf_ros/msg/{name}'] for name in _NAMES}
    return SimpleNamespace(**classes)


class TypeStores:
    """Types of recorded messages, from the bag if it defines them, otherwise from ROS 2 Jazzy.

    Each connection has its own types, so a damaged or different definition affects no other.
    """

    def __init__(self) -> None:
        self.default = typestore()
        self._stores: dict[tuple[str, MessageDefinition], Typestore] = {}

    def of(self, item: Connection) -> Typestore:
        """Return the types of a connection.

        Raises
        ------
        ValueError
            If the definition in the bag is invalid or the type is unknown.
        """
        key = (item.msgtype, item.msgdef)
        if key not in self._stores:
            try:
                self._stores[key] = self._defined(item)
            except Exception as error:
                # With bad definitions, the parser may raise anything.
                if item.msgtype in self.default.fielddefs and not _is_ros1(item):
                    return self.default
                raise ValueError(
                    f'{item.topic}: the definition of {item.msgtype} is not accepted: '
                    f'{type(error).__name__}: {error}'
                ) from error
        return self._stores[key]

    def deserialize(self, item: Connection, data: bytes) -> Any:
        """Return a message of a connection.

        Raises
        ------
        ValueError
            If the data do not match their type, or the type is unknown.
        """
        store = self.of(item)
        try:
            if _is_ros1(item):
                return store.deserialize_ros1(data, item.msgtype)
            return store.deserialize_cdr(data, item.msgtype)
        except Exception as error:
            # With damaged data, the generated code may raise anything.
            raise ValueError(
                f'the message is no {item.msgtype}: {type(error).__name__}: {error}'
            ) from error

    def _defined(self, item: Connection) -> Typestore:
        if item.msgdef.format == MessageDefinitionFormat.NONE:
            if item.msgtype not in self.default.fielddefs:
                raise ValueError('neither the bag nor ROS 2 Jazzy defines it')
            return self.default
        store = get_typestore(Stores.EMPTY)
        store.register(_types(item))
        return store


def _is_ros1(item: Connection) -> bool:
    return isinstance(item.ext, ConnectionExtRosbag1)


def _types(item: Connection) -> dict[str, Any]:
    """Return the types in the definition of a connection."""
    text = item.msgdef.data
    if len(text) > LONGEST_DEFINITION:
        raise ValueError(f'it has {len(text)} characters, accepted are {LONGEST_DEFINITION}')
    if item.msgdef.format == MessageDefinitionFormat.MSG:
        return get_types_from_msg(text, item.msgtype)
    if not text.startswith(f'{_IDL_SEPARATOR}IDL: '):
        return get_types_from_idl(text)
    types: dict[str, Any] = {}
    for part in text.split(_IDL_SEPARATOR)[1:]:
        types.update(get_types_from_idl(part.split('\n', 1)[1]))
    return types
