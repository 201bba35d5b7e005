"""A rig over DDS: a scanner whose cloud belongs to its image, viewers, several cameras."""

import array
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header
from test_nodes import header
from visualization_msgs.msg import ImageMarker, Marker, MarkerArray

from ahf_ros.clouds.point_clouds import COVARIANCE
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.messages import image_message
from ahf_ros.scenes.camera import Camera, tilted_camera
from ahf_ros.scenes.scene import Rendering, SceneSettings, render
from ahf_ros.srv import Identify
from support.detector import DetectorProcess, overrides

SCENE = SceneSettings(width=640, height=480, targets=6, dot_radius=10.0, tilt=30.0, seed=3)
DISTANCE = 800.0  # mm, of the middle of the wall
MAXIMUM_ERROR = 0.2  # mm, of which a tenth of a pixel is most
WITHOUT_POINTS = 5  # place of a target in the truth
CLOUD_FRAME = 'scanner_optical_frame'


def synthetic_camera(scene: SceneSettings) -> Camera:
    """Return the camera that a scene is rendered with."""
    setup = np.random.default_rng(np.random.SeedSequence(scene.seed).spawn(5)[0])
    width, focal_length = scene.width, scene.focal_length * scene.width
    tilt = math.radians(scene.tilt)
    return tilted_camera(width, scene.height, focal_length, tilt, scene.distortion, setup)


def in_space(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """Return the points of the wall that pixels show, in the frame of the camera, mm."""
    wall = np.column_stack((camera.wall(pixels), np.ones(len(pixels))))
    return wall @ camera.pose.T * DISTANCE / camera.intrinsics[0, 0]


def scan(
    rendering: Rendering, camera: Camera, noise: float, without: dict[int, float]
) -> np.ndarray:
    """Return what a scanner measures, mm, shape (height, width, 3).

    There are no points around some targets, by their places in the truth, within so many radii.
    """
    height, width = rendering.image.shape
    rows, columns = np.mgrid[:height, :width]
    pixels = np.column_stack((columns.ravel(), rows.ravel())).astype(float)
    points = in_space(camera, pixels).reshape(height, width, 3)
    points *= 1 + noise / DISTANCE * np.random.default_rng(0).standard_normal((height, width, 1))
    for number, radii in without.items():
        target = rendering.targets[number]
        away = np.hypot(columns - target.x, rows - target.y)
        points[away < radii * target.semi_major] = np.nan
    return points


RENDERING, CAMERA = render(SCENE), synthetic_camera(SCENE)
SCANNED = scan(RENDERING, CAMERA, 0.05, {0: 1.2, WITHOUT_POINTS: 5.0})


def cloud_message(points: np.ndarray, of: Header) -> PointCloud2:
    """Return an organised cloud as drivers send it: x, y, z and a colour."""
    height, width, _ = points.shape
    sent = np.zeros((height, width, 4), np.float32)
    sent[:, :, :3] = points
    return PointCloud2(
        header=Header(stamp=of.stamp, frame_id=CLOUD_FRAME),
        height=height,
        width=width,
        fields=[
            PointField(name=name, offset=4 * number, datatype=PointField.FLOAT32, count=1)
            for number, name in enumerate(('x', 'y', 'z', 'rgb'))
        ],
        point_step=16,
        row_step=16 * width,
        data=array.array('B', sent.tobytes()),
    )


class Rig(DetectorProcess):
    """A detector that is given clouds, and what it says."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph, '/own', *overrides(cloud='true', family=SCENE.family))
        self.points = graph.listen(PointCloud2, '/own/detector/target_points')
        self.cloud = graph.publisher(PointCloud2, '/own/points')

    def count(self, name: str) -> int:
        """Return a number of the diagnostics."""
        return int(self.told(name))

    def found(self, of: Header) -> PointCloud2:
        """Return the positions of an image, once they are there."""
        return self.graph.until(
            lambda: next((it for it in self.points if it.header.stamp == of.stamp), None)
        )

    def send_cloud(self, message: PointCloud2) -> None:
        """Publish a cloud, and return when the node has got it."""
        self.graph.newer(self.diagnostics)
        before = self.count('clouds received')
        self.cloud.publish(message)
        self.graph.until(lambda: self.count('clouds received') > before)


@pytest.fixture(scope='module')
def rig(graph: Any) -> Rig:
    return Rig(graph)


def read(message: PointCloud2) -> np.ndarray:
    """Return the points of a labelled cloud."""
    kinds = {PointField.FLOAT32: '<f4', PointField.INT32: '<i4'}
    return np.frombuffer(
        message.data, [(field.name, kinds[field.datatype]) for field in message.fields]
    )


def assert_true(message: PointCloud2) -> None:
    """Assert that a labelled cloud says where the targets of the rendering are."""
    points = read(message)
    assert points.dtype.names == ('x', 'y', 'z', 'id', 'confidence', 'deviation', *COVARIANCE)
    assert points['id'].tolist() == [target.id for target in RENDERING.targets]
    pixels = np.array([(target.x, target.y) for target in RENDERING.targets])
    true = in_space(CAMERA, pixels)
    errors = np.linalg.norm(np.stack([points[name] for name in 'xyz'], axis=1) - true, axis=1)
    known = np.arange(len(pixels)) != WITHOUT_POINTS
    assert errors[known].max() < MAXIMUM_ERROR
    assert np.isnan(errors[WITHOUT_POINTS])
    assert points['deviation'][known] == pytest.approx(0.05, rel=0.3)
    assert points['confidence'].min() > 0.5
    sigmas = np.sqrt(points['xx'] + points['yy'] + points['zz'])
    assert (errors[known] < 5 * sigmas[known]).all()
    assert sigmas[known].max() < MAXIMUM_ERROR


@pytest.mark.parametrize('cloud_first', [True, False])
def test_every_target_has_its_position_whatever_comes_first(rig: Rig, cloud_first: bool) -> None:
    image = image_message(RENDERING.image, header())
    cloud = cloud_message(SCANNED, image.header)
    if cloud_first:
        rig.send_cloud(cloud)
    answer = rig.answer(image)
    if not cloud_first:
        rig.cloud.publish(cloud)
    message = rig.found(image.header)
    assert message.header == Header(stamp=image.header.stamp, frame_id=CLOUD_FRAME)
    assert (message.height, message.width, message.is_dense) == (1, len(answer.targets), False)
    assert_true(message)
    rig.graph.until(lambda: rig.told('targets with a position') == '5 of 6')


def test_the_service_returns_positions_where_a_cloud_is_given(rig: Rig) -> None:
    image = image_message(RENDERING.image, header())

    def identified(cloud: PointCloud2) -> Identify.Response:
        request = Identify.Request(image=image, cloud=cloud)
        return rig.graph.call(Identify, '/own/detector/identify', request)

    response = identified(cloud_message(SCANNED, image.header))
    assert (response.success, response.message) == (True, '')
    assert response.target_points.header == Header(stamp=image.header.stamp, frame_id=CLOUD_FRAME)
    assert_true(response.target_points)
    assert len(response.coded_targets.targets) == len(RENDERING.targets)
    response = identified(PointCloud2())
    assert (response.success, response.target_points) == (True, PointCloud2())
    response = identified(cloud_message(SCANNED[:, :-1], image.header))
    assert not response.success
    assert response.message.startswith('cloud has 639 x 480 points, accepted is 640 x 480')


def test_what_has_no_partner_is_counted(rig: Rig) -> None:
    names = ('clouds without an image', 'images without a cloud')
    rig.graph.newer(rig.diagnostics)
    before = [rig.count(name) for name in names]
    lonely, of = header(), header()
    rig.send_cloud(cloud_message(SCANNED, lonely))
    rig.answer(image_message(RENDERING.image, header()))
    rig.send_cloud(cloud_message(SCANNED, of))
    rig.answer(image_message(RENDERING.image, of))
    rig.found(of)
    rig.graph.until(lambda: [rig.count(name) for name in names] == [count + 1 for count in before])
    assert not [it for it in rig.points if it.header.stamp == lonely.stamp]


def test_bad_clouds_are_named_and_the_node_goes_on(rig: Rig) -> None:
    rig.graph.newer(rig.diagnostics)
    before = rig.count('clouds rejected')
    flat = cloud_message(SCANNED, header())
    flat.height, flat.width = 1, flat.height * flat.width
    rig.cloud.publish(flat)
    rig.graph.until(lambda: rig.count('clouds rejected') == before + 1)
    reason = rig.told('last reason for rejection of a cloud')
    assert reason.startswith('height is 1, accepted is an integer of at least 2')
    image = image_message(RENDERING.image, header())
    rig.answer(image)
    rig.cloud.publish(cloud_message(SCANNED[:, :-1], image.header))
    rig.graph.until(lambda: rig.count('clouds rejected') == before + 2)
    assert rig.told('last reason for rejection of a cloud') == (
        'cloud has 639 x 480 points, accepted is 640 x 480, the size of the image; for another '
        'one, set cloud_offset_x, cloud_offset_y and cloud_step'
    )
    image = image_message(RENDERING.image, header())
    rig.answer(image)
    rig.cloud.publish(cloud_message(SCANNED, image.header))
    assert_true(rig.found(image.header))


def test_no_cloud_is_lost_in_a_lossless_queue(rig: Rig) -> None:
    with rig.resubscription('image', 'points'):
        assert rig.set(('queue', 'lossless')) == (True, '')
    clouds = rig.graph.publisher(PointCloud2, '/own/points')
    images = rig.graph.publisher(Image, '/own/image')
    before = len(rig.points)
    headers = [header() for _ in range(8)]
    for of in headers:
        clouds.publish(cloud_message(SCANNED, of))
        images.publish(image_message(RENDERING.image, of))
    rig.graph.until(lambda: len(rig.points) == before + len(headers))
    assert [it.header.stamp for it in rig.points[before:]] == [of.stamp for of in headers]
    with rig.resubscription('image', 'points'):
        assert rig.set(('queue', 'latest')) == (True, '')


def test_labels_in_space_for_those_who_look(rig: Rig) -> None:
    labels = rig.graph.listen(MarkerArray, '/own/detector/target_labels')
    image = image_message(RENDERING.image, header())
    rig.cloud.publish(cloud_message(SCANNED, image.header))
    rig.answer(image)
    found = read(rig.found(image.header))
    rig.graph.until(lambda: labels)
    first, *texts = labels[-1].markers
    assert first.action == Marker.DELETEALL
    assert [it.text for it in texts] == [str(it.id) for it in RENDERING.targets[:WITHOUT_POINTS]]
    assert {it.header.frame_id for it in texts} == {CLOUD_FRAME}
    for marker, point in zip(texts, found, strict=False):
        place = marker.pose.position
        assert (place.x, place.y, place.z) == pytest.approx(tuple(point)[:3], abs=1e-3)
        assert 10 < marker.scale.z < 40  # mm; a dot is about 14 mm wide


def test_annotations_of_the_image_for_those_who_look(rig: Rig) -> None:
    annotations = rig.graph.listen(ImageMarker, '/own/detector/annotations')
    image = image_message(RENDERING.image, header())
    rig.image.publish(image)
    # Those of the image before, which the node may still be at, may come first.
    rig.graph.until(lambda: annotations and annotations[-1].header == image.header)
    marker = annotations[-1]
    assert marker.header == image.header
    assert marker.type == ImageMarker.LINE_LIST
    assert len(marker.points) == 2 * len(marker.outline_colors)
    places = np.array([(point.x, point.y) for point in marker.points]) - 0.5
    for target in RENDERING.targets:
        away = np.hypot(*(places - (target.x, target.y)).T)
        assert away.min() == pytest.approx(target.semi_minor, abs=0.3)


def test_without_the_parameter_there_are_no_clouds(rig: Rig) -> None:
    assert rig.set(('cloud', False)) == (True, '')
    rig.graph.until(lambda: not rig.cloud.get_subscription_count())
    count = len(rig.points)
    rig.answer(image_message(RENDERING.image, header()))
    assert len(rig.points) == count
    assert rig.set(('cloud', True)) == (True, '')
    rig.graph.until(rig.cloud.get_subscription_count)
    image = image_message(RENDERING.image, header())
    rig.send_cloud(cloud_message(SCANNED, image.header))
    rig.answer(image)
    assert rig.found(image.header).width == SCENE.targets


@pytest.mark.lasting
def test_cameras_in_namespaces_know_nothing_of_each_other(graph: Any) -> None:
    scenes = {
        'left': render(replace(SCENE, seed=5, tilt=0.0)),
        'right': render(replace(SCENE, seed=6, tilt=0.0)),
    }
    expected = {'left': SCENE.targets, 'right': 0}
    answers, images = {}, {}
    for side in scenes:
        given = overrides(expected_targets=expected[side], family=SCENE.family)
        graph.start('detector', '-r', f'__ns:=/{side}', *given)
        answers[side] = graph.listen(CodedTargetArray, f'/{side}/coded_targets')
        images[side] = graph.publisher(Image, f'/{side}/image')
    sent: dict[str, list[Header]] = {side: [] for side in scenes}
    for _ in range(3):
        for side, scene in scenes.items():
            sent[side].append(header())
            images[side].publish(image_message(scene.image, sent[side][-1]))
        graph.until(lambda: all(len(answers[side]) == len(sent[side]) for side in scenes))
    for side, scene in scenes.items():
        assert [answer.header for answer in answers[side]] == sent[side]
        for answer in answers[side]:
            assert [it.id for it in answer.targets] == [it.id for it in scene.targets]
            assert answer.expected == expected[side]
