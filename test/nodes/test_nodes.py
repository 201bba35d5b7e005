"""The nodes as processes of their own, over DDS."""

import array
import itertools
import math
import os
import re
import signal
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.diagnostics import ANSWER, SEARCH, STAGES
from ahf_ros.nodes.messages import image_message
from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.scenes.scene import Rendering, SceneSettings, render
from support.detector import DetectorProcess, overrides, values

CONFIG = Path(__file__).parents[2] / 'config' / 'detector.yaml'
SCENE = {'width': 640, 'height': 480, 'targets': 6, 'dot_radius': 10.0}
MAXIMUM_ERROR = 0.1  # px
FAMILY = overrides(family='metashape12')
"""Where it does not matter what is found: `auto` takes ten times as long."""
PATIENT = {'image_timeout': 0}
"""Nothing is said of images that a busy machine has not sent yet."""
ENDLESS = {
    'expected_targets': 50,
    'max_evaluations': 0,
    'population': 10000,
    'generations': 100000,
    'patience': 1000000,
}


def stamp(header: Header) -> tuple[int, int]:
    return header.stamp.sec, header.stamp.nanosec


_numbers = itertools.count(1)


def header() -> Header:
    """Return a header unlike any other."""
    made = Header(frame_id='bench')
    made.stamp.sec = next(_numbers)
    return made


@pytest.fixture(scope='module')
def detector(graph: Any) -> DetectorProcess:
    return DetectorProcess(graph, '/own', '--params-file', str(CONFIG), *FAMILY)


@pytest.fixture(scope='module')
def rendering() -> Rendering:
    return render(SceneSettings(**SCENE))


@pytest.fixture
def message(rendering: Rendering) -> Image:
    return image_message(rendering.image, header())


def assert_true(answer: CodedTargetArray, truth: CodedTargetArray) -> None:
    """Assert that an answer holds the targets of the truth, at the right places."""
    assert [it.id for it in answer.targets] == [it.id for it in truth.targets]
    for found, true in zip(answer.targets, truth.targets, strict=True):
        assert math.hypot(found.x - true.x, found.y - true.y) < MAXIMUM_ERROR
        assert found.code == true.code
        assert found.semi_major == pytest.approx(true.semi_major, abs=0.5)


def test_processes_identify_what_is_there_and_compare_it(graph: Any) -> None:
    illumination = graph.start('illumination', *overrides(**SCENE, rate=4, frames=2, tilt=10))
    detector = graph.start('detector', *overrides(expected_targets=6, **PATIENT))
    truths = graph.listen(CodedTargetArray, '/ground_truth')
    answers = graph.listen(CodedTargetArray, '/coded_targets')
    cameras = graph.listen(CameraInfo, '/camera_info')

    def known() -> list[tuple[CodedTargetArray, CodedTargetArray]]:
        true = {stamp(it.header): it for it in truths}
        identified = [it for it in answers if it.status == CodedTargetArray.OK]
        return [(it, true[stamp(it.header)]) for it in identified if stamp(it.header) in true]

    def both() -> bool:
        return len({truth.targets[0].id for _, truth in known()}) == 2  # two different images

    graph.until(lambda: len(known()) >= 4 and both() and cameras)
    for answer, truth in known():
        assert_true(answer, truth)
        assert answer.header == truth.header
        assert answer.header.frame_id == 'camera'
        assert (answer.width, answer.height, answer.expected) == (640, 480, 6)
        assert (answer.family, truth.family) == ('auto', 'metashape12')
        assert {target.family for target in answer.targets} == {'metashape12'}
        assert not answer.filter.applied
        assert answer.filter.evaluations == 1
    assert (cameras[0].width, cameras[0].height) == (640, 480)
    assert cameras[0].k[0] == cameras[0].k[4] == pytest.approx(1152)
    board = graph.start('scoreboard', *overrides(images=2))
    assert board.wait() == (0, '')
    lines = board.output.splitlines()
    assert len(lines) == 2
    for number, line in enumerate(lines, start=1):
        assert line.startswith(f'image {number}: 6 of 6 right, 0 wrong, 0 false, 0 missed, ')
        assert '; no filter, 1 trial, ' in line
        assert 0 < float(re.search(r'RMSE (.*) px', line).group(1)) < MAXIMUM_ERROR
    for process in (detector, illumination):
        assert process.end() == (0, '')


def test_an_image_without_targets_is_answered(detector: DetectorProcess) -> None:
    noise = np.random.default_rng(0).integers(100, 120, (200, 300), np.uint8)
    answer = detector.answer(image_message(noise, header()))
    assert answer.targets == []
    assert (answer.width, answer.height, answer.expected) == (300, 200, 0)


def test_what_is_refused_is_counted_and_the_node_goes_on(
    graph: Any, detector: DetectorProcess, message: Image
) -> None:
    graph.newer(detector.diagnostics)
    before = int(detector.told('rejected'))
    flat = image_message(np.zeros((100, 100), np.uint8), header())
    short = image_message(np.zeros((100, 100), np.uint8), header())
    short.height = 200
    for count, bad, error in (
        (1, Image(header=header(), encoding='8SC1', height=4, width=4), "encoding is '8SC1'"),
        (2, short, 'data has 10000 bytes, accepted are at least 20000'),
        (3, flat, 'image is constant, 0 everywhere'),
    ):
        detector.image.publish(bad)
        graph.until(lambda count=count: detector.told('rejected') == str(before + count))
        assert detector.told('last reason for rejection').startswith(error)
        assert detector.diagnostics[-1].status[0].name == 'own/detector: identification'
        (answer,) = graph.until(lambda bad=bad: detector.answers_to(bad))
        assert answer.status == CodedTargetArray.REJECTED
        assert answer.reason.startswith(error)
        assert (answer.targets, answer.width, answer.height) == ([], 0, 0)
    answer = detector.answer(message)
    assert len(answer.targets) == SCENE['targets']
    assert (answer.status, answer.reason) == (CodedTargetArray.OK, '')


def test_every_image_has_one_answer(graph: Any, detector: DetectorProcess) -> None:
    """Groups come at once, fewer than the subscription keeps; others wait for all before them.

    AHF_ANSWERS is the number of images, 40 where it is not set.
    """
    groups = [['good']] * 13 + [['damaged']] * 2 + [['unknown'], ['at once'] * 4]
    groups *= int(os.environ.get('AHF_ANSWERS', '40')) // 20
    np.random.default_rng(0).shuffle(groups)
    pixels = render(SceneSettings(width=320, height=240, targets=3, dot_radius=9.0)).image
    sent: list[tuple[str, Header]] = []
    for group in groups:
        for kind in group:
            image = image_message(pixels, header())
            if kind == 'damaged':
                image.data = image.data[:-1]
            if kind == 'unknown':
                image.encoding = 'mono9'
            sent.append((kind, image.header))
            detector.images.publish(image)
        graph.until(
            lambda: {stamp(of) for _, of in sent} <= {stamp(it.header) for it in detector.targets}
        )
    kinds = {stamp(of): kind for kind, of in sent}
    answers = [it for it in detector.targets if stamp(it.header) in kinds]
    assert sorted(stamp(it.header) for it in answers) == sorted(kinds)  # every stamp once
    rejected = {CodedTargetArray.REJECTED}
    accepted = {'good': {CodedTargetArray.OK}, 'damaged': rejected, 'unknown': rejected}
    accepted['at once'] = {CodedTargetArray.OK, CodedTargetArray.DROPPED}
    for it in answers:
        assert it.status in accepted[kinds[stamp(it.header)]]
        assert (it.status == CodedTargetArray.OK) == (it.reason == '') == (len(it.targets) == 3)


def test_the_service_answers_one_image(detector: DetectorProcess, message: Image) -> None:
    response = detector.identify(message, expected=6)
    assert (response.success, response.message) == (True, '')
    assert response.coded_targets.header == message.header
    assert response.coded_targets.expected == 6
    assert str(response.coded_targets.targets) == str(detector.answer(message).targets)  # has NaN
    message.encoding = 'jpeg'
    response = detector.identify(message)
    assert not response.success
    accepted = "encoding is 'jpeg', accepted is one of mono8, mono16, rgb8"
    assert response.message.startswith(accepted)


def test_dark_and_bright_targets_are_told_apart(
    detector: DetectorProcess, rendering: Rendering
) -> None:
    both = np.hstack([rendering.image, 255 - rendering.image])
    answer = detector.answer(image_message(both, header()))
    of = {sign: [it.id for it in answer.targets if it.polarity == sign] for sign in (1, -1)}
    assert of[1] == of[-1] == sorted(it.id for it in rendering.targets)


def test_every_parameter_says_what_it_is(graph: Any, detector: DetectorProcess) -> None:
    items = flat_parameters(DetectorNodeSettings)
    described = graph.call(
        DescribeParameters,
        '/own/detector/describe_parameters',
        DescribeParameters.Request(names=[item.name for item in items]),
    ).descriptors
    for item, descriptor in zip(items, described, strict=True):
        assert descriptor.description == item.description
        assert descriptor.additional_constraints == item.accepted
    by_name = {descriptor.name: descriptor for descriptor in described}
    population = by_name['population'].integer_range[0]
    assert (population.from_value, population.to_value) == (2, 10000)
    assert by_name['crossover'].floating_point_range[0].to_value == 1.0


@pytest.mark.parametrize(
    ('name', 'value', 'words'),
    [
        ('population', 'many', ("population is 'many', accepted is an integer from 2",)),
        ('family', 'qr', ("family is 'qr', accepted is one of metashape12",)),
        ('detector', 'ring', ('read-only',)),
        ('ahf', 1, ('ahf is 1, accepted is true or false',)),
        ('max_radius', 1, ('min_radius is 4.0, accepted is', 'at most max_radius, 1.0')),
    ],
)
def test_a_refused_parameter_is_named(
    detector: DetectorProcess, name: str, value: Any, words: tuple[str, ...]
) -> None:
    before = detector.get(name)
    accepted, reason = detector.set((name, value))
    assert not accepted
    assert all(word in reason for word in words), reason
    assert detector.get(name) == before


def test_parameters_are_checked_and_applied_together(
    detector: DetectorProcess, message: Image
) -> None:
    lower = ('gamma_high_min', 0.5)
    assert not detector.set(lower)[0]
    assert detector.set(lower, ('gamma_low_max', 0.5)) == (True, '')
    assert not detector.set(('polarity', 'bright'), ('min_radius', 9.0), ('max_radius', 8.0))[0]
    assert detector.get('polarity') == 'auto'
    # all back to the defaults, integers where numbers are meant
    assert detector.set(('gamma_high_min', 1), ('gamma_low_max', 1)) == (True, '')
    assert detector.set(('polarity', 'bright')) == (True, '')
    assert detector.answer(message).targets == []
    assert detector.set(('polarity', 'auto')) == (True, '')


def test_one_refused_parameter_of_a_list_leaves_the_others(
    graph: Any, detector: DetectorProcess
) -> None:
    before = detector.get('population')
    pair = [Parameter('seed', value=7), Parameter('population', value=1)]
    response = graph.call(
        SetParameters,
        '/own/detector/set_parameters',
        SetParameters.Request(parameters=[it.to_parameter_msg() for it in pair]),
    )
    assert [result.successful for result in response.results] == [True, False]
    assert (detector.get('seed'), detector.get('population')) == (7, before)


def test_images_for_those_who_look(
    graph: Any, detector: DetectorProcess, rendering: Rendering
) -> None:
    topics = '/own/detector/debug_image', '/own/detector/filtered_image'
    debug, filtered = (graph.listen(Image, topic) for topic in topics)
    message = image_message(rendering.image, header())
    detector.image.publish(message)
    graph.until(lambda: debug and filtered)
    assert debug[0].header == filtered[0].header == message.header
    assert (debug[0].encoding, filtered[0].encoding) == ('bgr8', 'mono8')
    assert (debug[0].width, debug[0].height) == (message.width, message.height)
    assert filtered[0].data == message.data  # no filter was needed
    drawn = np.frombuffer(debug[0].data, np.uint8).reshape(*rendering.image.shape, 3)
    assert (drawn != rendering.image[:, :, None]).any()


def test_diagnostics_tell_where_the_time_of_an_image_went(
    graph: Any, detector: DetectorProcess, message: Image
) -> None:
    detector.reset()  # it searches for a filter again
    assert detector.set(('expected_targets', 7), ('max_evaluations', 3)) == (True, '')
    mean = f'mean {ANSWER} (s)'
    graph.until(lambda: not values(graph.newer(detector.diagnostics))[mean])
    detector.diagnostics.clear()
    detector.answer(message)
    told = graph.until(lambda: [it for it in map(values, detector.diagnostics) if it[mean]])[0]
    last = {stage: float(told[f'{stage} (s)']) for stage in STAGES}
    assert last == {stage: float(told[f'mean {stage} (s)']) for stage in STAGES}
    assert 0 < last[SEARCH] <= last['identification']
    assert all(time >= 0 for time in last.values())
    until_answered = sum(last.values()) - last[SEARCH] - last['other topics']
    assert float(told['latency (s)']) == pytest.approx(until_answered, abs=5e-4)  # rounded
    assert detector.set(('expected_targets', 0), ('max_evaluations', 50)) == (True, '')


def test_parameters_are_answered_and_the_latest_image_waits_during_a_search(
    graph: Any, detector: DetectorProcess, rendering: Rendering
) -> None:

    def received() -> int:
        return int(values(graph.newer(detector.diagnostics))['received'])

    def answers_in_time(duration: float) -> list[CodedTargetArray | None]:
        """Return the answers to four images, none if the search ended before the last one came."""
        images = [image_message(rendering.image, header()) for _ in range(4)]

        def answer(image: Image) -> CodedTargetArray | None:
            return next((it for it in detector.targets if it.header == image.header), None)

        search = *ENDLESS.items(), ('max_duration', duration)
        assert detector.set(*search) == (True, '')
        before = received()
        detector.image.publish(images[0])
        graph.until(lambda: received() > before)
        for image in images[1:3]:
            detector.image.publish(image)
        assert detector.set(('expected_targets', 6)) == (True, '')
        in_time = answer(images[0]) is None
        detector.image.publish(images[3])
        graph.until(lambda: answer(images[3]))
        answers = [answer(image) for image in images]
        searched = [it for it in answers if it and it.filter.evaluations > 1]
        return answers if in_time and searched == answers[:1] else []

    # A machine may be so busy that a short search has ended before the parameters are set.
    first, *between, last = next(filter(None, map(answers_in_time, (2.0, 10.0, 60.0))), [None] * 4)
    assert first is not None
    assert last is not None
    assert (first.expected, last.expected) == (50, 6)
    assert first.filter.evaluations > last.filter.evaluations == 1
    # One of them may have been identified during the search, and waited for its turn.
    waited = [it for it in between if it and it.status == CodedTargetArray.OK]
    assert [it.filter.evaluations for it in waited] in ([], [1])
    assert graph.call(Trigger, '/own/detector/reset', Trigger.Request()).success


def test_no_image_is_lost_in_a_lossless_queue(
    graph: Any, detector: DetectorProcess, rendering: Rendering
) -> None:
    with detector.resubscription('image'):
        assert detector.set(('queue', 'lossless'), ('queue_memory', 1)) == (True, '')
    publisher = graph.node.create_publisher(Image, '/own/image', 30)
    graph.until(publisher.get_subscription_count)
    images = [image_message(rendering.image, header()) for _ in range(30)]
    for image in images:
        publisher.publish(image)
    sent = {stamp(image.header) for image in images}

    def answers() -> list[CodedTargetArray]:
        return [it for it in detector.targets if stamp(it.header) in sent]

    graph.until(lambda: len(answers()) == 30)
    assert [it.header for it in answers()] == [image.header for image in images]
    assert {it.filter.duration for it in answers()} == {0.0}
    with detector.resubscription('image'):
        assert detector.set(('queue', 'latest')) == (True, '')


def test_compressed_images(graph: Any, detector: DetectorProcess, rendering: Rendering) -> None:
    assert detector.set(('image_transport', 'compressed')) == (True, '')
    graph.until(lambda: not detector.image.get_subscription_count())
    publisher = graph.publisher(CompressedImage, '/own/image/compressed')
    _, data = cv2.imencode('.png', rendering.image)
    sent = CompressedImage(header=header(), format='mono8; png compressed')
    sent.data = array.array('B', data.tobytes())
    publisher.publish(sent)
    found = graph.until(
        lambda: next((it for it in detector.targets if it.header == sent.header), None)
    )
    assert [it.id for it in found.targets] == [it.id for it in rendering.targets]
    assert detector.set(('image_transport', 'raw')) == (True, '')
    graph.until(detector.image.get_subscription_count)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_node_in_the_middle_of_a_search(
    graph: Any, message: Image, number: signal.Signals
) -> None:
    space = f'/ending{number}'
    given = overrides(**PATIENT, **ENDLESS)
    detector = DetectorProcess(graph, space, *given, *FAMILY)
    detector.image.publish(message)
    graph.until(lambda: detector.told('received') == '1')
    assert detector.process.end(number) == (0, '')
    assert detector.targets == []


@pytest.mark.lasting
@pytest.mark.parametrize(
    ('node', 'given', 'words'),
    [
        (
            'detector',
            {'min_radius': 70, 'max_radius': 60},
            ('min_radius is 70.0', 'max_radius, 60.0'),
        ),
        ('illumination', {'rate': 0}, ('rate', '0', '0.001')),
        ('detector', {'detector': 'command', 'command': 'some'}, ('allow_programs is False',)),
    ],
)
def test_a_refused_parameter_stops_a_node_at_the_start(
    graph: Any, node: str, given: dict[str, Any], words: tuple[str, ...]
) -> None:
    status, errors = graph.start(node, *overrides(**given)).wait()
    assert status == 1
    assert len(errors.splitlines()) == 1
    assert 'qos_overrides' not in errors
    assert all(word in errors for word in words), errors


@pytest.mark.lasting
def test_a_service_is_a_detector_and_its_end_is_named(
    graph: Any, message: Image, rendering: Rendering
) -> None:
    nameless = graph.start('detector', *overrides(detector='service'))
    status, errors = nameless.wait()
    assert status == 1
    assert "service is '', accepted is the name of a ROS service" in errors
    other = graph.start('detector', '-r', '__ns:=/other', *FAMILY)
    graph.until(lambda: ('detector', '/other') in graph.node.get_node_names_and_namespaces())
    # So long that a busy machine answers in it, so short that a lost answer is asked for again.
    chosen = overrides(
        detector='service', service='/other/detector/identify', detector_timeout=60.0
    )
    detector = DetectorProcess(graph, '/asking', *chosen)
    detector.until_served(message)
    found = detector.answer(message)
    assert [it.id for it in found.targets] == [it.id for it in rendering.targets]
    assert found.family == 'auto'
    other.end()
    response = detector.identify(image_message(rendering.image, header()))
    assert not response.success
    assert response.message == "service '/other/detector/identify' is not there"
    graph.start('detector', '-r', '__ns:=/other', *FAMILY)
    again = graph.until(
        lambda: (it := detector.identify(image_message(rendering.image, header()))).success and it
    )
    assert len(again.coded_targets.targets) == len(rendering.targets)
