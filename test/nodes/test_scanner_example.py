"""The nodes of `rig.launch.py` with scans of a box that docs/examples renders, and a recording."""

import runpy
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger
from test_nodes_registration import transform_of

from ahf_ros.clouds.point_clouds import whole_points
from support import ROOT, bags
from support.launch_files import launched
from support.live import Graph
from support.scans import squared_error

pytestmark = pytest.mark.lasting

EXAMPLE = ROOT / 'docs' / 'examples' / 'scanner.py'
SCANNER = runpy.run_path(str(EXAMPLE))
SCANS = range(len(SCANNER['SEEDS']))
POSED = [0, 1, 3]  # scans that see targets of known coordinates
AGAIN = 10.0  # s until a shot that is not answered is repeated
UNLIKELY = 40.0  # of a chi-square of 6 degrees of freedom, which rarely exceeds 30


def stamp_of(message: Any) -> int:
    """Return the stamp, ns."""
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


class Rig:
    """What a launch of the rig starts, and what it says of scans."""

    def __init__(self, graph: Graph, **given: str) -> None:
        self.graph = graph
        result = launched('rig', driver='zivid', registration='true', pose='true', **given)
        self.processes = [graph.start(it.node, *it.arguments) for it in result.nodes]
        self.transforms = graph.listen(PoseWithCovarianceStamped, '/registration/transform')
        self.residuals = graph.listen(PointCloud2, '/registration/residuals')
        self.clouds = graph.listen(PointCloud2, '/registration/cloud')
        self.poses = graph.listen(PoseWithCovarianceStamped, '/pose/pose')

    def rehearse(self, shoot: Callable[[], int]) -> None:
        """Shoot until all nodes answer the last shot, since first messages may be lost.

        `shoot` returns the stamp, ns. Shots before the last one are answered or lost by then.
        """
        said = self.transforms, self.residuals, self.clouds, self.poses

        def answered() -> bool:
            stamp, limit = shoot(), time.monotonic() + AGAIN
            self.graph.until(
                lambda: all(stamp in map(stamp_of, it) for it in said) or time.monotonic() > limit
            )
            return all(stamp in map(stamp_of, it) for it in said)

        self.graph.until(answered)
        self.call('reset')
        for it in said:
            it.clear()

    def until_registered(self, scans: int, posed: int) -> None:
        """Return when there are so many scans and poses of the camera."""
        others = self.transforms, self.residuals, self.clouds
        self.graph.until(lambda: len(self.poses) >= posed and min(map(len, others)) >= scans)

    def call(self, name: str) -> str:
        response = self.graph.call(Trigger, f'/registration/{name}', Trigger.Request())
        assert response.success, response.message
        return response.message


def recording(path: Path) -> Path:
    """Write a bag of all scans."""
    now = time.time_ns()
    messages = [
        (topic, f'sensor_msgs/msg/{type(it).__name__}', now + number, serialize_message(it))
        for number in SCANS
        for topic, it in SCANNER['messages'](SCANNER['scan'](number), now + number)
    ]
    return bags.write_raw(path, messages)


def assert_true(rig: Rig) -> None:
    """Assert that all scans, and the camera, are where the scanner was."""
    for number in SCANS:
        of = SCANNER['scan'](number)
        found = [(rig.transforms[number], 0.1e-3)]
        found += [(rig.poses[POSED.index(number)], 1e-3)] if number in POSED else []
        for message, error in found:
            assert message.header.frame_id == 'box'
            transform = transform_of(message)
            true = replace(transform, rotation=of.rotation, translation=of.position)
            assert squared_error(transform, true) < UNLIKELY
            assert np.linalg.norm(transform.translation - true.translation) < error
        residuals = whole_points(rig.residuals[number])
        assert residuals['length'].max() < 0.2e-3
        cloud = whole_points(rig.clouds[number])
        walls = np.maximum(np.abs(cloud['x']), np.abs(cloud['y']))
        assert np.isfinite(walls).sum() > 100_000
        assert np.nanmax(np.abs(walls - SCANNER['WIDTH'] / 2)) < 1e-3


def test_scans_of_a_box_live_and_recorded_are_in_its_frame(graph: Any, tmp_path: Path) -> None:
    folder, table = tmp_path / 'scans', tmp_path / 'box.csv'
    table.write_text(SCANNER['table'](), encoding='utf-8')
    given = {'coordinates': str(table), 'folder': str(folder), 'frame': 'box'}
    rig = Rig(graph, expected_targets='12', family='metashape12', **given)
    publishers = {name: graph.publisher(kind, name) for name, kind in SCANNER['TOPICS'].items()}

    def shoot(number: int) -> int:
        stamp = time.time_ns()
        for topic, message in SCANNER['messages'](SCANNER['scan'](number), stamp):
            publishers[topic].publish(message)
        return stamp

    rig.rehearse(lambda: shoot(0))
    for number in SCANS:
        shoot(number)
        rig.until_registered(number + 1, sum(it <= number for it in POSED))
    assert_true(rig)
    assert rig.call('save').startswith('4 scans in ')
    assert len(list(folder.glob('*.ply'))) == len(SCANS)

    assert rig.call('reset') == '4 scans forgotten'
    recorded = bags.read(recording(tmp_path / 'bag'))
    for place, (topic, _, message) in enumerate(recorded, 1):
        publishers[topic].publish(message)
        if place % len(publishers) == 0:
            rig.until_registered(len(SCANS) + place // len(publishers), 0)
    rig.until_registered(2 * len(SCANS), 2 * len(POSED))
    poses = [[it.pose for it in said] for said in (rig.transforms, rig.poses)]
    for said in (*poses, [it.data for it in rig.clouds]):
        assert said[len(said) // 2 :] == said[: len(said) // 2]
    for process in rig.processes:
        assert process.end()[0] == 0
