"""Why nothing arrives, in words."""

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rclpy.qos import QoSProfile, ReliabilityPolicy

from ahf_ros.nodes.watch import other_types, silence

IMAGE, COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
WEAK = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def source(profile: QoSProfile) -> Any:
    name = '/rig/image'
    return SimpleNamespace(
        type_name=IMAGE, topic='image', name=name, profile=profile, overrides='qos'
    )


def publisher(kind: str, profile: QoSProfile) -> Any:
    return SimpleNamespace(
        topic_type=kind, qos_profile=profile, node_name='driver', node_namespace='/rig'
    )


def test_images_in_another_form_are_named() -> None:
    topics = {'/rig/image/compressed': [COMPRESSED], '/rig/text': ['std_msgs/msg/String']}
    assert silence(source(QoSProfile(depth=1)), [], lambda: topics) == (
        'nobody publishes sensor_msgs/msg/Image on /rig/image; sensor_msgs/msg/CompressedImage is '
        'published on /rig/image/compressed: set image_transport to compressed'
    )


def test_images_that_may_be_too_large_for_best_effort_are_named() -> None:
    text = silence(source(WEAK), [publisher(IMAGE, WEAK)], dict)
    assert text.startswith('/rig/driver publishes on /rig/image, but nothing arrives: large mess')
    assert 'config/fastdds_shm.xml' in text


def test_other_types_are_named() -> None:
    of = source(WEAK)
    assert other_types(of, [publisher(IMAGE, WEAK)]) == ''
    found = other_types(of, [publisher(IMAGE, WEAK), publisher(COMPRESSED, WEAK)])
    assert found == f'/rig/image is of type {COMPRESSED}, accepted is {IMAGE}'


def test_the_nearest_names_come_first() -> None:
    others = ['/zivid/color', '/rig/image_raw', '/other/image', '/rig/image_rect', '/points']
    text = silence(source(WEAK), [], lambda: {it: [IMAGE] for it in others})
    assert 'published on /rig/image_raw, /rig/image_rect, /other/image: remap' in text
