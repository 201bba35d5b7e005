"""Two launches of `rig.launch.py` in namespaces, two rendered scanners, one registration."""

import runpy
import time
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import PointCloud2
from test_nodes_registration import transform_of

from support import ROOT
from support.launch_files import launched
from support.live import Graph

SCANNER = runpy.run_path(str(ROOT / 'docs' / 'examples' / 'scanner.py'))
pytestmark = pytest.mark.lasting

NAMES = 'left', 'right'
GIVEN = {'driver': 'zivid', 'family': 'metashape12', 'expected_targets': '12'}
AGAIN = 5.0  # s until a shot whose answer was lost is repeated


def placed(answers: list[Any], begin: int) -> list[Any]:
    """Return the answers to scans of the scanner whose clock began then, ns.

    A scan is sent again where the machine is slow, so that a scanner may have several.
    """
    stamps = (it.header.stamp for it in answers)
    near = [abs(it.sec * 10**9 + it.nanosec - begin) < 5 * 10**11 for it in stamps]
    return [it for it, is_near in zip(answers, near, strict=True) if is_near]


def test_two_scanners_are_registered_in_one_frame(graph: Graph) -> None:
    one = {'registration': 'true', 'scanners': ','.join(NAMES)}
    for name, more in zip(NAMES, ({}, one), strict=True):
        for it in launched('rig', namespace=name, **GIVEN, **more).nodes:
            graph.start(it.node, *it.arguments)
    places = graph.listen(PoseWithCovarianceStamped, '/registration/transform')
    clouds = graph.listen(PointCloud2, '/registration/cloud')
    publishers = {
        name: {
            topic: graph.node.create_publisher(kind, f'/{name}{topic}', 10)
            for topic, kind in SCANNER['TOPICS'].items()
            if kind.__name__ != 'CameraInfo'
        }
        for name in NAMES
    }
    for of in publishers.values():
        for it in of.values():
            graph.until(it.get_subscription_count)
    for number, name in enumerate(NAMES):
        # The stamps of the second scanner are those of a clock that is behind.
        begin = time.time_ns() - number * 10**12
        last = -AGAIN

        def registered(number: int = number, name: str = name, begin: int = begin) -> bool:
            nonlocal last
            if time.monotonic() - last > AGAIN and not placed(places, begin):
                last = time.monotonic()
                stamp = begin + round(last * 1e6)
                for topic, message in SCANNER['messages'](SCANNER['scan'](number), stamp):
                    if topic in publishers[name]:
                        message.header.frame_id = f'{name}_optical_frame'
                        publishers[name][topic].publish(message)
            return bool(placed(places, begin) and placed(clouds, begin))

        graph.until(registered)
    of = [SCANNER['scan'](number) for number in range(2)]
    found = transform_of(placed(places, begin)[0])
    rotation = of[0].rotation.T @ of[1].rotation
    translation = of[0].rotation.T @ (of[1].position - of[0].position)
    assert np.abs(found.rotation - rotation).max() < 1e-3
    assert np.linalg.norm(found.translation - translation) < 0.5e-3
    assert {it.header.frame_id for it in (*places, *clouds)} == {'registered'}
