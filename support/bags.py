"""Bags for the tests, written by rosbags."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from ahf_ros.bag.definitions import CODED_TARGETS, COMPRESSED_IMAGE, IMAGE, typestore
from ahf_ros.bag.registration import POINT_CLOUD
from ahf_ros.scenes.scene import SceneSettings, render

STRING = 'std_msgs/msg/String'
SCENE: dict[str, Any] = {
    'width': 400,
    'height': 300,
    'targets': 4,
    'dot_radius': 10.0,
    'light': 'stripe',
}

Recorded = tuple[str, str, int, Any]
"""Topic, type, time in ns, message."""


def scenes(count: int, **changes: Any) -> list[np.ndarray]:
    """Return images, the seed grows by one with each."""
    return [render(SceneSettings(**(SCENE | changes), seed=seed)).image for seed in range(count)]


def moving(count: int) -> list[np.ndarray]:
    """Return images of a wall that a camera passes, which show the same targets."""
    scene = SceneSettings(**(SCENE | {'width': 520, 'height': 400, 'targets': 6}), ambient=0.5)
    wall, generator = render(scene).image, np.random.default_rng(5)
    shown = (wall[40 + it : 360 + it, 40 + 2 * it : 480 + 2 * it] for it in range(count))
    noisy = (it + generator.normal(0.0, 1.5, it.shape) for it in shown)
    return [np.clip(np.rint(it), 0, 255).astype(np.uint8) for it in noisy]


def header(store: Typestore, time: int) -> Any:
    """Return the header of an image."""
    second, nanosecond = divmod(time, 10**9)
    stamp = store.types['builtin_interfaces/msg/Time'](sec=second, nanosec=nanosecond)
    more = {'seq': 0} if 'rosgraph_msgs/msg/Log' in store.fielddefs and _is_ros1(store) else {}
    return store.types['std_msgs/msg/Header'](**more, stamp=stamp, frame_id='camera')


def image(store: Typestore, pixels: np.ndarray, time: int, **changes: Any) -> Any:
    """Return the message of an image, 1 ms older than the time at which it is recorded."""
    height, width = pixels.shape
    fields: dict[str, Any] = {
        'header': header(store, time - 10**6),
        'height': height,
        'width': width,
        'encoding': 'mono8',
        'is_bigendian': 0,
        'step': width,
        'data': pixels.ravel(),
    }
    return store.types[IMAGE](**(fields | changes))


def compressed(store: Typestore, pixels: np.ndarray, time: int) -> Any:
    """Return the message of an image as PNG."""
    data = cv2.imencode('.png', pixels)[1].ravel()
    return store.types[COMPRESSED_IMAGE](header=header(store, time), format='png', data=data)


def text(store: Typestore, words: str) -> Any:
    """Return a message that is no image."""
    return store.types[STRING](data=words)


def recorded(store: Typestore, images: list[np.ndarray], topic: str = '/image') -> list[Recorded]:
    """Return images, ten a second, and a text before each."""
    messages: list[Recorded] = []
    for number, pixels in enumerate(images):
        time = (1 + number) * 10**8
        messages.append(('/notes', STRING, time - 5, text(store, f'image {number}')))
        messages.append((topic, IMAGE, time, image(store, pixels, time)))
    return messages


def write_ros2(path: Path, messages: list[Recorded], storage: str = 'mcap') -> Path:
    """Write a bag of ROS 2."""
    store = typestore()
    plugin = rosbag2.StoragePlugin[storage.upper()]
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        _write(writer, messages, store, store.serialize_cdr)
    return path


def write_raw(path: Path, messages: list[tuple[str, str, int, bytes]]) -> Path:
    """Write a bag of ROS 2 from serialised messages: topic, type, time in ns, and bytes."""
    with rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        _write(writer, messages, typestore(), lambda message, _: message)
    return path


def write_ros1(path: Path, messages: list[Recorded]) -> Path:
    """Write a bag of ROS 1."""
    store = ros1()
    with rosbag1.Writer(path) as writer:
        _write(writer, messages, store, store.serialize_ros1)
    return path


def ros1() -> Typestore:
    """Return the messages of ROS 1."""
    return get_typestore(Stores.ROS1_NOETIC)


def _is_ros1(store: Typestore) -> bool:
    return 'seq' in dict(store.fielddefs['std_msgs/msg/Header'][1])


def _write(writer: Any, messages: list[Recorded], store: Typestore, serialize: Any) -> None:
    connections: dict[str, Any] = {}
    for topic, kind, time, message in messages:
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=store)
        writer.write(connections[topic], time, bytes(serialize(message, kind)))


def read(path: Path) -> list[tuple[str, int, bytes]]:
    """Return all messages of a bag of ROS 2 as they were recorded."""
    with rosbag2.Reader(path) as reader:
        return [(it.topic, time, bytes(data)) for it, time, data in reader.messages()]


def answers(path: Path, topic: str = '/image/coded_targets') -> list[tuple[int, Any]]:
    """Return the coded targets in a bag, with the times."""
    with AnyReader([path]) as reader:
        wanted = [it for it in reader.connections if it.topic == topic]
        assert [it.msgtype for it in wanted] == [CODED_TARGETS]
        return [
            (time, reader.deserialize(raw, it.msgtype))
            for it, time, raw in reader.messages(wanted)
        ]


def cloud(store: Typestore, points: np.ndarray, time: int, **changes: Any) -> Any:
    """Return the message of an organised cloud with fields, as old as the image of its time."""
    height, width = points.shape
    of = header(store, time - 10**6)
    of.frame_id = 'scanner'
    field = store.types['sensor_msgs/msg/PointField']
    fields: dict[str, Any] = {
        'header': of,
        'height': height,
        'width': width,
        'fields': [
            field(name=name, offset=offset, datatype=7, count=1)
            for name, (_, offset, *_) in (points.dtype.fields or {}).items()
        ],
        'is_bigendian': False,
        'point_step': points.itemsize,
        'row_step': width * points.itemsize,
        'data': np.frombuffer(points.tobytes(), np.uint8),
        'is_dense': False,
    }
    return store.types[POINT_CLOUD](**(fields | changes))
