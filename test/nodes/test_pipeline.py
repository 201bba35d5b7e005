"""From an image message to the message that answers it, without a node round it."""

from __future__ import annotations

import gc
import threading
import weakref
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ahf_ros.interchange.target_messages import identification_from
from ahf_ros.nodes import pipeline
from ahf_ros.nodes.image_msg import image_message
from ahf_ros.nodes.pipeline import ImageJob
from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.settings.nested import assemble
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import Identification

SCENE = SceneSettings(width=1000, height=700, targets=6, light='stripe', seed=2)


def test_places_come_from_the_image_as_received():
    """The traditional detector needs a filter here, which moves centres by 0.02 px."""
    scene = render(SCENE)
    settings = assemble(DetectorNodeSettings, {'detector': 'traditional'})
    made = pipeline.Pipeline(settings, threading.Event())
    answer = made.answer(image_message(scene.image, Header()), len(scene.targets))
    assert answer.message.filter.applied
    truth = {target.id: target for target in scene.targets}
    found = answer.message.targets
    assert len(found) == len(truth)
    errors = [(it.x - truth[it.id].x, it.y - truth[it.id].y) for it in found]
    assert np.sqrt(np.mean(np.square(errors)) * 2) < 0.015


def test_nothing_of_old_settings_stays_in_memory() -> None:
    """Cycles of references are collected rarely, and every change of a parameter made one."""
    gc.collect()
    gc.disable()
    try:
        made = pipeline.Pipeline(assemble(DetectorNodeSettings, {}), threading.Event())
        made.answer(image_message(np.eye(48, dtype=np.uint8), Header()), 0)
        before = weakref.ref(made)
        del made
        assert before() is None
    finally:
        gc.enable()


def test_what_is_identified_ahead_changes_no_answer() -> None:
    """Light that changes, then stays; a filter is searched for, remembered, and forgotten."""
    normal, stripes = (render(replace(SCENE, light=it)).image for it in ('normal', 'stripe'))
    stream = normal, stripes, stripes, stripes, np.zeros((700, 1000), np.uint8), normal
    messages = [image_message(image, Header()) for image in stream]
    given = {'detector': 'traditional', 'expected_targets': 6, 'queue': 'lossless'}
    made = pipeline.Pipeline(assemble(DetectorNodeSettings, given), threading.Event())
    right = []

    def answer(message: Image, speculation: pipeline.Speculation | None) -> Identification | str:
        right.append(bool(speculation) and speculation.before == made._identifier.memory)
        try:
            return identification_from(made.answer(message, speculation=speculation).message)
        except ValueError as error:
            return str(error)

    alone = [answer(message, None) for message in messages]
    made.reset()
    right.clear()
    # Each speculation is made before the answer to the image before.
    ahead, following = [], made.speculation(messages[0])
    for number, message in enumerate(messages):
        speculation = following
        if number + 1 < len(messages):
            following = made.speculation(messages[number + 1])
        ahead.append(answer(message, speculation))
    assert ahead == alone
    assert [isinstance(it, str) or it.filter.applied for it in alone[:5]] == [False] + 4 * [True]
    # The first image under stripes needs a search, and the second one its result.
    assert right[:4] == [True, False, False, True]


def test_an_image_is_outdated_if_it_was_identified_ahead_in_vain() -> None:
    normal, stripes = (render(replace(SCENE, light=it)).image for it in ('normal', 'stripe'))
    given = {'detector': 'traditional', 'expected_targets': 6}
    made = pipeline.Pipeline(assemble(DetectorNodeSettings, given), threading.Event())

    def prepared(image: np.ndarray) -> ImageJob:
        job = ImageJob(lambda: image_message(image, Header()), made)
        job.prepare()
        return job

    assert prepared(stripes).outdated()  # a filter has to be searched for
    assert not prepared(normal).outdated()
    before = prepared(normal)
    assert ImageJob(lambda: image_message(stripes, Header()), made).answer().message.targets
    assert before.outdated()  # the image before has left another filter to begin with
    assert not ImageJob(lambda: image_message(normal, Header()), made).outdated()
