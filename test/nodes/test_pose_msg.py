from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')
pytest.importorskip('rosbags', reason='rosbags is not installed')

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from std_msgs.msg import Header

from ahf_ros.nodes.messages import (
    PosedTarget,
    detections_message,
    pose_message,
    target_transform,
    transform_message,
)
from ahf_ros.nodes.settings import PoseNodeSettings
from ahf_ros.nodes.tf import Parents
from ahf_ros.orientation.camera import rotation_matrices
from ahf_ros.orientation.transform import Transform

# vision_msgs is not among the wheels of ROS 2 on PyPI.
FIELDS = {
    'BoundingBox3D': 'geometry_msgs/Pose center\ngeometry_msgs/Vector3 size',
    'ObjectHypothesis': 'string class_id\nfloat64 score',
    'ObjectHypothesisWithPose': 'ObjectHypothesis hypothesis\n'
    'geometry_msgs/PoseWithCovariance pose',
    'Detection3D': 'std_msgs/Header header\nObjectHypothesisWithPose[] results\n'
    'BoundingBox3D bbox\nstring id',
    'Detection3DArray': 'std_msgs/Header header\nDetection3D[] detections',
}
HEADER = Header(frame_id='camera')


def transform(spread: float = 1e-3) -> Transform:
    root = spread * np.random.default_rng(3).normal(size=(6, 6))
    rotation = rotation_matrices(np.array([[0.4, -1.0, 2.0]]))[0]
    return Transform(rotation, np.array([1.0, -2.0, 0.5]), root @ root.T)


def moved(of: Transform, error: np.ndarray) -> Transform:
    """Return a transform with a small error, as its covariance describes it."""
    turn = rotation_matrices(error[None, 3:])[0]
    return Transform(turn @ of.rotation, of.translation + error[:3], of.covariance)


def test_targets_in_space_are_detections() -> None:
    store: Any = get_typestore(Stores.ROS2_JAZZY)
    for name, text in FIELDS.items():
        store.register(get_types_from_msg(text, f'vision_msgs/msg/{name}'))
    kinds = {name: partial(store.types[f'vision_msgs/msg/{name}']) for name in FIELDS}
    posed = PosedTarget('aicon12', 17, 0.75, transform())
    message = detections_message([posed], HEADER, SimpleNamespace(**kinds))
    name = 'vision_msgs/msg/Detection3DArray'
    sent = store.deserialize_cdr(store.serialize_cdr(message, name), name)
    (detection,) = sent.detections
    assert (sent.header.frame_id, detection.header.frame_id) == ('camera', 'camera')
    (result,) = detection.results
    assert (detection.id, result.hypothesis.class_id) == ('17', 'aicon12')
    assert result.hypothesis.score == 0.75
    assert (result.pose.pose.position.x, detection.bbox.center.position.y) == (1.0, -2.0)
    assert np.allclose(result.pose.covariance.reshape(6, 6), transform().covariance)


def test_a_transform_for_tf_is_the_pose_of_the_child() -> None:
    for_tf = transform_message(transform(), HEADER, 'targets')
    as_pose = pose_message(transform(), HEADER)
    assert (for_tf.header.frame_id, for_tf.child_frame_id) == ('camera', 'targets')
    assert for_tf.transform.rotation == as_pose.pose.pose.orientation
    assert for_tf.transform.translation.z == as_pose.pose.pose.position.z == 0.5
    assert as_pose.pose.covariance.tolist() == transform().covariance.ravel().tolist()


def test_errors_of_a_pose_are_those_of_its_targets() -> None:
    """By differences: the first-order errors of a target's place and axes in the camera."""
    xyz, own = np.array([0.3, 0.1, -0.2]), np.diag([1e-6, 4e-6, 9e-6])
    of, step = transform(), 1e-6
    start = target_transform(of, xyz, 0 * own)
    by_error = np.zeros((6, 6))
    for index, error in enumerate(step * np.eye(6)):
        other = target_transform(moved(of, error), xyz, 0 * own)
        turned = other.rotation @ start.rotation.T
        by_error[:3, index] = (other.translation - start.translation) / step
        by_error[3:, index] = turned[[2, 0, 1], [1, 2, 0]] / step
    expected = by_error @ of.covariance @ by_error.T
    assert np.allclose(start.covariance, expected, rtol=1e-4, atol=1e-10)
    with_own = target_transform(of, xyz, own)
    added = with_own.covariance - start.covariance
    assert np.allclose(added[:3, :3], of.rotation.T @ own @ of.rotation)
    assert np.allclose(start.translation, of.rotation.T @ (xyz - of.translation))


@pytest.mark.parametrize(
    ('parent', 'child', 'words'),
    [
        ('camera', 'targets', ''),
        ('targets', 'camera', "'camera' has the parent 'link' already, accepted is one parent"),
        ('link', 'camera', ''),
        ('camera', 'map', "'map' is an ancestor of 'camera' already, accepted is no loop"),
        ('camera', 'camera', "'camera' is the frame of both camera and targets, accepted are two"),
        ('', 'targets', 'the images have no frame_id, accepted is the frame of the camera'),
    ],
)
def test_a_frame_has_one_parent_and_no_loop(parent: str, child: str, words: str) -> None:
    parents = Parents()
    for above, below in (('map', 'base'), ('/base', 'link'), ('link', '/camera')):
        parents.add(above, below)
    refusal = parents.refusal(parent, child)
    assert refusal.startswith(words)
    assert bool(refusal) == bool(words)


def test_what_is_published_needs_its_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('ahf_ros.nodes.settings.find_spec', lambda name: None)
    with pytest.raises(ValueError, match='detections is True and the package vision_msgs is not'):
        PoseNodeSettings(coordinates='a', detections=True)
    with pytest.raises(ValueError, match="tf is 'targets' and the package tf2_msgs is not there"):
        PoseNodeSettings(coordinates='a', tf='targets')
    assert PoseNodeSettings(coordinates='a').tf == 'none'


@pytest.mark.parametrize(
    ('given', 'words'),
    [
        (
            {'coordinates': ''},
            "coordinates is '', accepted is a folder of ahf orient",
        ),
        ({'targets_frame': '/map'}, "targets_frame is '/map', accepted is a name without spaces"),
        ({'targets_frame': 'a b'}, "targets_frame is 'a b', accepted is a name without spaces"),
        ({'tf': 'map'}, "tf is 'map', accepted is one of none, camera, targets"),
        ({'camera_matrix': 'd'}, "camera_matrix is 'd', accepted is one of k, p"),
        ({'unit': 'px'}, "unit is 'px', accepted is one of m, dm, cm, mm, um, µm, in, ft, or"),
    ],
)
def test_settings_name_what_is_accepted(given: dict[str, str], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        PoseNodeSettings(**({'coordinates': 'a'} | given))
