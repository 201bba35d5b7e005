"""The node and `ahf bag` give the same answers to the same images."""

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')
pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rclpy.serialization import deserialize_message, serialize_message
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image

from ahf_ros.bag.definitions import CODED_TARGETS, typestore
from ahf_ros.cli import main
from ahf_ros.msg import CodedTargetArray
from support import bags

SEARCH = {'detector': 'traditional', 'population': 6, 'seed': 3, 'expected_targets': 4}
FOLLOW = {'family': 'metashape12', 'follow': 8}


@pytest.fixture(scope='module', params=['searched', 'followed'])
def recording(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, list[bytes], dict[str, Any]]:
    """Return a bag, the answers to its images, and the parameters."""
    folder = tmp_path_factory.mktemp('recording')
    searched = request.param == 'searched'
    images = bags.scenes(4) if searched else bags.moving(4)
    parameters = SEARCH if searched else FOLLOW
    source = bags.write_ros2(folder / 'in', bags.recorded(typestore(), images))
    options = [
        text
        for name, value in parameters.items()
        for text in (f'--{name.replace("_", "-")}', str(value))
    ]
    assert main(['bag', str(source), str(folder / 'out'), *options]) == 0
    answers = [data for topic, _, data in bags.read(folder / 'out') if 'coded' in topic]
    return source, answers, parameters


@pytest.mark.parametrize('simulated', [False, True], ids=['real time', 'simulated time'])
def test_answers_of_the_node_are_those_of_the_bag(
    graph: Any, recording: tuple[Path, list[bytes], dict[str, Any]], simulated: bool
) -> None:
    source, recorded, chosen = recording
    parameters = {
        **chosen,
        'queue': 'lossless',
        'image_timeout': 0,
        'use_sim_time': str(simulated).lower(),
    }
    given = [text for name, value in parameters.items() for text in ('-p', f'{name}:={value}')]
    kind = 'followed' if 'follow' in chosen else 'searched'
    space = f'/replay_{"simulated" if simulated else "real"}_{kind}'
    node = graph.start('detector', '-r', f'__ns:={space}', *given)
    answers = graph.listen(CodedTargetArray, f'{space}/coded_targets')
    publisher = graph.publisher(Image, f'{space}/image')
    images = [(time, data) for topic, time, data in bags.read(source) if topic == '/image']
    clock = graph.publisher(Clock, '/clock') if simulated else None
    for time, data in images:  # faster than they are answered
        if clock:
            clock.publish(Clock(clock=Time(nanoseconds=time).to_msg()))
        publisher.publish(deserialize_message(data, Image))
    graph.until(lambda: len(answers) == len(images))
    if kind == 'followed':
        assert all(any(it.followed for it in answer.targets) for answer in answers[1:])
    else:
        assert any(answer.filter.applied for answer in answers)
    assert [comparable(answer) for answer in answers] == recorded
    assert node.end() == (0, '')


def comparable(answer: CodedTargetArray) -> bytes:
    """Return an answer with zeros between its fields, where ROS has what was in memory."""
    store = typestore()
    message: Any = store.deserialize_cdr(serialize_message(answer), CODED_TARGETS)
    return bytes(store.serialize_cdr(message, CODED_TARGETS))
