"""The nodes of `rig.launch.py` with scans of a box that docs/examples renders, and a recording."""

from __future__ import annotations

import runpy
import time
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

from ahf_ros.interchange.point_clouds import whole_points
from support import ROOT, bags
from support.launch_files import launched
from support.live import Graph
from support.scans import squared_error

SCANNER = runpy.run_path(str(ROOT / 'docs' / 'examples' / 'scanner.py'))
SCANS = range(len(SCANNER['SEEDS']))
POSED = [0, 1, 3]  # scans that see targets of known coordinates
UNLIKELY = 40.0  # of a chi-square of 6 degrees of freedom, which rarely exceeds 30


class Rig:
    """What a launch of the rig starts, with a scanner of one's own."""

    def __init__(self, graph: Graph, **given: str) -> None:
        self.graph = graph
        result = launched('rig', driver='zivid', registration='true', pose='true', **given)
        self.processes = [graph.start(it.node, *it.arguments) for it in result.nodes]
        self.transforms = graph.listen(PoseWithCovarianceStamped, '/registration/transform')
        self.residuals = graph.listen(PointCloud2, '/registration/residuals')
        self.clouds = graph.listen(PointCloud2, '/registration/cloud')
        self.poses = graph.listen(PoseWithCovarianceStamped, '/pose/pose')
        self.scanner = {
            name: graph.publisher(kind, name) for name, kind in SCANNER['TOPICS'].items()
        }

    def play(self, messages: list[tuple[str, bytes]]) -> None:
        """Publish scans, each as soon as the one before is registered."""
        for topic, message in messages:
            count = len(self.clouds)
            self.scanner[topic].publish(message)
            if topic == '/color/image_color':
                self.graph.until(lambda count=count: len(self.clouds) > count)

    def call(self, name: str) -> str:
        response = self.graph.call(Trigger, f'/registration/{name}', Trigger.Request())
        assert response.success, response.message
        return response.message


def recording() -> list[tuple[str, str, int, bytes]]:
    """Return the messages of all scans: topic, type, time and bytes."""
    now = time.time_ns()
    return [
        (
            topic,
            f'sensor_msgs/msg/{type(message).__name__}',
            now + number,
            serialize_message(message),
        )
        for number in SCANS
        for topic, message in SCANNER['messages'](SCANNER['scan'](number), now + number)
    ]


def test_scans_of_a_box_live_and_recorded_are_in_its_frame(graph: Any, tmp_path: Path) -> None:
    table, folder = tmp_path / 'box.csv', tmp_path / 'scans'
    table.write_text(SCANNER['table']())
    rig = Rig(
        graph, coordinates=str(table), folder=str(folder), frame='box', expected_targets='12'
    )
    recorded = recording()
    rig.play([(topic, message) for topic, _, _, message in recorded])
    graph.until(lambda: len(rig.transforms) == len(rig.residuals) == len(SCANS))
    graph.until(lambda: len(rig.poses) == len(POSED))
    for number in SCANS:
        of = SCANNER['scan'](number)
        found = [rig.transforms[number]]
        found += [rig.poses[POSED.index(number)]] if number in POSED else []
        for message in found:
            assert message.header.frame_id == 'box'
            transform = transform_of(message)
            true = replace(transform, rotation=of.rotation, translation=of.position)
            assert squared_error(transform, true) < UNLIKELY
            assert np.linalg.norm(transform.translation - true.translation) < 1e-3
        residuals = whole_points(rig.residuals[number])
        assert residuals['length'].max() < 0.2e-3
        cloud = whole_points(rig.clouds[number])
        walls = np.maximum(np.abs(cloud['x']), np.abs(cloud['y']))
        assert np.isfinite(walls).sum() > 100_000
        assert np.nanmax(np.abs(walls - SCANNER['WIDTH'] / 2)) < 1e-3
    assert rig.call('save').startswith('4 scans in ')
    assert len(list(folder.glob('*.ply'))) == len(SCANS)

    bag = bags.write_raw(tmp_path / 'bag', recorded)
    assert rig.call('reset') == '4 scans forgotten'
    rig.play([(topic, message) for topic, _, message in bags.read(bag)])
    graph.until(lambda: len(rig.transforms) == 2 * len(SCANS))
    graph.until(lambda: len(rig.poses) == 2 * len(POSED))
    for said in (rig.transforms, rig.poses, rig.clouds):
        assert said[len(said) // 2 :] == said[: len(said) // 2]
    for process in rig.processes:
        assert process.end()[0] == 0
