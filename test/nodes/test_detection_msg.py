from __future__ import annotations

import importlib.util
import math
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')
pytest.importorskip('rosbags', reason='rosbags is not installed')

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from std_msgs.msg import Header

from ahf_ros.msg import CodedTarget, CodedTargetArray
from ahf_ros.nodes import settings
from ahf_ros.nodes.messages import target_detections
from ahf_ros.nodes.settings import AnswerSettings

# vision_msgs is not among the wheels of ROS 2 on PyPI.
FIELDS = {
    'Point2D': 'float64 x\nfloat64 y',
    'Pose2D': 'vision_msgs/Point2D position\nfloat64 theta',
    'BoundingBox2D': 'vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y',
    'ObjectHypothesis': 'string class_id\nfloat64 score',
    'ObjectHypothesisWithPose': 'ObjectHypothesis hypothesis\n'
    'geometry_msgs/PoseWithCovariance pose',
    'Detection2D': 'std_msgs/Header header\nObjectHypothesisWithPose[] results\n'
    'BoundingBox2D bbox\nstring id',
    'Detection2DArray': 'std_msgs/Header header\nDetection2D[] detections',
}


@pytest.fixture(scope='module')
def store() -> Any:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in FIELDS.items():
        store.register(get_types_from_msg(text, f'vision_msgs/msg/{name}'))
    return store


@pytest.fixture(scope='module')
def types(store: Any) -> SimpleNamespace:
    """Return the classes of messages, which have defaults as those of ROS have."""
    kinds = {name: store.types[f'vision_msgs/msg/{name}'] for name in FIELDS}
    geometry = {name: store.types[f'geometry_msgs/msg/{name}'] for name in (
        'Point', 'Pose', 'PoseWithCovariance', 'Quaternion')}  # fmt: skip
    at = geometry['Pose'](geometry['Point'](0, 0, 0), geometry['Quaternion'](0, 0, 0, 1))
    pose = geometry['PoseWithCovariance'](at, np.zeros(36))
    for name, given in (
        ('Detection2D', {'results': [], 'id': ''}),
        ('ObjectHypothesisWithPose', {'pose': pose}),
    ):
        kinds[name] = partial(kinds[name], **given)
    return SimpleNamespace(**kinds)


def test_targets_are_detections(store: Any, types: SimpleNamespace) -> None:
    header = Header(frame_id='camera')
    header.stamp.sec = 7
    answer = CodedTargetArray(header=header, width=640, height=480)
    answer.targets = [
        CodedTarget(id=CodedTarget.UNDECODED, x=5.0, y=6.0, semi_major=4.0, semi_minor=3.0),
        CodedTarget(id=17, x=100.25, y=50.5, semi_major=8.0, semi_minor=6.0, angle=0.5,
                    confidence=0.75, family='aicon12'),
    ]  # fmt: skip
    message = target_detections(answer, types)
    name = 'vision_msgs/msg/Detection2DArray'
    sent = store.deserialize_cdr(store.serialize_cdr(message, name), name)
    assert (sent.header.stamp.sec, sent.header.frame_id) == (7, 'camera')
    undecoded, decoded = sent.detections
    assert (undecoded.id, undecoded.results) == ('', [])
    assert decoded.header.frame_id == 'camera'
    assert (decoded.id, decoded.results[0].hypothesis.class_id) == ('17', 'aicon12')
    assert decoded.results[0].hypothesis.score == 0.75
    box = decoded.bbox
    assert (box.center.position.x, box.center.position.y) == (100.25, 50.5)
    assert math.isclose(box.center.theta, 0.5)
    assert (box.size_x, box.size_y) == (16, 12)


def test_detections_need_vision_msgs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, 'find_spec', lambda name: None)
    with pytest.raises(ValueError, match='the package vision_msgs is not there, accepted without'):
        AnswerSettings(detections=True)
    assert not AnswerSettings(detections=False).detections
    monkeypatch.setattr(settings, 'find_spec', importlib.util.find_spec)
