"""The detector where what it talks to does not behave: processes that die, clocks that jump."""

import math
import os
import subprocess
import sys
from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import ListParameters
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_msgs.msg import Header, String
from test_nodes import ENDLESS

from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.msg import CodedTarget, CodedTargetArray
from ahf_ros.nodes.messages import image_message
from ahf_ros.nodes.process import Ending
from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.srv import Identify
from support import live
from support.detector import DetectorProcess, overrides
from support.hostile import IMAGES, Fields

pytestmark = pytest.mark.lasting

SCENE = {'width': 320, 'height': 240, 'targets': 3, 'dot_radius': 9.0}


@pytest.fixture(scope='module')
def graph() -> Iterator[live.Graph]:
    """Return a graph without shared memory, by which Fast DDS lets the killed take others along.

    It may write to a port that another process has removed: eProsima/Fast-DDS, pull request 4737.
    """
    with mock.patch.dict(os.environ, FASTDDS_BUILTIN_TRANSPORTS='UDPv4'), live.opened() as graph:
        yield graph


@pytest.fixture(scope='module')
def pixels() -> np.ndarray:
    return render(SceneSettings(**SCENE)).image


class Bench(DetectorProcess):
    """A detector in a namespace, and all that it says."""

    def __init__(self, graph: Any, name: str, *places: str, **given: Any) -> None:
        remapped = [word for place in places for word in ('-r', place)]
        # Nothing is said of images that a busy machine has not sent yet.
        chosen = overrides(**{'image_timeout': 0, 'family': 'metashape12', **given})
        super().__init__(graph, f'/{name}', *remapped, *chosen, subscribed=False)
        # The node then knows who listens to its answers, too.
        assert self.diagnostics

    def kill(self) -> None:
        """End the detector without notice, and forget what it said."""
        self.process.kill()
        self.diagnostics.clear()
        self.targets.clear()


def test_the_end_of_a_node_does_not_gather_callbacks() -> None:
    ended, called = Ending(), []
    for _ in range(3):  # as an executor does with every spin
        ended.add_done_callback(called.append)
    ended.set_result(0)
    assert called == [ended]


@pytest.mark.parametrize('queue', ['latest', 'lossless'])
def test_a_camera_that_is_killed_and_comes_again(graph: Any, queue: str) -> None:
    bench = Bench(graph, f'camera_{queue}', queue=queue)
    # An image takes many packets, so that one or another is on its way at any moment.
    scene = {**SCENE, 'width': 1200, 'height': 900, 'rate': 50, 'frames': 1}
    for _ in range(2):
        camera = graph.start('illumination', '-r', f'__ns:={bench.namespace}', *overrides(**scene))
        graph.until(lambda: len(bench.targets) >= 3)
        camera.kill()
        bench.targets.clear()
    assert bench.told('rejected') == '0'
    status, errors = bench.process.end()
    assert status == 0
    # Until its lease is over, the killed camera counts as a second publisher.
    assert [it for it in errors.splitlines() if '2 publishers on' not in it] == []


def test_a_detector_that_is_killed_in_the_middle_of_a_search_and_comes_again(graph: Any) -> None:
    bench = Bench(graph, 'killed', **ENDLESS)
    camera = graph.start(
        'illumination', '-r', '__ns:=/killed', *overrides(**SCENE, rate=20, frames=1)
    )
    graph.until(lambda: int(bench.told('received') or 0) >= 3)
    assert bench.told('answered') == '0'
    bench.kill()
    bench.start(*overrides(image_timeout=0, family='metashape12'))
    graph.until(lambda: len(bench.targets) >= 3)
    graph.until(lambda: any(it.status == CodedTargetArray.OK for it in bench.targets))
    identified = [it for it in bench.targets if it.status == CodedTargetArray.OK]
    assert all(len(answer.targets) == SCENE['targets'] for answer in identified)
    assert camera.end() == (0, '')


CALLER = """
import rclpy
from ahf_ros.srv import Identify
rclpy.init()
node = rclpy.create_node('caller')
client = node.create_client(Identify, '/called/detector/identify')
client.wait_for_service()
request = Identify.Request()
request.image.encoding, request.image.data = 'mono8', bytes(range(240)) * 30
request.image.height, request.image.width, request.image.step = 30, 240, 240
client.call_async(request)
rclpy.spin(node)
"""


def test_a_client_that_dies_in_the_middle_of_a_call(graph: Any, pixels: np.ndarray) -> None:
    callers: list[subprocess.Popen] = []
    killed: list[int] = []

    def answer(request: Identify.Request, response: Identify.Response) -> Identify.Response:
        while callers:
            callers[-1].kill()
            killed.append(callers.pop().wait())
        response.success = True
        response.coded_targets.targets = [CodedTarget(id=7, x=1.0, y=2.0, family='mine')]
        return response

    service = graph.node.create_service(Identify, '/slow', answer)
    bench = Bench(graph, 'called', detector='service', service='/slow', family='auto')
    bench.until_served(image_message(pixels, Header()))
    for count in (1, 2):
        callers.append(subprocess.Popen([sys.executable, '-c', CALLER]))
        graph.until(lambda count=count: len(killed) == count)
    response = bench.identify(image_message(pixels, Header(frame_id='after')))
    assert (response.success, response.message) == (True, '')
    assert response.coded_targets.header.frame_id == 'after'
    assert [it.id for it in response.coded_targets.targets] == [7]
    assert bench.process.end() == (0, '')
    graph.node.destroy_service(service)


def test_stamps_that_go_backwards_are_told_and_answered(graph: Any, pixels: np.ndarray) -> None:
    bench = Bench(graph, 'backwards', queue='lossless')
    image = graph.publisher(Image, '/backwards/image')
    stamps = [Time(sec=5), Time(sec=7, nanosec=1), Time(sec=7), Time(sec=7), Time(sec=8)]
    for stamp in stamps:
        image.publish(image_message(pixels, Header(stamp=stamp)))
    graph.until(lambda: len(bench.targets) == len(stamps))
    assert [answer.header.stamp for answer in bench.targets] == stamps
    graph.until(lambda: bench.told('answered') == str(len(stamps)))
    assert bench.told('stamps that went backwards') == '1'
    assert bench.told('rejected') == '0'
    warned = [it.status[0] for it in bench.diagnostics if it.status[0].level != b'\0']
    assert [(it.level, it.message) for it in warned] == [
        (DiagnosticStatus.WARN, '1 stamps went backwards; 1 stamps came twice')
    ]
    status, log = bench.process.end()
    assert status == 0
    assert log.count('stamp') == 1
    assert 'stamp is 7.000000000 s, that of the image before is 7.000000001 s' in log


def test_a_topic_of_another_type_is_named_and_images_are_answered(graph: Any) -> None:
    bench = Bench(graph, 'mistaken', 'image:=camera/image')
    topic = '/mistaken/camera/image'
    other = graph.node.create_publisher(String, topic, 1)
    named = f'{topic} is of type std_msgs/msg/String, accepted is sensor_msgs/msg/Image'

    def status() -> tuple[bytes, str]:
        said = bench.diagnostics[-1].status[0]
        return said.level, said.message

    graph.until(lambda: bench.diagnostics and status() == (DiagnosticStatus.WARN, named))
    other.publish(String(data='no image'))
    camera = graph.start(
        'illumination', '-r', '__ns:=/mistaken/camera', *overrides(**SCENE, rate=20, frames=1)
    )
    graph.until(lambda: bench.targets)
    graph.node.destroy_publisher(other)
    graph.until(lambda: 'is of type' not in status()[1])
    assert camera.end() == (0, '')
    ended, log = bench.process.end()
    assert (ended, named in log) == (0, True)


def test_simulated_time_that_has_not_begun_stands_still_or_jumps(
    graph: Any, pixels: np.ndarray
) -> None:
    bench = Bench(graph, 'simulated', use_sim_time='true')
    image = graph.publisher(Image, '/simulated/image')

    def answered(count: int) -> None:
        image.publish(image_message(pixels, Header()))
        graph.until(lambda: len(bench.targets) == count)
        told = len(bench.diagnostics)
        graph.until(lambda: len(bench.diagnostics) >= told + 1)  # goes on, whatever the time

    answered(1)
    assert bench.diagnostics[-1].header.stamp == Time()
    clock = graph.publisher(Clock, '/clock')

    def arrived(sec: int) -> bool:
        clock.publish(Clock(clock=Time(sec=sec)))  # over again, as one that is lost is lost
        return bench.diagnostics[-1].header.stamp == Time(sec=sec)

    for count, sec in ((2, 1000), (3, 10)):  # the second time as where a replay starts over
        graph.until(lambda sec=sec: arrived(sec))
        answered(count)
    assert bench.process.end() == (0, '')


def test_any_message_is_answered_or_rejected(graph: Any) -> None:
    drawn: list[Fields] = []

    @settings(suppress_health_check=list(HealthCheck))
    @given(IMAGES)
    def draw(fields: Fields) -> None:
        drawn.append(fields)

    draw()
    bench = Bench(graph, 'fuzz', queue='lossless')
    answers = graph.listen(CodedTargetArray, '/fuzz/coded_targets', len(drawn))
    image = graph.node.create_publisher(Image, '/fuzz/image', len(drawn))
    graph.until(image.get_subscription_count)
    for fields in drawn:
        image.publish(Image(header=Header(), **fields))
    graph.until(
        lambda: int(bench.told('answered')) + int(bench.told('rejected')) == len(drawn) >= 100
    )
    graph.until(lambda: len(answers) == len(drawn))
    identified = [it for it in answers if it.status == CodedTargetArray.OK]
    assert len(identified) == int(bench.told('answered')) > 0
    status, log = bench.process.end()
    assert (status, 'Traceback' in log) == (0, False), log


def test_parameters_are_those_described_and_take_integers_for_numbers(graph: Any) -> None:
    items = {item.name: item for item in flat_parameters(DetectorNodeSettings)}
    numbers = [item for item in items.values() if isinstance(item.default, float)]
    whole = {item.name: max(round(item.default), math.ceil(item.minimum)) for item in numbers}
    bench = Bench(graph, 'whole', **{**whole, 'image_timeout': 0})
    names = graph.call(
        ListParameters, '/whole/detector/list_parameters', ListParameters.Request()
    ).result.names
    declared = {name for name in names if not name.startswith('qos_overrides.')}
    assert set(items) <= declared
    assert declared - set(items) <= {'use_sim_time', 'start_type_description_service'}
    assert all(len(item.description) > 10 for item in items.values())
    assert bench.process.end() == (0, '')
