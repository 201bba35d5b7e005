"""The node `pose` over real DDS: every message is answered, and what is wrong is said."""

import json
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from ahf_ros.base.target import Target
from ahf_ros.files.camera_info import calibration, undistorted
from ahf_ros.msg import CodedTarget, CodedTargetArray
from ahf_ros.network.camera import project
from ahf_ros.nodes.pose import images_heard
from support.detector import overrides, own, values
from support.poses import CAMERA, SIZE, View, view

EVERY = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)


@cache
def scene() -> View:
    return view(1.0, 0.0, np.random.default_rng(31))


def coordinates(path: Path, of: View) -> Path:
    """Write the coordinates of a scene as JSON in mm."""
    known = of.points
    sigmas = np.sqrt(np.diag(known.covariance)).reshape(-1, 3)
    names = 'x', 'y', 'z', 'sigma_x', 'sigma_y', 'sigma_z'
    rows = (1000 * np.hstack((known.xyz, sigmas))).tolist()
    points = [
        {'id': name, **dict(zip(names, row, strict=True))}
        for name, row in zip(known.names, rows, strict=True)
    ]
    path.write_text(json.dumps({'unit': 'mm', 'points': points}))
    return path


def info(**changes: Any) -> CameraInfo:
    f, cx, cy, k1, k2, k3, p1, p2, *_ = CAMERA.tolist()
    k = [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0]
    p = [f, 0.0, cx, 0.0, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    given = {
        'header': Header(frame_id='camera'),
        'width': SIZE[0],
        'height': SIZE[1],
        'distortion_model': 'plumb_bob',
        'd': [k1, k2, p1, p2, k3],
        'k': k,
        'r': np.eye(3).ravel(),
        'p': p,
    }
    return CameraInfo(**(given | changes))


def seen(of: View, number: int, first_id: int = 0, frame: str = 'camera') -> CodedTargetArray:
    """Return the targets of a scene in an image taken after so many ms."""
    header = Header(stamp=Time(sec=1 + number // 1000, nanosec=number % 1000 * 10**6))
    header.frame_id = frame
    targets = [_target(it, first_id) for it in of.targets]
    return CodedTargetArray(header=header, width=SIZE[0], height=SIZE[1], targets=targets)


@cache
def _target(of: Target, first_id: int) -> CodedTarget:
    return CodedTarget(
        id=of.id + first_id,
        x=of.x,
        y=of.y,
        covariance=of.covariance,
        family='cct12',
        confidence=1.0,
    )


def number_of(message: Any) -> int:
    """Return the number that `seen` was given."""
    return (message.header.stamp.sec - 1) * 1000 + message.header.stamp.nanosec // 10**6


class PoseProcess:
    """The node in a namespace of its own, and what it publishes."""

    def __init__(self, graph: Any, space: str, file: Path, *arguments: str) -> None:
        self.graph = graph
        given = overrides(coordinates=file)
        self.process = graph.start('pose', *own(space), *given, *arguments)
        self.poses = graph.listen(PoseWithCovarianceStamped, f'{space}/pose/pose', EVERY)
        self.diagnostics = graph.listen(DiagnosticArray, f'{space}/diagnostics')
        self.targets = graph.node.create_publisher(
            CodedTargetArray, f'{space}/coded_targets', EVERY
        )
        self.camera = graph.publisher(CameraInfo, f'{space}/camera_info')
        graph.until(self.targets.get_subscription_count)

    def says(self, send: Callable[[], Any], *words: str) -> str:
        """Return the last message of the diagnostics when all words were said, sending on."""
        begin = len(self.diagnostics)

        def said() -> bool:
            send()
            before = len(self.diagnostics)
            self.graph.until(lambda: len(self.diagnostics) > before)
            messages = [it.status[0].message for it in self.diagnostics[begin:]]
            return all(any(text in it for it in messages) for text in words)

        self.graph.until(said)
        return self.diagnostics[-1].status[0].message

    def calibrated(self, of: View) -> None:
        """Send a calibration until the node has it, with images before all others."""
        self.camera.publish(info())
        numbers = count(-1000)  # a stamp that comes twice is remarked

        def posed() -> bool:
            self.targets.publish(seen(of, next(numbers)))
            before = len(self.diagnostics)
            self.graph.until(lambda: self.poses or len(self.diagnostics) > before)
            return bool(self.poses)

        self.graph.until(posed)


@pytest.mark.lasting
def test_no_message_is_lost_at_100_hz_and_poses_are_those_of_the_camera(
    graph: Any, tmp_path: Path
) -> None:
    of = scene()
    node = PoseProcess(graph, '/fast', coordinates(tmp_path / 'points.json', of))
    node.calibrated(of)
    numbers = range(10, 3010, 10)
    for number in numbers:  # faster than 100 Hz: as fast as they are sent
        node.targets.publish(seen(of, number))
    graph.until(lambda: number_of(node.poses[-1]) == numbers[-1])
    assert [number_of(it) for it in node.poses if number_of(it) > 0] == list(numbers)
    before = len(node.diagnostics)
    graph.until(lambda: len(node.diagnostics) > before + 1)
    told = values(node.diagnostics[-1])
    assert (told['lost in transport'], told['targets used']) == ('0', str(len(of.targets)))
    assert told['published'] == str(len(node.poses))
    found = node.poses[-1]
    assert found.header.frame_id == 'targets'
    position = found.pose.pose.position
    covariance = np.reshape(found.pose.covariance, (6, 6))
    gap = np.array([position.x, position.y, position.z]) - of.true.translation
    assert gap @ np.linalg.solve(covariance[:3, :3], gap) < 40
    assert np.linalg.eigvalsh(covariance)[0] > 0
    x, y, z, w = (getattr(found.pose.pose.orientation, it) for it in 'xyzw')
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    assert np.abs(turn - of.true.rotation).max() < 0.01
    status, said = node.process.end()
    # The calibration may come after the first targets.
    assert status == 0
    assert all('no camera_info has come' in line for line in said.splitlines())


@pytest.fixture(scope='module')
def node(graph: Any, tmp_path_factory: pytest.TempPathFactory) -> PoseProcess:
    file = tmp_path_factory.mktemp('coordinates') / 'points.json'
    return PoseProcess(graph, '/wrong', coordinates(file, scene()))


@pytest.fixture(scope='module')
def numbers() -> Iterator[int]:
    """Return numbers of images that come one after the other."""
    return count(1000, 10)


def test_what_is_wrong_is_said_and_nothing_is_published(
    node: PoseProcess, numbers: Iterator[int]
) -> None:
    of = scene()

    def image() -> None:
        node.targets.publish(seen(of, next(numbers)))

    topic = '/wrong/camera_info'
    told = node.says(image, f'images without a pose: no camera_info has come on {topic}')
    assert f'no camera_info: /test publishes on {topic}' in told
    node.camera.publish(info(k=[1e3, 0, 0, 0, 1e3, 0, 0, 0, 1]))
    node.says(image, 'has the principal point 0, 0, accepted')
    assert not node.poses
    node.camera.publish(info())
    node.graph.until(lambda: image() or node.poses)
    unknown: list[int] = []

    def mistakes() -> None:
        unknown.append(next(numbers))
        node.targets.publish(seen(of, unknown[-1], first_id=500))
        swapped = seen(of, next(numbers))
        last = copy(swapped.targets[-1])
        last.id = of.targets[-2].id
        swapped.targets = [*swapped.targets[:-2], last]
        node.targets.publish(swapped)
        node.targets.publish(seen(of, 500))

    node.says(
        mistakes,
        'no target has known coordinates: seen are cct12:501, cct12:502',
        f'{of.targets[-2].id}, wrong ID: the place of target {of.targets[-1].id}',
        'stamps went backwards',
    )
    node.graph.until(lambda: number_of(node.poses[-1]) == 500)
    assert not {number_of(it) for it in node.poses} & set(unknown)


@pytest.mark.lasting
def test_a_fisheye_camera_has_the_pose_that_it_has(graph: Any, tmp_path: Path) -> None:
    """Targets are imaged by the equidistant model; Brown's would be off by many pixels."""
    of = scene()
    lens = np.array([900.0, *CAMERA[1:3], 0.03, -0.01, 0.004, -0.002, 0.0, 0.0, 0.0])
    known = of.points.xyz[of.points.indices([str(it.id) for it in of.targets])]
    places = project(lens, of.true.rotation.T, of.true.translation, known, equidistant=True)
    targets = tuple(
        replace(it, x=x, y=y) for it, (x, y) in zip(of.targets, places.tolist(), strict=True)
    )
    points = coordinates(tmp_path / 'points.json', of)
    node = PoseProcess(graph, '/fisheye', points)
    f, cx, cy, *distortion = lens[:7].tolist()
    k = [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0]
    node.camera.publish(info(distortion_model='equidistant', d=distortion, k=k))
    message = seen(replace(of, targets=targets), 10)
    graph.until(lambda: node.targets.publish(message) or node.poses)
    found = node.poses[-1].pose
    position = [getattr(found.pose.position, it) for it in 'xyz']
    covariance = np.reshape(found.covariance, (6, 6))[:3, :3]
    gap = position - of.true.translation
    assert gap @ np.linalg.solve(covariance, gap) < 16


@pytest.mark.lasting
def test_rectified_images_need_no_k(graph: Any, tmp_path: Path) -> None:
    """As those of an Ensenso, whose k is the identity."""
    of = scene()
    points = coordinates(tmp_path / 'points.json', of)
    node = PoseProcess(graph, '/p', points, *overrides(camera_matrix='p'))
    message = seen(of, 10)
    centres = np.array([(it.x, it.y) for it in message.targets])
    for it, (x, y) in zip(message.targets, undistorted(calibration(info()), centres), strict=True):
        it.x, it.y = x, y
    node.camera.publish(info(d=[], k=np.eye(3).ravel()))
    graph.until(lambda: node.targets.publish(message) or node.poses)
    position = node.poses[-1].pose.pose.position
    found = np.array([position.x, position.y, position.z])
    assert found == pytest.approx(of.true.translation, abs=1e-3)


def test_the_other_matrix_of_camera_info_is_noticed(
    node: PoseProcess, numbers: Iterator[int]
) -> None:
    def image() -> None:
        node.targets.publish(seen(scene(), next(numbers)))

    node.camera.publish(info(d=[], p=[2e3, 0, 1200, 0, 0, 2e3, 1000, 0, 0, 0, 1, 0]))
    node.says(image, 'p or r differ from k, as for rectified images, but camera_matrix is k')
    node.camera.publish(info())
    node.graph.node.create_subscription(Image, '/wrong/image_rect', lambda _: None, 1)
    node.says(image, '/wrong/image_rect seems to be rectified, but camera_matrix is k')


@pytest.mark.lasting
def test_bad_parameters_end_the_node_with_the_reason(graph: Any, tmp_path: Path) -> None:
    file = coordinates(tmp_path / 'points.json', scene())
    status, errors = graph.start('pose', *overrides(coordinates=file, unit='m')).wait()
    assert status == 1
    assert f"unit is 'm', accepted is that of {file}" in errors
    assert len(errors.splitlines()) == 1


@pytest.mark.parametrize('parent', ['camera', 'targets'])
def test_tf_has_one_parent(graph: Any, tmp_path: Path, parent: str) -> None:
    TFMessage = pytest.importorskip('tf2_msgs.msg', reason='tf2_msgs is not installed').TFMessage
    of, space, frame = scene(), f'/tf_{parent}', f'camera_{parent}'
    file = coordinates(tmp_path / 'points.json', of)
    given = overrides(tf=parent, target_frames='true', targets_frame=f'field_{parent}')
    topics = ('-r', f'/tf:={space}/tf', '-r', f'/tf_static:={space}/tf_static')
    node = PoseProcess(graph, space, file, *given, *topics)
    heard = graph.listen(TFMessage, f'{space}/tf', EVERY)
    node.camera.publish(info(header=Header(frame_id=frame)))
    numbers = count(10, 10)

    def image() -> None:
        node.targets.publish(seen(of, next(numbers), frame=frame))

    def transformed() -> bool:
        image()
        before = len(node.diagnostics)
        graph.until(lambda: heard or len(node.diagnostics) > before)
        return bool(heard)

    graph.until(transformed)
    pairs = {(it.header.frame_id, it.child_frame_id) for it in heard[0].transforms}
    frames = {'camera': frame, 'targets': f'field_{parent}'}
    child = 'targets' if parent == 'camera' else 'camera'
    assert (frames[parent], frames[child]) in pairs
    assert {it for it in pairs if ':' in it[1]} == {(frame, f'cct12:{it.id}') for it in of.targets}
    other = TFMessage(transforms=[TransformStamped(child_frame_id=frames[child])])
    other.transforms[0].header.frame_id = 'base'
    static = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    graph.node.create_publisher(TFMessage, f'{space}/tf_static', static).publish(other)
    node.says(image, f"no tf: '{frames[child]}' has the parent 'base' already, accepted is one")


def test_publishers_of_nodes_that_are_not_known_yet_are_passed_over(graph: Any) -> None:
    node = graph.node
    node.create_subscription(Image, 'image', print, 1)
    graph.publisher(Image, 'image')
    (known,) = graph.until(lambda: node.get_publishers_info_by_topic('image'))
    unknown = copy(known)
    unknown.node_name, unknown.node_namespace = '_NODE_NAME_UNKNOWN_', '_NODE_NAMESPACE_UNKNOWN_'
    assert '/image' in graph.until(lambda: images_heard(node, [unknown, known]))
    assert images_heard(node, [unknown]) == ()
