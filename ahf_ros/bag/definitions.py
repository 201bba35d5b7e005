"""The messages of this package, for reading and writing bags without ROS."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

import ahf_ros
from ahf_ros.interchange.target_messages import MessageTypes

CODED_TARGETS = 'ahf_ros/msg/CodedTargetArray'
COMPRESSED_IMAGE = 'sensor_msgs/msg/CompressedImage'
IMAGE = 'sensor_msgs/msg/Image'

_NAMES = ('CodedTarget', 'CodedTargetArray', 'FilterState')


def definition_folder() -> Path:
    """Return the folder of the files *.msg of this package.

    They lie beside the modules in the sources, and in `share` where the package is installed.

    Raises
    ------
    FileNotFoundError
        If the installation lacks them.
    """
    package = Path(ahf_ros.__file__).resolve().parent
    # The second is as in PREFIX/lib/python3.12/site-packages/ahf_ros.
    places = [package.parent / 'msg', *(it / 'share/ahf_ros/msg' for it in package.parents[3:4])]
    for folder in places:
        if all((folder / f'{name}.msg').is_file() for name in _NAMES):
            return folder
    raise FileNotFoundError(f'the messages of ahf_ros are not in {" or ".join(map(str, places))}')


def typestore() -> Typestore:
    """Return the messages of ROS 2 Jazzy and of this package."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = {}
    for name in _NAMES:
        text = (definition_folder() / f'{name}.msg').read_text(encoding='utf-8')
        types.update(get_types_from_msg(text, f'ahf_ros/msg/{name}'))
    store.register(types)
    return store


def message_types(store: Typestore) -> MessageTypes:
    """Return the classes that `ahf_ros.interchange.target_messages` makes messages of."""
    classes: Any = {name: store.types[f'ahf_ros/msg/{name}'] for name in _NAMES}
    return SimpleNamespace(**classes)
