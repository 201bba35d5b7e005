"""Stacks of images in the node `detector`, as a process of its own, over DDS."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ahf_ros.nodes.messages import image_message
from ahf_ros.nodes.settings import IlluminationNodeSettings
from ahf_ros.scenes.scene import SceneSettings, render
from support.detector import DetectorProcess, overrides

pytestmark = pytest.mark.lasting

SCENE = SceneSettings(
    width=400, height=300, targets=4, dot_radius=10, light='stripe', ambient=0.02, phases=4
)
PHASES = [render(SCENE, phase).image for phase in range(4)]
TRUTH = [target.id for target in render(SCENE).targets]
OPTIONS = {
    'family': SCENE.family,
    'queue': 'lossless',
    'stack': 4,
    'expected_targets': 4,
    'ahf': False,
    'stack_timeout': 1e4,
}


@pytest.fixture(scope='module')
def detector(graph: Any) -> DetectorProcess:
    return DetectorProcess(graph, '/stacks', *overrides(**OPTIONS))


def message(pixels: np.ndarray, seconds: int) -> Image:
    header = Header(frame_id='bench')
    header.stamp.sec = seconds
    return image_message(pixels, header)


def sent(detector: DetectorProcess, images: list[Image], answers: int) -> list[tuple[int, list]]:
    """Send images and return the stamps and IDs of the answers."""
    before = len(detector.targets)
    for image in images:
        detector.image.publish(image)
    detector.graph.until(lambda: len(detector.targets) == before + answers)
    found = detector.targets[before:]
    return [(it.header.stamp.sec, [target.id for target in it.targets]) for it in found]


def test_a_stack_is_answered_once_with_the_stamp_of_its_last_image(
    detector: DetectorProcess,
) -> None:
    stream = [message(pixels, 10 + number) for number, pixels in enumerate(PHASES * 2)]
    assert sent(detector, stream, 2) == [(13, TRUTH), (17, TRUTH)]


def test_what_does_not_belong_together_is_answered_and_said(detector: DetectorProcess) -> None:
    detector.graph.newer(detector.diagnostics)
    before = int(detector.told('stacks that were not full'))
    small = [pixels[:-20] for pixels in PHASES]
    stream = [message(pixels, 30 + number) for number, pixels in enumerate(PHASES[:2])]
    stream += [message(pixels, 32 + number) for number, pixels in enumerate(small[:2])]
    stream += [message(pixels, 20 + number) for number, pixels in enumerate(small)]
    stamps = [stamp for stamp, _ in sent(detector, stream, 3)]
    assert stamps == [31, 33, 23]
    after = str(before + 2)
    detector.graph.until(lambda: detector.told('stacks that were not full') == after)
    assert detector.told('rejected') == '0'


def test_a_stack_that_does_not_fill_is_answered_when_its_time_is_up(
    detector: DetectorProcess,
) -> None:
    assert detector.set(('stack_timeout', 0.2)) == (True, '')
    try:
        assert sent(detector, [message(PHASES[0], 50)], 1)[0][0] == 50
    finally:
        assert detector.set(('stack_timeout', 1e4)) == (True, '')


def test_the_illumination_node_shows_all_phases_of_each_scene() -> None:
    scenes = IlluminationNodeSettings(frames=2, scene=SCENE).scenes()
    assert [(scene.seed, phase) for scene, phase in scenes] == [
        (seed, phase) for seed in (0, 1) for phase in range(4)
    ]
