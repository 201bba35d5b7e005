"""A triggered scanner, its silence and its end, and images that nobody asks for."""

import os
import random
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from visualization_msgs.msg import ImageMarker

from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.messages import image_message
from support.detector import DetectorProcess, overrides, own, values
from support.live import Graph, ros_environment

PIXELS = np.tile(np.arange(60, dtype=np.uint8), (40, 1))
TIMEOUT = 1.0  # s
HOUR = 3600.0  # s
QUICK = {'detector': 'traditional', 'family': 'metashape12', 'ahf': 'false'}

DRIVER = """
import sys, time
import rclpy
from sensor_msgs.msg import Image
rclpy.init()
node = rclpy.create_node('driver')
publisher = node.create_publisher(Image, sys.argv[1], 1)
image = Image(width=64, height=64, encoding='mono8', step=64, data=bytes(range(64)) * 64)
while True:
    publisher.publish(image)
    time.sleep(0.2)
"""

PROFILE = """\
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><profiles>
<participant profile_name="patient" is_default_profile="true"><rtps><builtin><discovery_config>
<leaseDuration><sec>100000</sec></leaseDuration>
</discovery_config></builtin></rtps></participant></profiles></dds>
"""
"""Lets others take a process that is killed for one that runs, for a day."""


def stamped(seconds: float) -> Header:
    whole, rest = divmod(round(seconds * 1e9), 10**9)
    return Header(stamp=Time(sec=whole, nanosec=rest), frame_id='scanner')


def wait(graph: Graph, seconds: float) -> None:
    """Let time pass, in which nothing comes."""
    limit = time.monotonic() + seconds
    graph.until(lambda: time.monotonic() > limit)


@pytest.mark.lasting
def test_an_hour_of_a_triggered_scanner_has_no_warning_and_its_end_has_one(
    graph: Graph, tmp_path: Path
) -> None:
    """Its end is that of a process that is killed, of which the middleware does not know."""
    random.seed(48)
    given = overrides(**QUICK, image_timeout=TIMEOUT, use_sim_time='true')
    clock = graph.node.create_publisher(Clock, '/clock', 10)
    detector = DetectorProcess(graph, '/silent', *given)
    said, now, stamps = detector.diagnostics, 100.0, []
    while now < 100.0 + HOUR:
        until = now + random.uniform(11, 600)
        while now < until:
            now += 10.0
            clock.publish(Clock(clock=stamped(now).stamp))
        answer = detector.answer(image_message(PIXELS, stamped(now)))
        stamps.append((answer.header.stamp.sec, answer.header.stamp.nanosec))
        if len(stamps) == 3:
            wait(graph, 2.5 * TIMEOUT)
    assert len(set(stamps)) == len(stamps) > 8
    graph.until(lambda: detector.told('answered') == str(len(stamps)))
    statuses = [it.status[0] for it in said if values(it)['answered'] != '0']
    assert [it.message for it in statuses if it.level != DiagnosticStatus.OK] == []
    graph.node.destroy_publisher(clock)
    graph.node.destroy_publisher(detector.image)
    profile = tmp_path / 'profile.xml'
    profile.write_text(PROFILE)
    names = 'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE'  # Jazzy, Kilted
    environment = {**os.environ, **ros_environment(), **dict.fromkeys(names, str(profile))}
    command = sys.executable, '-c', DRIVER, '/silent/image'
    with subprocess.Popen(command, env=environment) as driver:
        try:
            # The node has then looked at its publisher, too.
            graph.until(lambda: int(detector.told('answered')) > len(stamps))
        finally:
            driver.kill()
    said.clear()
    detector.says('nobody publishes sensor_msgs/msg/Image on /silent/image')
    assert detector.process.end()[0] == 0


def test_no_image_is_identified_that_nobody_asks_for(graph: Graph) -> None:
    given = *own('/asked'), *overrides(**QUICK, image_timeout=0)
    process = graph.start('detector', *given)
    said = graph.listen(DiagnosticArray, '/asked/diagnostics')
    camera = graph.node.create_publisher(Image, '/asked/image', 10)

    def received(wanted: bool) -> None:
        graph.until(lambda: bool(camera.get_subscription_count()) == wanted)

    def message() -> str:
        return graph.newer(said).status[0].message

    assert message().startswith('nobody subscribes to answers, and always is False')
    for number, topic in enumerate(('coded_targets', 'detector/annotations'), 1):
        kind = ImageMarker if topic.endswith('annotations') else CodedTargetArray
        received(False)
        answers: list = []
        asking = graph.node.create_subscription(kind, f'/asked/{topic}', answers.append, 10)
        received(True)
        graph.introduce('/asked/detector')
        camera.publish(image_message(PIXELS, stamped(number)))
        graph.until(lambda answers=answers: answers)
        graph.node.destroy_subscription(asking)
    received(False)
    assert message().startswith('nobody subscribes to answers')
    asked = SetParameters.Request(parameters=[Parameter('always', value=True).to_parameter_msg()])
    (result,) = graph.call(SetParameters, '/asked/detector/set_parameters', asked).results
    assert result.successful
    received(True)
    assert message() == '0 images identified'
    assert process.end()[0] == 0
