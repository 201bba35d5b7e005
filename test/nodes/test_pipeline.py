"""From an image message to the message that answers it, without a node round it."""

import gc
import threading
import weakref

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from std_msgs.msg import Header

from ahf_ros.base.settings.nested import assemble
from ahf_ros.identification.stream import message_frame
from ahf_ros.nodes import pipeline
from ahf_ros.nodes.messages import image_message
from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.scenes.scene import SceneSettings, render

SCENE = SceneSettings(width=1000, height=700, targets=6, light='stripe', seed=2)


def test_places_come_from_the_image_as_received() -> None:
    """The traditional detector needs a filter here, which moves centres by 0.02 px."""
    scene = render(SCENE)
    settings = assemble(DetectorNodeSettings, {'detector': 'traditional'})
    made = pipeline.Pipeline(settings, threading.Event())
    frame = message_frame(image_message(scene.image, Header()))
    message = made.message(made.stream.identify(frame, len(scene.targets)))
    assert message.filter.applied
    truth = {target.id: target for target in scene.targets}
    found = message.targets
    assert len(found) == len(truth)
    errors = [(it.x - truth[it.id].x, it.y - truth[it.id].y) for it in found]
    assert np.sqrt(np.mean(np.square(errors)) * 2) < 0.015


def test_nothing_of_old_settings_stays_in_memory() -> None:
    """Cycles of references are collected rarely, and every change of a parameter made one."""
    gc.collect()
    gc.disable()
    try:
        made = pipeline.Pipeline(assemble(DetectorNodeSettings, {}), threading.Event())
        made.stream.identify(message_frame(image_message(np.eye(48, dtype=np.uint8), Header())), 0)
        before = weakref.ref(made)
        del made
        assert before() is None
    finally:
        gc.enable()
