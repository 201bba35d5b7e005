"""Messages of what was identified, as the nodes publish them."""

import math
from functools import partial
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')
pytest.importorskip('rosbags', reason='rosbags is not installed')

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from std_msgs.msg import Header
from visualization_msgs.msg import ImageMarker, Marker

from ahf_ros import msg
from ahf_ros.base.target import UNDECODED, Identification, Target
from ahf_ros.clouds.localisation import Positions
from ahf_ros.clouds.point_clouds import COVARIANCE
from ahf_ros.families import create_detector
from ahf_ros.files.target_messages import coded_target_array
from ahf_ros.msg import CodedTarget, CodedTargetArray
from ahf_ros.network.camera import rotation_matrices
from ahf_ros.network.transform import Transform
from ahf_ros.nodes.messages import (
    PosedTarget,
    apriltag_detections,
    detections_message,
    image_message,
    pose_message,
    target_annotations,
    target_detections,
    target_labels,
    target_points,
    target_transform,
    transform_message,
)
from ahf_ros.prints.square import marker
from support.square_readers import april_tag_detector

SEEN = Target(18, 71, 100.0, 50.0, 20.0, 10.0, math.pi / 2, confidence=0.75)
LOST = Target(UNDECODED, 0, 10.0, 20.0, 5.0, 5.0)
GRAY = np.arange(12, dtype=np.uint8).reshape(3, 4)
SCANNER = Header(frame_id='scanner')
CAMERA = Header(frame_id='camera')

FOUND = Positions(
    np.array([(1.0, 2.0, 3.0), (math.nan,) * 3]),
    np.array([0.1, math.nan]),
    np.array([0.5, 0.5]),
    np.array([[(1.0, 2.0, 3.0), (2.0, 4.0, 5.0), (3.0, 5.0, 6.0)], np.full((3, 3), math.nan)]),
)

# vision_msgs is not among the wheels of ROS 2 on PyPI.
FIELDS = {
    'Point2D': 'float64 x\nfloat64 y',
    'Pose2D': 'vision_msgs/Point2D position\nfloat64 theta',
    'BoundingBox2D': 'vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y',
    'BoundingBox3D': 'geometry_msgs/Pose center\ngeometry_msgs/Vector3 size',
    'ObjectHypothesis': 'string class_id\nfloat64 score',
    'ObjectHypothesisWithPose': 'ObjectHypothesis hypothesis\n'
    'geometry_msgs/PoseWithCovariance pose',
    'Detection2D': 'std_msgs/Header header\nObjectHypothesisWithPose[] results\n'
    'BoundingBox2D bbox\nstring id',
    'Detection2DArray': 'std_msgs/Header header\nDetection2D[] detections',
    'Detection3D': 'std_msgs/Header header\nObjectHypothesisWithPose[] results\n'
    'BoundingBox3D bbox\nstring id',
    'Detection3DArray': 'std_msgs/Header header\nDetection3D[] detections',
}


# Nor is apriltag_msgs.
TAGS = {
    'Point': 'float64 x\nfloat64 y',
    'AprilTagDetection': 'string family\nint32 id\nint32 hamming\nfloat32 goodness\n'
    'float32 decision_margin\nPoint centre\nPoint[4] corners\nfloat64[9] homography',
    'AprilTagDetectionArray': 'std_msgs/Header header\nAprilTagDetection[] detections',
}


@pytest.mark.parametrize('image', [GRAY, GRAY.T, np.stack((GRAY, GRAY + 100, GRAY), axis=2)])
def test_a_message_holds_the_image_row_by_row(image: np.ndarray) -> None:
    sent = image_message(image, CAMERA)
    assert sent.header == CAMERA
    assert (sent.height, sent.width) == image.shape[:2]
    assert sent.encoding == ('mono8' if image.ndim == 2 else 'bgr8')
    assert sent.step == sent.width * (1 if image.ndim == 2 else 3)
    assert bytes(sent.data) == image.tobytes()


def answer(*targets: Target) -> CodedTargetArray:
    return coded_target_array(Identification(targets), 'metashape12', (100, 200), SCANNER, msg)


def lines(marker: ImageMarker) -> np.ndarray:
    """Return both ends of the lines of a marker, shape (n, 2, 2)."""
    return np.array([(point.x, point.y) for point in marker.points]).reshape(-1, 2, 2)


def test_a_dot_is_outlined_in_the_coordinates_of_viewers() -> None:
    drawn = lines(target_annotations(answer(LOST)))
    away = np.hypot(*(drawn - (10.5, 20.5)).reshape(-1, 2).T)
    assert away == pytest.approx(np.full(len(away), 5.0))
    assert (drawn[1:, 0] == drawn[:-1, 1]).all()  # closed
    assert drawn[-1, 1] == pytest.approx(drawn[0, 0])


def test_the_ellipse_is_turned() -> None:
    marker = target_annotations(answer(SEEN))
    drawn = lines(marker)
    assert drawn[:, :, 1].max() == pytest.approx(70.5)
    assert drawn[:, :, 0].max() == pytest.approx(110.5)
    assert (marker.header, marker.type) == (SCANNER, ImageMarker.LINE_LIST)
    assert len(marker.outline_colors) == len(drawn)


def test_colours_tell_undecoded_targets() -> None:
    marker = target_annotations(answer(LOST, SEEN))
    first, last = marker.outline_colors[0], marker.outline_colors[-1]
    assert first.r > first.g > first.b
    assert last.g > max(last.r, last.b)


def test_without_targets_there_are_no_lines() -> None:
    marker = target_annotations(answer())
    assert (marker.points, marker.outline_colors) == ([], [])
    assert marker.action == ImageMarker.ADD


def test_points_carry_ids_and_are_nan_where_they_are_not_known() -> None:
    message = target_points(answer(SEEN, LOST).targets, FOUND, SCANNER)
    assert (message.header, message.width, message.is_dense) == (SCANNER, 2, False)
    first, second = np.frombuffer(message.data, 'f4,f4,f4,i4,8f4').tolist()
    assert first[:4] == (1, 2, 3, 18)
    assert first[4].tolist() == pytest.approx([0.75, 0.1, *range(1, 7)])
    assert (second[3], second[4][0]) == (UNDECODED, 1.0)
    assert np.isnan(second[4][1:]).all()
    assert math.isnan(second[0])
    names = ['x', 'y', 'z', 'id', 'confidence', 'deviation', *COVARIANCE]
    assert [field.name for field in message.fields] == names
    assert (message.point_step, message.row_step, len(message.data)) == (48, 96, 96)
    empty = Positions(np.empty((0, 3)), np.empty(0), np.empty(0), np.empty((0, 3, 3)))
    assert target_points((), empty, SCANNER).is_dense


def test_labels_stand_where_positions_are_known() -> None:
    clear, label = target_labels(answer(SEEN, LOST).targets, FOUND, SCANNER).markers
    assert clear.action == Marker.DELETEALL
    place = label.pose.position
    assert (label.text, place.x, place.y, place.z) == ('18', 1.0, 2.0, 3.0)
    assert label.scale.z == 30.0
    assert label.type == Marker.TEXT_VIEW_FACING


@pytest.fixture(scope='module')
def store() -> Any:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in FIELDS.items():
        store.register(get_types_from_msg(text, f'vision_msgs/msg/{name}'))
    for name, text in TAGS.items():
        store.register(get_types_from_msg(text, f'apriltag_msgs/msg/{name}'))
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


def transform(spread: float = 1e-3) -> Transform:
    root = spread * np.random.default_rng(3).normal(size=(6, 6))
    rotation = rotation_matrices(np.array([[0.4, -1.0, 2.0]]))[0]
    return Transform(rotation, np.array([1.0, -2.0, 0.5]), root @ root.T)


def moved(of: Transform, error: np.ndarray) -> Transform:
    """Return a transform with a small error, as its covariance describes it."""
    turn = rotation_matrices(error[None, 3:])[0]
    return Transform(turn @ of.rotation, of.translation + error[:3], of.covariance)


def tag(turn: int, number: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Return an image of a tag turned by so many degrees, and its four corners.

    They are from the bottom left one of the tag as its own library prints it, counter-clockwise.
    """
    print_of_opencv = marker('apriltag_36h11', number, 12)
    low, high = 52 - 0.5, 52 + len(print_of_opencv) - 0.5
    image = np.pad(np.rot90(print_of_opencv, 2), 52, constant_values=255)
    middle = (len(image) - 1) / 2
    matrix = cv2.getRotationMatrix2D((middle, middle), turn, 1.0)
    image = cv2.warpAffine(image, matrix, image.shape, flags=cv2.INTER_AREA, borderValue=255)
    corners = np.array([(low, high, 1), (high, high, 1), (high, low, 1), (low, low, 1)])
    return cv2.GaussianBlur(image, (0, 0), 0.7), corners @ matrix.T


@pytest.mark.parametrize('turn', [0, 75, 200])
def test_corners_are_those_of_the_april_tag_library(turn: int, store: Any) -> None:
    image, corners = tag(turn)
    found = create_detector(family='apriltag_36h11')(image)
    sent = coded_target_array(Identification(tuple(found)), '', image.shape, SCANNER, msg)
    (target,) = sent.targets
    assert target.corners.reshape(4, 2) == pytest.approx(corners, abs=0.05)
    assert (target.hamming, target.decision_margin) == (0.0, pytest.approx(127, abs=2))
    ideal = np.array([(-1, 1, 1), (1, 1, 1), (1, -1, 1), (-1, -1, 1), (0, 0, 1)], float)
    x, y, scale = target.homography.reshape(3, 3) @ ideal.T
    assert np.column_stack((x, y))[:4] / scale[:4, None] == pytest.approx(corners, abs=0.05)
    assert (x[4], y[4]) == pytest.approx((target.x, target.y), abs=1e-6)

    kinds = SimpleNamespace(**{name: store.types[f'apriltag_msgs/msg/{name}'] for name in TAGS})
    array, name = apriltag_detections(sent, kinds), 'apriltag_msgs/msg/AprilTagDetectionArray'
    (detection,) = store.deserialize_cdr(store.serialize_cdr(array, name), name).detections
    assert (detection.family, detection.id, detection.hamming) == ('tag36h11', 5, 0)
    assert [(it.x, it.y) for it in detection.corners] == list(
        map(tuple, target.corners.reshape(4, 2).tolist())
    )
    assert detection.homography.tolist() == target.homography.tolist()

    pytest.importorskip('pupil_apriltags')
    (theirs,) = april_tag_detector().detect(image)
    assert (theirs.tag_id, theirs.hamming) == (5, 0)
    # (0, 0) is a corner of a pixel there, and corners are less exact.
    assert theirs.corners - 0.5 == pytest.approx(corners, abs=0.4)


def test_what_is_no_square_marker_is_no_april_tag(store: Any) -> None:
    kinds = SimpleNamespace(**{name: store.types[f'apriltag_msgs/msg/{name}'] for name in TAGS})
    mixed = answer(SEEN, LOST)
    assert np.isnan([*mixed.targets[0].corners, *mixed.targets[0].homography]).all()
    assert math.isnan(mixed.targets[0].hamming)
    mixed.targets.append(CodedTarget(id=1))  # as a program of others leaves it
    assert apriltag_detections(mixed, kinds).detections == []


def test_targets_in_space_are_detections(store: Any) -> None:
    kinds = {name: partial(store.types[f'vision_msgs/msg/{name}']) for name in FIELDS}
    posed = PosedTarget('aicon12', 17, 0.75, transform())
    message = detections_message([posed], CAMERA, SimpleNamespace(**kinds))
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
    for_tf = transform_message(transform(), CAMERA, 'targets')
    as_pose = pose_message(transform(), CAMERA)
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
