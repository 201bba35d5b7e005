"""The node `registration` over DDS: scans of an object from all around."""

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from test_nodes import header

from ahf_ros.clouds.point_clouds import COVARIANCE, TARGET_POINT, target_scan, whole_points
from ahf_ros.clouds.registration.scan import Scan
from ahf_ros.files.cloud_files import read_cloud
from ahf_ros.network.camera import rotation_matrices
from ahf_ros.network.files.coordinate_files import read_coordinates
from ahf_ros.network.transform import Transform, rotation_vector
from ahf_ros.nodes.messages import cloud_message
from support.detector import overrides, own, values
from support.scans import measured, ring, squared_error, station

COUNT, COMMON = 6, 5
SIGMA = 20e-6  # m
GROUPS = ring(COUNT, COMMON, np.random.default_rng(1))


def scan(number: int, seed: int = 0) -> Scan:
    """Return the scan of a station, which shares targets with both neighbours."""
    groups = [(number - 1) % COUNT, number % COUNT]
    names = [str(10 * group + it) for group in groups for it in range(COMMON)]
    points = GROUPS[groups].reshape(-1, 3)
    random = np.random.default_rng((seed, number))
    return measured(names, points, station(number, COUNT), SIGMA, random)


def target_points(of: Header, shown: Scan, factor: float = 1.0) -> PointCloud2:
    """Return a scan as the detector publishes it, with a target without an ID."""
    points = np.zeros(len(shown.names) + 1, TARGET_POINT)
    points['id'] = [*map(int, shown.names), -1]
    for axis, name in enumerate('xyz'):
        points[name][:-1] = factor * shown.points[:, axis]
    points['confidence'] = 1
    rows, columns = np.triu_indices(3)
    for name, row, column in zip(COVARIANCE, rows, columns, strict=True):
        points[name][:-1] = factor**2 * shown.covariances[:, row, column]
    return cloud_message(points[None], Header(stamp=of.stamp, frame_id='scanner'))


def organised(of: Header, frame: str = 'scanner') -> PointCloud2:
    """Return a cloud of 3 x 4 points, two of which are missing."""
    cloud = np.zeros((3, 4), [('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('rgb', '<u4')])
    cloud['x'], cloud['y'] = np.meshgrid(np.arange(4) / 10, np.arange(3) / 10)
    cloud['z'], cloud['rgb'] = 1.0, 0xFF8000
    cloud['z'][1, 2] = np.nan
    for name in 'xyz':
        cloud[name][0, 1] = 0
    return cloud_message(cloud, Header(stamp=of.stamp, frame_id=frame))


class Registrar:
    """The node `registration` in a namespace of its own, and what it says."""

    def __init__(
        self, graph: Any, namespace: str, *arguments: str, tf: str = 'false', **settings: Any
    ) -> None:
        self.graph, self.namespace = graph, namespace
        given = overrides(tf=tf, **settings)
        self.process = graph.start('registration', *own(namespace), *arguments, *given)
        self.poses = graph.listen(PoseWithCovarianceStamped, f'{namespace}/registration/transform')
        self.residuals = graph.listen(PointCloud2, f'{namespace}/registration/residuals')
        self.targets = graph.listen(PointCloud2, f'{namespace}/registration/targets')
        self.diagnostics = graph.listen(DiagnosticArray, f'{namespace}/diagnostics')
        self.scans = graph.publisher(PointCloud2, f'{namespace}/target_points')

    def told(self, name: str) -> str:
        return values(self.diagnostics[-1])[name] if self.diagnostics else ''

    def send(self, message: PointCloud2) -> PoseWithCovarianceStamped:
        """Return the pose of a scan, once it is registered."""
        count = len(self.poses)
        self.scans.publish(message)
        self.graph.until(lambda: len(self.poses) > count and len(self.residuals) > count)
        return self.poses[-1]

    def refused(self, message: PointCloud2) -> str:
        """Return why a scan is refused."""
        count = len(self.poses)
        self.graph.until(lambda: self.diagnostics)
        before = int(self.told('scans refused'))
        self.scans.publish(message)
        self.graph.until(lambda: int(self.told('scans refused')) == before + 1)
        assert len(self.poses) == count
        status = self.diagnostics[-1].status[0]
        assert status.level == DiagnosticStatus.WARN
        assert self.told('last reason for refusal') in status.message
        return self.told('last reason for refusal')

    def call(self, name: str) -> tuple[bool, str]:
        service = f'{self.namespace}/registration/{name}'
        response = self.graph.call(Trigger, service, Trigger.Request())
        return response.success, response.message


def transform_of(message: PoseWithCovarianceStamped) -> Transform:
    turn, place = message.pose.pose.orientation, message.pose.pose.position
    vector = rotation_vector(np.array([turn.x, turn.y, turn.z, turn.w]))
    rotation = rotation_matrices(vector[None])[0]
    covariance = message.pose.covariance.reshape(6, 6)
    return Transform(rotation, np.array([place.x, place.y, place.z]), covariance)


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp('saved')


@pytest.fixture(scope='module')
def node(graph: Any, folder: Path) -> Registrar:
    made = Registrar(graph, '/scans', cloud='true', folder=folder)
    made.clouds = graph.listen(PointCloud2, '/scans/registration/cloud')
    made.cloud = graph.publisher(PointCloud2, '/scans/points')
    return made


def test_a_chain_is_registered_adjusted_undone_and_saved(node: Registrar, folder: Path) -> None:
    """One session from the first scan to the files."""
    first = header()
    pose = node.send(target_points(first, scan(0)))
    assert pose.header == Header(stamp=first.stamp, frame_id='registered')
    assert transform_of(pose).rotation == pytest.approx(np.eye(3))
    for number in range(1, COUNT):
        stamp = header()
        cloud = organised(stamp)
        node.cloud.publish(cloud)
        found = transform_of(node.send(target_points(stamp, scan(number))))
        true = station(0, COUNT).inverse @ station(number, COUNT)
        assert squared_error(found, true) < 40  # of 6, whose chi-square rarely exceeds 30
        node.graph.until(lambda number=number: len(node.clouds) == number)
        moved, sent = whole_points(node.clouds[-1]), whole_points(cloud)
        assert node.clouds[-1].header == Header(stamp=stamp.stamp, frame_id='registered')
        xyz, given = (np.stack([it[name] for name in 'xyz'], axis=-1) for it in (moved, sent))
        missing = np.isnan(xyz).all(axis=-1)
        assert np.argwhere(missing).tolist() == [[0, 1], [1, 2]]
        assert xyz[~missing] == pytest.approx(found.moved(given[~missing].astype(float)), abs=1e-5)
        assert (moved['rgb'] == sent['rgb']).all()
    residuals = whole_points(node.residuals[-1])[0]
    assert residuals['id'].size == 2 * COMMON  # of both neighbours
    assert residuals['length'].max() < 1e-3
    assert whole_points(node.targets[-1]).size == COUNT * COMMON

    count = len(node.poses)
    done, text = node.call('adjust')
    assert done, text
    assert text.startswith('6 scans and 30 targets adjusted, sigma0 ')
    node.graph.until(lambda: len(node.poses) == count + COUNT)
    after = transform_of(node.poses[-1])
    far, before = (transform_of(node.poses[it]) for it in (count + 3, count - 3))
    assert np.trace(far.covariance) < np.trace(before.covariance)
    assert node.call('undo') == (True, 'the adjustment is taken back; 6 scans registered')
    assert node.call('adjust')[0]

    done, text = node.call('save')
    assert done, text
    assert text == f'6 scans in 13 files in {folder.resolve()}'
    saved = json.loads((folder / 'transforms.json').read_text())
    assert [it['name'] for it in saved['scans']] == [f'scan_{it}' for it in range(1, COUNT + 1)]
    assert saved['scans'][-1]['translation'] == pytest.approx(after.translation.tolist())
    for suffix in ('.ply', '.pcd'):
        read = read_cloud(folder / f'scan_{COUNT}{suffix}')
        assert read.shape == (3, 4)
        assert np.isnan(read['x']).sum() == 2
    known = read_coordinates(folder / 'targets.csv')
    assert len(known.names) == COUNT * COMMON
    assert len((folder / 'transforms.csv').read_text().splitlines()) == COUNT + 1

    assert node.call('undo')[0]
    assert node.call('undo') == (True, 'scan_6 is taken back; 5 scans registered')
    assert node.call('reset') == (True, '5 scans forgotten')
    assert node.call('undo') == (False, 'nothing is registered, so that there is nothing to undo')
    node.graph.until(lambda: node.told('scans registered') == '0')


def test_scans_that_do_not_fit_are_refused_and_the_node_goes_on(node: Registrar) -> None:
    assert node.call('reset')[0]
    node.send(target_points(header(), scan(0)))
    early, good = header(), scan(1)
    node.send(target_points(header(), good))
    assert node.refused(target_points(early, good)).startswith('stamp is ')
    moved = scan(2)
    moved.points[1] += 0.01
    text = node.refused(target_points(header(), moved))
    assert text.startswith('target 11 moved by 0.0')
    nothing = target_points(header(), scan(2))
    nothing.fields = nothing.fields[:6]
    text = node.refused(nothing)
    assert text.startswith('target points have no xx, xy, xz, yy, yz, zz, accepted are those')
    node.send(target_points(header(), scan(2)))


def test_bad_clouds_are_refused_and_their_scans_are_not(node: Registrar) -> None:
    assert node.call('reset')[0]
    flat, other = header(), header()
    bad = organised(flat)
    bad.height, bad.width, bad.row_step = 1, 12, 12 * bad.point_step
    clouds = len(node.clouds)
    for number, (of, cloud, words) in enumerate(
        (
            (flat, bad, 'height is 1, accepted is an integer of at least 2'),
            (other, organised(other, 'elsewhere'), "frame_id is 'elsewhere', accepted is that"),
        )
    ):
        node.cloud.publish(cloud)
        node.send(target_points(of, scan(number)))
        node.graph.until(
            lambda words=words: node.told('last reason for refusal of a cloud').startswith(words)
        )
    stamp = header()
    empty = organised(stamp)
    empty.data[:] = empty.data.__class__('B', b'\xff' * len(empty.data))  # nothing but NaN
    node.cloud.publish(empty)
    node.send(target_points(stamp, scan(2)))
    node.graph.until(lambda: len(node.clouds) == clouds + 1)
    assert np.isnan(whole_points(node.clouds[-1])['x']).all()


@pytest.mark.lasting
def test_known_coordinates_give_the_frame(graph: Any, tmp_path: Path) -> None:
    rows = [
        f'{10 * group + it},{",".join(f"{1000 * value:.6f}" for value in point)}'
        for group, points in enumerate(GROUPS)
        for it, point in enumerate(points)
    ]
    path = tmp_path / 'known.csv'
    path.write_text('\n'.join(['id,x,y,z', *rows]))
    node = Registrar(graph, '/known', coordinates=path, unit='mm', frame='object', tf='true')
    pose = node.send(target_points(header(), scan(3)))
    assert pose.header.frame_id == 'object'
    assert squared_error(transform_of(pose), station(3, COUNT)) < 40
    assert node.call('save') == (False, "folder is '', accepted is the name of a folder")
    status, text = node.process.end()
    assert status == 0
    if find_spec('tf2_msgs') is None:
        assert 'tf is True and the package tf2_msgs is not there: no tf' in text


@pytest.mark.lasting
def test_a_node_does_not_start_without_its_coordinates(graph: Any, tmp_path: Path) -> None:
    path = tmp_path / 'none.csv'
    process = graph.start('registration', '-p', f'coordinates:={path}')
    status, text = process.wait()
    assert status == 1
    assert f'{path} cannot be read' in text


@pytest.mark.skipif(find_spec('tf2_msgs') is None, reason='tf2_msgs is not installed')
def test_scans_have_frames_in_tf_with_one_parent(graph: Any) -> None:
    from tf2_msgs.msg import TFMessage

    names = '-r', '/tf:=/frames/tf', '-r', '/tf_static:=/frames/tf_static'
    node = Registrar(graph, '/frames', *names, tf='true')
    heard = graph.listen(TFMessage, '/frames/tf_static')
    node.send(target_points(header(), scan(0)))
    other = TransformStamped(header=Header(frame_id='robot'), child_frame_id='scan_2')
    graph.publisher(TFMessage, '/frames/tf').publish(TFMessage(transforms=[other]))
    for number in (1, 2):
        node.send(target_points(header(), scan(number)))

    def frames() -> list[str]:
        return [it.child_frame_id for it in heard[-1].transforms] if heard else []

    # The other topic may be slower than the scans; an adjustment publishes all frames again.
    graph.until(lambda: node.call('adjust')[0] and frames() == ['scan_1', 'scan_3'])
    words = "no tf: 'scan_2' has the parent 'robot' already"
    graph.until(lambda: any(words in it.status[0].message for it in node.diagnostics))


def test_targets_without_id_or_confidence_are_left_out() -> None:
    points = whole_points(target_points(header(), scan(0)))
    assert points['id'][0, -1] == -1
    assert len(target_scan(points).names) == 2 * COMMON
    points['confidence'][0, 3:] = 0.5
    assert target_scan(points, 0.9).names == scan(0).names[:3]
    points['x'][0, 0] = np.nan
    assert target_scan(points, 0.9).names == scan(0).names[1:3]
