"""Drivers of scanners, with the layout of their messages, and the nodes of `rig.launch.py`."""

import array
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header
from test_nodes_rig import in_space, read, scan, synthetic_camera

from ahf_ros.clouds.point_clouds import organised_points
from ahf_ros.nodes.drivers import DRIVERS, Driver
from ahf_ros.scenes.scene import Rendering, SceneSettings, render
from support.launch_files import launched
from support.live import PATIENCE, ros_environment

# Small enough for best effort, which loses messages of more than half a megabyte.
SCENE = SceneSettings(width=200, height=150, targets=4, dot_radius=6.0, seed=4)
MAXIMUM_ERROR = 0.2e-3  # m
NARROWER = 24  # px, with a disparity offset
AGAIN = 1.0  # s, after which lost messages are sent again

NODES = """
import json, os, signal, sys
from ahf_ros.nodes.start import start
import ahf_ros.nodes.detector, ahf_ros.nodes.registration

every, leave = json.loads(sys.argv[1]), os._exit
for name, arguments in every:
    if not os.fork():
        leave(start(name, ['--ros-args', *arguments]))
signal.signal(signal.SIGINT, signal.SIG_IGN)
sys.exit(sum(os.waitstatus_to_exitcode(os.wait()[1]) for _ in every))
"""
"""Several nodes for the imports of two, and no threads of numpy that a fork would leave behind.

LTTng, which comes with ROS 2, has threads that it would end as a process exits, where forked ones
have none: they leave.
"""

GIVEN = {'registration': 'true', 'family': SCENE.family}
ARGUMENTS = {'ensenso': {'cloud_offset_x': str(NARROWER)}}
"""What a user sets beside the driver."""

DELAYS = {'ensenso': -1200, 'mechmind': 1_500_000_000, 'phoxi': -50_000_000}
"""Stamp of a cloud minus that of its image, ns."""


def pixels_of(encoding: str, grey: np.ndarray) -> np.ndarray:
    """Return the pixels of an image in an encoding."""
    full = np.full_like(grey, 255)
    return {
        'mono8': grey,
        'bgr8': np.dstack((grey, grey, grey)),
        'rgba8': np.dstack((grey, grey, grey, full)),
        '32FC1': grey.astype(np.float32) * 3.7,
    }[encoding]


@dataclass
class Scanner:
    """What a driver publishes, and what the nodes of its rig say of it."""

    name: str
    driver: Driver
    image: Any
    points: Any
    found: list[PointCloud2] = field(default_factory=list)  # positions of targets
    registered: list[PointCloud2] = field(default_factory=list)  # clouds

    def shoot(self, rendering: Rendering, cloud: np.ndarray, number: int) -> None:
        """Publish image and cloud of a shot in the order of the driver."""
        stamp = time.time_ns() // 1000 * 1000 + 789 + number
        messages = [
            (self.image, image_of(self.driver, rendering, stamp)),
            (self.points, cloud_of(self.name, cloud, stamp + DELAYS.get(self.name, 0))),
        ]
        for publisher, message in messages[:: -1 if self.driver.cloud_first else 1]:
            publisher.publish(message)


def header(nanoseconds: int) -> Header:
    message = Header(frame_id='scanner')
    message.stamp.sec, message.stamp.nanosec = divmod(nanoseconds, 10**9)
    return message


def image_of(driver: Driver, rendering: Rendering, stamp: int) -> Image:
    pixels = pixels_of(driver.encoding, rendering.image)
    height, width = rendering.image.shape
    return Image(
        header=header(stamp),
        height=height,
        width=width,
        encoding=driver.encoding,
        step=pixels.nbytes // height,
        data=array.array('B', pixels.tobytes()),
    )


def cloud_of(name: str, points: np.ndarray, stamp: int) -> PointCloud2:
    driver = DRIVERS[name]
    if 'cloud_offset_x' in ARGUMENTS.get(name, {}):
        points = points[:, NARROWER:]
    height, width, _ = points.shape
    sent = np.zeros((height, width, driver.point_step // 4), np.float32)
    missing = np.nan if driver.missing == 'NaN' else 0.0
    sent[:, :, :3] = np.where(np.isnan(points), missing, points)
    named = ['x', 'y', 'z', *(['rgb'] if driver.point_step == 20 else [])]
    return PointCloud2(
        header=header(stamp),
        height=height,
        width=width,
        fields=[
            PointField(name=of, offset=16 if of == 'rgb' else 4 * axis, datatype=7, count=1)
            for axis, of in enumerate(named)
        ],
        point_step=driver.point_step,
        row_step=driver.point_step * width,
        data=array.array('B', sent.tobytes()),
        is_dense=name == 'phoxi',  # as PCL says it unless it is told otherwise
    )


def xyz(message: PointCloud2) -> np.ndarray:
    """Return the points of a cloud, shape (height, width, 3)."""
    points = organised_points(message)
    return np.stack([points[axis] for axis in 'xyz'], axis=2)


@pytest.fixture
def nodes() -> Iterator[subprocess.Popen]:
    """Start the nodes that the launch file describes for the drivers."""
    started = [
        (node.node, node.arguments)
        for name in DRIVERS
        for node in launched(
            'rig', driver=name, namespace=name, **GIVEN, **ARGUMENTS.get(name, {})
        ).nodes
    ]
    command = (sys.executable, '-c', NODES, json.dumps(started))
    environment = {**os.environ, **ros_environment(), 'OPENBLAS_NUM_THREADS': '1'}
    process = subprocess.Popen(command, env=environment, start_new_session=True)
    yield process
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(PATIENCE) == 0


@pytest.mark.lasting
def test_every_driver_has_positions_and_registered_clouds_with_the_rig(
    graph: Any, nodes: subprocess.Popen
) -> None:
    rendering, camera = render(SCENE), synthetic_camera(SCENE)
    cloud = scan(rendering, camera, 0.0, {0: 1.2}) / 1000
    scanners = []
    for name, driver in ((name, it.within(name)) for name, it in DRIVERS.items()):
        kinds = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT
        quality = QoSProfile(depth=1, reliability=kinds[not driver.reliable])
        publishers = [
            graph.node.create_publisher(kind, topic, quality)
            for kind, topic in ((Image, driver.image), (PointCloud2, driver.points))
        ]
        for publisher in publishers:
            graph.until(publisher.get_subscription_count)
        scanner = Scanner(name, driver, *publishers)
        for topic, heard in (
            ('detector/target_points', scanner.found),
            ('registration/cloud', scanner.registered),
        ):
            graph.node.create_subscription(PointCloud2, f'/{name}/{topic}', heard.append, 10)
        scanners.append(scanner)
    number, last = 0, -AGAIN

    def all_are_registered() -> bool:
        nonlocal number, last
        assert nodes.poll() is None
        without = [it for it in scanners if not it.registered]
        if without and time.monotonic() - last > AGAIN:
            number, last = number + 1, time.monotonic()
            for scanner in without:
                scanner.shoot(rendering, cloud, number)
        return not without

    graph.until(all_are_registered)
    true = in_space(camera, np.array([(it.x, it.y) for it in rendering.targets])) / 1000
    for scanner in scanners:
        points = read(scanner.found[0])
        assert points['id'].tolist() == [it.id for it in rendering.targets], scanner.name
        errors = np.stack([points[axis] for axis in 'xyz'], axis=1) - true
        assert np.linalg.norm(errors, axis=1).max() < MAXIMUM_ERROR, scanner.name
        message = scanner.registered[0]  # the first scan gives the frame
        assert message.header.frame_id == 'registered'
        sent = xyz(cloud_of(scanner.name, cloud, 0))
        sent[~sent.any(axis=2)] = np.nan
        assert np.array_equal(xyz(message), sent, equal_nan=True), scanner.name
