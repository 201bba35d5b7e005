"""What a detector says of what it was given and what it sees, with what to set instead."""

import array
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import String
from test_nodes import ENDLESS, header

from ahf_ros.nodes.messages import image_message
from ahf_ros.nodes.pipeline import IN_A_ROW
from ahf_ros.scenes.scene import SceneSettings, render
from support.detector import DetectorProcess, overrides, values

pytestmark = pytest.mark.lasting

SCENE = SceneSettings(width=200, height=150, targets=2, dot_radius=8.0, seed=4)


@pytest.fixture(scope='module')
def detector(graph: Any, tmp_path_factory: pytest.TempPathFactory) -> DetectorProcess:
    file = tmp_path_factory.mktemp('families') / 'mine.yaml'
    file.write_text('family: mine\nbits: 9\nband: [1.6, 2.4]\nwords: all\n')
    given = {
        'autostart': 'true',
        'detector': 'traditional',  # as quick as can be
        'family': 'metashape12',
        'family_file': file,
        'qos_overrides./remedies/image.subscription.depth': 5,
        'expected_ids': '100-105',
        'ahf': 'false',
        'image_timeout': 0.1,
        'queue': 'lossless',
    }
    return DetectorProcess(graph, '/remedies', *overrides(**given), subscribed=False)


def test_what_has_no_effect_or_another_type_is_said(graph: Any, detector: DetectorProcess) -> None:
    other = graph.node.create_publisher(String, '/remedies/image', 1)
    detector.says('/remedies/image is of type std_msgs/msg/String, accepted is sensor_msgs/msg/')
    graph.node.destroy_publisher(other)
    detector.says('nobody publishes sensor_msgs/msg/Image on /remedies/image')
    assert detector.set(('image_timeout', 0.0)) == (True, '')


def test_images_in_a_row_without_what_is_expected_are_a_warning(
    graph: Any, detector: DetectorProcess
) -> None:
    scene = render(SCENE)
    ids = sorted(target.id for target in scene.targets)
    detector.image = graph.publisher(Image, '/remedies/image')

    def shows() -> None:
        before = len(detector.targets)
        for _ in range(IN_A_ROW):
            detector.image.publish(image_message(scene.image, header()))
        graph.until(lambda: len(detector.targets) == before + IN_A_ROW)

    shows()
    listed = ', '.join(map(str, ids))
    detector.says(
        f'images in a row show IDs {listed} and none of expected_ids: set expected_ids to those'
    )
    refused, reason = detector.set(('expected_targets', 5))
    words = 'expected_targets is 5 and expected_ids has 6 IDs; accepted with these is their number'
    assert (refused, reason) == (False, f'{words}, or 0')
    assert detector.set(('expected_targets', 5), ('expected_ids', '')) == (True, '')
    shows()
    detector.says('images in a row show 2 targets, N is 5: set expected_targets to what is in vi')
    assert detector.set(('expected_targets', 2)) == (True, '')
    detector.answer(image_message(scene.image, header()))
    # An answer is published before it is counted.
    graph.until(lambda: not values(graph.newer(detector.diagnostics))['advice'])
    assert detector.diagnostics[-1].status[0].level == DiagnosticStatus.OK


def test_data_that_is_too_long_is_rejected_with_the_numbers(detector: DetectorProcess) -> None:
    image = image_message(np.tile(np.arange(40, dtype=np.uint8), (30, 1)), header())
    image.data.extend(bytes(40))
    detector.image.publish(image)
    detector.says('1 images rejected: data has 1240 bytes, accepted are 1200: 30 rows of 40 bytes')
    image.encoding = 'nv21'
    assert detector.answer(image).targets == []


def test_a_dump_of_the_parameters_can_be_loaded(
    graph: Any, detector: DetectorProcess, tmp_path: Path
) -> None:
    assert detector.set(('expected_targets', 0), ('expected_ids', '5')) == (True, '')
    name = '/remedies/detector'
    names = graph.call(ListParameters, f'{name}/list_parameters', ListParameters.Request())
    request = GetParameters.Request(names=names.result.names)
    found = graph.call(GetParameters, f'{name}/get_parameters', request).values
    dumped: dict[str, Any] = {}
    for parameter, value in zip(request.names, found, strict=True):  # as `ros2 param dump` does
        part = dumped
        *parents, last = parameter.split('.')
        for parent in parents:
            part = part.setdefault(parent, {})
        part[last] = parameter_value_to_python(value)
    file = tmp_path / 'dump.yaml'
    file.write_text(yaml.dump({name: {'ros__parameters': dumped}}))
    assert 'cloud_tolerance: 1.0e-06' in file.read_text()
    client = AsyncParameterClient(graph.node, name)
    graph.until(client.services_are_ready)
    loading = client.load_parameter_file(str(file))
    graph.until(loading.done)
    failed = [it.reason for it in loading.result().results if not it.successful]
    assert failed == []
    assert len(loading.result().results) == len(request.names) > 100
    assert (detector.get('cloud_tolerance'), detector.get('expected_ids')) == (1e-6, '5')
    refused, reason = detector.set(('managed', True))
    assert (refused, 'read-only' in reason) == (False, True)
    assert detector.set(('expected_ids', '')) == (True, '')


def test_more_parameters_than_a_node_has_are_refused_at_once(
    graph: Any, detector: DetectorProcess
) -> None:
    count = 10_000
    one = ParameterMessage(name='seed')
    one.value.type, one.value.integer_value = 2, 7
    request = SetParameters.Request(parameters=[one] * count)
    before = detector.get('seed')
    results = graph.call(SetParameters, '/remedies/detector/set_parameters', request).results
    assert len(results) == count
    assert {(it.successful, it.reason) for it in results} == {
        (False, '10000 parameters in one call, accepted are at most 1000')
    }
    assert detector.get('seed') == before
    assert detector.set(*[('seed', 7)] * count) == (False, results[0].reason)


def test_an_image_that_a_decoder_fills_up_is_named_with_its_stamp(
    graph: Any, detector: DetectorProcess
) -> None:
    assert detector.set(('image_transport', 'compressed')) == (True, '')
    camera = graph.publisher(CompressedImage, '/remedies/image/compressed')
    data = cv2.imencode('.jpg', render(SCENE).image)[1].tobytes()
    cut = CompressedImage(header=header(), format='jpeg')
    cut.data = array.array('B', data[: len(data) // 2] + data[-2:])
    camera.publish(cut)
    stamp = f'stamp {cut.header.stamp.sec}.000000000 s'
    detector.says('1 images damaged, the last: the image is damaged: ', stamp)
    graph.until(lambda: detector.targets[-1].header == cut.header)
    assert detector.set(('image_transport', 'raw')) == (True, '')
    graph.until(detector.image.get_subscription_count)


def test_a_camera_that_is_faster_than_the_identification_is_a_warning(
    graph: Any, detector: DetectorProcess
) -> None:
    image = render(SCENE).image
    search = {**ENDLESS, 'ahf': True, 'queue': 'latest'}
    assert detector.set(*search.items()) == (True, '')
    detector.diagnostics.clear()

    def fast() -> bool:
        detector.image.publish(image_message(image, header()))
        return any('were dropped in a row' in it.status[0].message for it in detector.diagnostics)

    graph.until(fast)
    detector.says(
        'images were dropped in a row, because identification is slower than the camera: set '
        'queue to lossless'
    )


def test_two_detectors_on_one_topic_or_of_one_name_say_so(
    graph: Any, detector: DetectorProcess
) -> None:
    named = '2 nodes are named /remedies/detector: give one another name by -r __node:=OTHER'
    every = '/remedies/detector, /remedies/detector, /remedies/second'
    on_one_topic = f'3 nodes publish on /remedies/coded_targets, {every}: give one another topic'
    processes = []
    for name, node in (('third', 'detector'), ('second', 'second')):
        places = '-r', '__ns:=/remedies', '-r', f'__node:={node}', '-r', f'/diagnostics:=/{name}'
        processes.append(graph.start('detector', *places, *overrides(image_timeout=0)))
    for name, words in (('third', named), ('second', on_one_topic)):
        said = graph.listen(DiagnosticArray, f'/{name}')
        graph.until(lambda said=said, words=words: said and words in said[-1].status[0].message)
        assert said[-1].status[0].level == DiagnosticStatus.WARN
    detector.says(named)
    for process, words in zip(processes, (named, on_one_topic), strict=True):
        status, warnings = process.end()
        assert status == 0
        assert words in warnings


def test_the_log_has_what_was_said(detector: DetectorProcess) -> None:
    status, warnings = detector.process.end()
    assert status == 0
    (started,) = [it for it in detector.process.log.splitlines() if '[INFO]' in it][:1]
    assert 'family metashape12, N 6, search for a filter off, queue lossless' in started
    begin = 'qos_overrides./remedies/image.subscription'
    for words in (
        'autostart has no effect: managed is False\n',
        'family_file has no effect: family is metashape12, and the file describes mine\n',
        f'{begin}.depth has no effect: queue is lossless, which needs {begin}_lossless.depth\n',
        '/remedies/image is of type std_msgs/msg/String, accepted is sensor_msgs/msg/Image\n',
        'none of expected_ids: set expected_ids to those of the targets that are there\n',
        '10000 parameters in one call, accepted are at most 1000\n',
    ):
        assert words in warnings
    assert 'remap' not in warnings
    assert re.search(r', stamp \d+\.000000000 s\n', warnings)
    slower = 'because identification is slower than the camera: set queue to lossless'
    assert slower in detector.process.log
