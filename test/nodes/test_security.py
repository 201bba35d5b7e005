"""Who may do what: programs only at the start, and a policy that fits the node."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_msgs.msg import Header

from ahf_ros.nodes.image_queue import WaitingMessages
from ahf_ros.nodes.interfaces import NODES
from ahf_ros.nodes.messages import image_message
from ahf_ros.srv import Identify
from support.detector import overrides

POLICY = Path(__file__).resolve().parents[2] / 'config' / 'security_policy.xml'
STANDARD = ('lifecycle_msgs', 'rcl_interfaces', 'rosgraph_msgs', 'type_description_interfaces')
IMAGE = np.tile(np.arange(64, dtype=np.uint8), (48, 1))


def set_parameter(graph: Any, node: str, name: str, value: object) -> Any:
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    return graph.call(SetParameters, f'{node}/set_parameters', request).results[0]


def test_programs_cannot_be_started_nor_files_read_on_a_running_node(
    graph: Any, tmp_path: Path
) -> None:
    graph.start('detector', '-r', '__ns:=/safe', *overrides(allow_programs='true'))
    mark = tmp_path / 'mark'
    for name, value in (
        ('command', f'touch {mark}'),
        ('detector', 'command'),
        ('service', '/other/identify'),
        ('allow_programs', False),
        ('family_file', '/etc/hostname'),
    ):
        result = set_parameter(graph, '/safe/detector', name, value)
        assert not result.successful
        assert 'read-only' in result.reason
    request = Identify.Request(image=image_message(IMAGE, Header()))
    assert graph.call(Identify, '/safe/detector/identify', request).success
    assert not mark.exists()


def test_garbage_of_a_program_is_named_and_the_node_lives(graph: Any, tmp_path: Path) -> None:
    program = tmp_path / 'program.py'
    given = overrides(detector='command', command=f'python3 {program}', allow_programs='true')
    node = graph.start('detector', '-r', '__ns:=/garbage', *given)
    for target, words in (
        ('{"id": 1, "x": 1, "y": 1, "code": -1}', 'code is -1, accepted is an integer from 0'),
        ('{"id": 1, "x": 1, "y": 1, "covariance": null}', 'covariance is None, accepted are'),
    ):
        text = f'{{"targets": [{target}]}}'
        program.write_text(f'print({text!r})')
        request = Identify.Request(image=image_message(IMAGE, Header()))
        response = graph.call(Identify, '/garbage/detector/identify', request)
        assert not response.success
        assert words in response.message
    program.write_text('print(\'{"targets": [{"id": 1, "x": 10, "y": 20}]}\')')
    (found,) = graph.call(Identify, '/garbage/detector/identify', request).coded_targets.targets
    assert (found.id, found.x, found.y) == (1, 10.0, 20.0)
    status, errors = node.end()
    assert status == 0
    assert 'Traceback' not in errors


def test_all_of_many_requests_at_once_are_answered(graph: Any) -> None:
    graph.start('detector', '-r', '__ns:=/many', *overrides(detector='traditional'))
    # Clients keep ten requests, unless told otherwise.
    count = 60
    kept = QoSProfile(depth=count)
    client = graph.node.create_client(Identify, '/many/detector/identify', qos_profile=kept)
    graph.until(client.service_is_ready)
    graph.introduce('/many/detector')
    request = Identify.Request(image=image_message(IMAGE, Header()))
    futures = [client.call_async(request) for _ in range(count)]
    for number in range(1, count + 1):  # each in its time, however long all of them take
        graph.until(lambda at_least=number: sum(it.done() for it in futures) >= at_least)
    assert all(it.result().success for it in futures)


def test_the_policy_allows_what_a_node_has(graph: Any) -> None:
    graph.start(
        'detector',
        *overrides(
            **dict.fromkeys(('cloud', 'undistort', 'managed', 'autostart', 'always'), 'true')
        ),
    )
    own, node = ('detector', '/'), graph.node
    graph.until(
        lambda: (
            own in node.get_node_names_and_namespaces()
            and node.count_subscribers('/points')
            and node.count_publishers('/diagnostics')
        )
    )
    root = ElementTree.parse(POLICY).getroot()
    profile = root.find(".//enclave[@path='/ahf_ros/detector']//profile")
    assert profile is not None

    def allowed(kind: str, access: str) -> set[str]:
        found = profile.findall(f'{kind}[@{access}="ALLOW"]/{kind[:-1]}')
        return {f'/{it.text}'.replace('/~', '/detector') for it in found}

    published = {name for name, _ in node.get_publisher_names_and_types_by_node(*own)}
    subscribed = {name for name, _ in node.get_subscriber_names_and_types_by_node(*own)}
    served = {name for name, _ in node.get_service_names_and_types_by_node(*own)}
    assert published <= allowed('topics', 'publish')
    assert subscribed <= allowed('topics', 'subscribe')
    assert served <= allowed('services', 'reply')
    described = {
        it.name.lstrip('/').replace('~', 'detector'): it.kind
        for it in NODES['detector'].interfaces
    }
    for find in (
        node.get_publisher_names_and_types_by_node,
        node.get_subscriber_names_and_types_by_node,
        node.get_service_names_and_types_by_node,
    ):
        for name, (kind, *_) in find(*own):
            package, *_, message = kind.split('/')
            if package not in STANDARD:
                assert described[name[1:]] in (kind, f'{package}/{message}'), name
    requests = root.findall('.//services[@request="ALLOW"]/service')
    assert [it.text for it in requests] == ['/detector/identify']


def test_what_waits_is_bounded_in_memory_and_comes_back_in_order() -> None:
    waiting = WaitingMessages()
    images = [image_message(IMAGE + number, Header(frame_id=str(number))) for number in range(50)]
    takes = [waiting.put(it, 2 * len(images[0].data)) for it in images]
    assert waiting._memory == 2 * len(images[0].data)
    assert [take() for take in takes] == images
    assert (waiting._memory, waiting._segment) == (0, None)
