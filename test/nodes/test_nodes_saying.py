"""What the detector says when something is not as it should be, and what to do about it."""

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rcl_interfaces.srv import ListParameters
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image, PointCloud2
from test_nodes import header
from test_nodes_rig import cloud_message

from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.messages import image_message
from ahf_ros.scenes.scene import SceneSettings
from support.detector import DetectorProcess, overrides, own, values
from support.scenes import rendered

LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
WEAK = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
PIXELS = np.tile(np.arange(60, dtype=np.uint8), (40, 1))
CONFIG = Path(__file__).parents[2] / 'config'


def assert_every_topic_has_overrides(graph: Any, *node: str) -> None:
    name, namespace = node
    service = f'{namespace}/{name}/list_parameters'
    request = ListParameters.Request(prefixes=['qos_overrides'])
    names = set(graph.call(ListParameters, service, request).result.names)
    own = graph.node
    for end, topics in (
        ('publisher', own.get_publisher_names_and_types_by_node(*node)),
        ('subscription', own.get_subscriber_names_and_types_by_node(*node)),
    ):
        checked = [it for it, _ in topics if it not in ('/rosout', '/parameter_events', '/clock')]
        assert checked
        for topic in checked:
            for policy in ('history', 'depth', 'reliability', 'durability'):
                assert f'qos_overrides.{topic}.{end}.{policy}' in names


def test_the_start_what_has_no_effect_and_the_quality_of_service(graph: Any) -> None:
    topic = '/followed/image'
    overrides = 'qos_overrides./followed/coded_targets.publisher'
    given = (f'{overrides}.durability:=transient_local', f'{overrides}.depth:=3')
    wrong = ('expected_target:=54',)
    words = [word for it in (*given, *wrong, 'expected_targets:=7') for word in ('-p', it)]
    file = str(CONFIG / 'illumination.yaml')
    # An image that was published before the detector started.
    first = graph.node.create_publisher(Image, topic, LATCHED)
    first.publish(image_message(PIXELS, header()))
    arguments = ('--params-file', file, *words, '--', '--expected', '54')
    detector = graph.start('detector', *own('/followed'), *arguments)
    answers = graph.listen(CodedTargetArray, '/followed/coded_targets', LATCHED)
    graph.until(lambda: len(answers) == 1)

    def subscribed(*policies: object) -> bool:
        found = [it.qos_profile for it in graph.node.get_subscriptions_info_by_topic(topic)]
        return [(it.reliability, it.durability) for it in found] == [policies]

    assert subscribed(ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)
    graph.node.destroy_publisher(first)
    camera = graph.node.create_publisher(Image, topic, WEAK)
    graph.until(lambda: subscribed(ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE))

    def answered() -> bool:
        camera.publish(image_message(PIXELS, header()))  # over again, as one may get lost
        return len(answers) >= 2

    graph.until(answered)
    other = graph.publisher(Image, topic)
    graph.until(lambda: subscribed(ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE))
    count = len(answers)
    late = graph.listen(CodedTargetArray, '/followed/coded_targets', LATCHED)
    graph.until(lambda: len(late) >= min(count, 3))
    assert_every_topic_has_overrides(graph, 'detector', '/followed')
    of_clouds = '/followed/detector/target_points', '/followed/detector/target_labels'
    assert [graph.node.count_publishers(it) for it in of_clouds] == [0, 0]
    status, warnings = detector.end()
    assert status == 0
    followed = f'{topic} is subscribed to as it is published, '
    assert f'{followed}best effort, volatile; messages that get lost' in warnings
    assert f'{followed}reliable, transient local' in detector.log
    assert 'transient local' not in warnings
    assert 'no parameter is named expected_target; the nearest is expected_targets\n' in warnings
    assert 'focal_length, frame_id, frames, full_well, gamma, height, light' in warnings
    assert "arguments '--expected 54' have no effect" in warnings
    (started,) = [it for it in detector.log.splitlines() if ' answers on ' in it]
    assert started.endswith(
        'detector ring, family metashape12, N 7, search for a filter on, queue latest, stack 1, '
        'answers on /followed/coded_targets, images on /followed/image'
    )
    for publisher in (camera, other):
        graph.node.destroy_publisher(publisher)


@pytest.mark.lasting
def test_what_does_not_arrive_is_named_with_the_reason_and_the_remedy(graph: Any) -> None:
    node = graph.node
    given = overrides(image_timeout=0.1, cloud='true', cloud_tolerance=0.001)
    quiet = DetectorProcess(graph, '/quiet', *given, subscribed=False)
    nobody = 's: nobody publishes sensor_msgs/msg/Image on /quiet/image; it is published on '
    elsewhere = node.create_publisher(Image, '/quiet/image_raw', 1)
    quiet.says(f'{nobody}/quiet/image_raw', ': remap with -r image:=/quiet/image_raw')
    node.destroy_publisher(elsewhere)
    cameras = [node.create_publisher(Image, '/quiet/image', it) for it in (10, WEAK)]
    quiet.says(
        's: 1 of 2 publishers on /quiet/image offers best effort, volatile, which a subscription '
        'that is reliable, volatile does not receive',
        ': set qos_overrides./quiet/image.subscription to what all of them offer',
    )
    node.destroy_publisher(cameras.pop())
    quiet.says('s: /test publishes on /quiet/image, but nothing arrives')
    assert quiet.set(('image_timeout', 1000.0)) == (True, '')
    cameras.append(node.create_publisher(Image, '/quiet/image', 10))
    quiet.says('2 publishers on /quiet/image, /test, /test: what they send is taken in the order')
    graph.until(lambda: all(it.get_subscription_count() for it in cameras))
    answers = quiet.targets
    for count, (camera, image) in enumerate(zip(cameras, (PIXELS, PIXELS[:30]), strict=True), 1):
        camera.publish(image_message(image, header()))
        graph.until(lambda count=count: len(answers) == count)
    assert [(it.width, it.height) for it in answers] == [(60, 40), (60, 30)]
    told = values(graph.newer(quiet.diagnostics))
    assert told['changes of size or encoding'] == '1'
    # From Kilted on, rclpy tells publishers apart.
    uncounted = '0, not counted: messages come from 2 publishers'
    assert told['lost in transport'] in ('0', uncounted)
    node.destroy_publisher(cameras.pop())
    assert quiet.set(('image_timeout', 0.1)) == (True, '')
    image = image_message(PIXELS, header())
    cameras[0].publish(image)
    quiet.says(
        'images wait for a cloud: nobody publishes sensor_msgs/msg/PointCloud2 on /quiet/points'
    )
    cloud = cloud_message(np.zeros((40, 60, 3)), image.header)
    cloud.header.stamp.nanosec += 30_000_000
    graph.publisher(PointCloud2, '/quiet/points').publish(cloud)
    quiet.says(
        'clouds wait for each other: the nearest stamps differ by 0.03 s, '
        'set cloud_tolerance to at least 0.03'
    )
    assert quiet.set(('cloud_tolerance', 0.03)) == (True, '')
    for camera in cameras:
        node.destroy_publisher(camera)
    assert_losses_are_counted(quiet, answers)


def assert_losses_are_counted(quiet: DetectorProcess, answers: list[CodedTargetArray]) -> None:
    assert quiet.set(('queue', 'lossless'), ('image_timeout', 0.0)) == (True, '')
    camera = quiet.graph.node.create_publisher(Image, '/quiet/image', 1)
    before = len(answers)

    def arrived() -> bool:
        camera.publish(image_message(PIXELS, header()))
        return len(answers) > before

    quiet.graph.until(arrived)
    # More than any buffer on the way holds while the process stands still.
    large = np.tile(PIXELS[:1], (1000, 30))
    os.kill(quiet.process.process.pid, signal.SIGSTOP)
    try:
        for _ in range(20):
            camera.publish(image_message(large, header()))
    finally:
        os.kill(quiet.process.process.pid, signal.SIGCONT)
    before = len(answers)
    quiet.graph.until(arrived)
    told = quiet.says('images were lost in transport; more depth of the publisher')
    assert int(told['lost in transport']) > 0
    quiet.graph.node.destroy_publisher(camera)


def test_the_families_of_a_stream_are_said_when_they_settle(graph: Any) -> None:
    detector = DetectorProcess(graph, '/settling', *overrides(family='auto', image_timeout=0))
    shown = rendered(SceneSettings(width=320, height=240, targets=3, dot_radius=8, seed=3))
    found = [detector.answer(image_message(shown.image, header())) for _ in range(2)]
    assert [[it.id for it in answer.targets] for answer in found] == [
        [it.id for it in shown.targets]
    ] * 2
    assert {target.family for target in found[0].targets} == {'metashape12'}
    assert [answer.settled for answer in found] == ['metashape12'] * 2
    graph.until(lambda: detector.told('settled families') == 'metashape12')
    assert detector.process.end() == (0, '')
    said = [line for line in detector.process.log.splitlines() if 'families: ' in line]
    assert len(said) == 1
    assert said[0].endswith('families: metashape12')
