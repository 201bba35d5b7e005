"""The nodes, `ahf bag --register` and `ahf register` write the same files from the same scans."""

import time
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')
pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Image, PointCloud2
from std_srvs.srv import Trigger
from test_bag_register import FAMILY, contents, picture, register, shot

from ahf_ros.clouds.point_clouds import whole_points
from ahf_ros.files.cloud_files import write_ply
from ahf_ros.files.image_files import write_image
from support import bags
from support.command_line import status
from support.detector import overrides, own
from support.wall import SCENE, moved

SPACE = '/register'


def test_nodes_bag_and_files_give_the_same_files_byte_by_byte(graph: Any, tmp_path: Path) -> None:
    """A scan in millimetres is refused by all of them; the others are adjusted jointly."""
    scans = [shot(0), shot(1), shot(2, 1000 * moved(2)), shot(3)]
    assert register(tmp_path, [message for scan in scans for message in scan], '--adjust') == 1

    given = overrides(family=SCENE.family, queue='lossless', cloud='true')
    graph.start('detector', *own(SPACE), *given)
    live = tmp_path / 'live'
    given = overrides(cloud='true', tf='false', folder=live)
    remapped = '-r', 'target_points:=detector/target_points'
    graph.start('registration', *own(SPACE), *remapped, *given)

    def respond(name: str) -> None:
        response = graph.call(Trigger, f'{SPACE}/registration/{name}', Trigger.Request())
        assert response.success, response.message

    targets = graph.listen(PointCloud2, f'{SPACE}/detector/target_points')
    clouds = graph.listen(PointCloud2, f'{SPACE}/registration/cloud')
    publishers = {
        '/image': graph.publisher(Image, f'{SPACE}/image'),
        '/points': graph.publisher(PointCloud2, f'{SPACE}/points'),
    }
    graph.until(lambda: publishers['/points'].get_subscription_count() == 2)
    messages = [
        (publishers[topic], deserialize_message(data, publishers[topic].msg_type))
        for topic, _, data in bags.read(tmp_path / 'in')
    ]
    # The detector knows the other node once the cloud of an earlier scan is there.
    stamps: list[Time] = []
    while not clouds:
        stamps.append(Time(sec=0, nanosec=10**6 * (1 + len(stamps))))
        for publisher, message in messages[:2]:
            early = deepcopy(message)
            early.header.stamp = stamps[-1]
            publisher.publish(early)
        graph.until(lambda: len(targets) == len(stamps))
        limit = time.monotonic() + 1
        graph.until(lambda limit=limit: clouds or time.monotonic() > limit)
    graph.until(lambda: clouds[-1].header.stamp == stamps[-1])
    respond('reset')
    targets.clear()
    clouds.clear()
    for publisher, message in messages:
        publisher.publish(message)
    graph.until(lambda: len(targets) == len(scans) and len(clouds) == len(scans) - 1)
    respond('adjust')
    respond('save')
    registered = contents(tmp_path / 'scans')
    assert len(registered) == 9
    assert contents(live) == registered

    folder = tmp_path / 'files'
    folder.mkdir()
    for number, scan in enumerate(scans):
        (cloud,) = (it for topic, _, _, it in scan if topic == '/points')
        (folder / f'{number}.ply').write_bytes(write_ply(whole_points(cloud)))
        write_image(folder / f'{number}.png', picture())
    assert status('register', folder, '-o', tmp_path / 'again', '--adjust', *FAMILY) == 1
    again = contents(tmp_path / 'again')
    assert again.keys() == registered.keys()
    # The others have stamps, which files do not.
    assert [it for it in again if again[it] != registered[it]] == [
        'transforms.csv',
        'transforms.json',
    ]
