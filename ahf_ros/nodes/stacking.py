"""Image messages gathered to stacks, and stacks that do not fill in time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.impl.rcutils_logger import RcutilsLogger
from std_msgs.msg import Header

from ahf_ros.imaging.image import check_image
from ahf_ros.interchange.image_messages import nanoseconds
from ahf_ros.nodes.diagnostics import Tally
from ahf_ros.nodes.pipeline import ImageAnswer, ImageMessage, Pipeline, Refused, decoded
from ahf_ros.nodes.process import LOG_PERIOD, ProcessNode
from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.nodes.waiting import Take
from ahf_ros.stream import Gathered, Window

PERIOD = 0.05
"""Time between two looks at whether a stack is overdue, s."""


class HeldImage:
    """An image that is taken from the queue and decoded when it is first needed.

    Parameters
    ----------
    take : callable
        Returns the message; called once.
    """

    def __init__(self, take: Take) -> None:
        self._take: Take | None = take
        self._decoded: tuple[Header, np.ndarray] | None = None

    def decoded(self) -> tuple[Header, np.ndarray] | None:
        """Return header and image, None if the image was refused before.

        Raises
        ------
        ValueError
            If the image is not accepted, the first time.
        """
        if self._take:
            message = self._take()
            self._take = None
            image = decoded(message)
            check_image(image)
            self._decoded = message.header, image
        return self._decoded


class Stacks:
    """Gathers the images of a node to stacks; thread-safe.

    Parameters
    ----------
    node : ProcessNode
        Has the timer.
    settings : DetectorNodeSettings
        Settings of the node.
    process : callable
        Called with each stack, in order; must return at once.
    """

    def __init__(
        self,
        node: ProcessNode,
        settings: DetectorNodeSettings,
        process: Callable[[Gathered[HeldImage]], None],
    ) -> None:
        self._node = node
        self._settings = _relevant(settings)
        self._timeout = settings.stack_timeout
        self._window: Window[HeldImage] = Window(settings.stacking)
        self._process = process
        self._lock = threading.Lock()
        self._arrived = 0.0
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD, self._end_if_overdue, clock=steady)

    def suits(self, settings: DetectorNodeSettings) -> bool:
        """Return whether other settings of the node would make no difference."""
        return _relevant(settings) == self._settings

    def add(self, image: HeldImage, message: ImageMessage) -> None:
        """Add an image, and process the stacks that this completes or ends."""
        with self._lock:
            self._arrived = time.monotonic()
            for stack in self._window.add(image, image_kind(message), nanoseconds(message.header)):
                self._process(stack)

    def close(self, why: str) -> None:
        """Process what there is, and end."""
        self._node.destroy_timer(self._timer)
        self._end(why)

    def discard(self) -> None:
        """End without processing what there is."""
        self._node.destroy_timer(self._timer)

    def _end_if_overdue(self) -> None:
        with self._lock:
            waiting = self._window.fresh and time.monotonic() - self._arrived
        if waiting > self._timeout:
            self._end(f'no image followed for {self._timeout:g} s')

    def _end(self, why: str) -> None:
        with self._lock:
            for stack in self._window.end(why):
                self._process(stack)


def _relevant(settings: DetectorNodeSettings) -> tuple[object, ...]:
    return settings.stacking, settings.stack_timeout, settings.queue


def image_kind(message: ImageMessage) -> str:
    """Return what the images of a stack have in common."""
    if hasattr(message, 'format'):
        return message.format
    return f'{message.width} x {message.height} px, {message.encoding}'


def answer_stack(
    stack: Gathered[HeldImage],
    pipeline: Pipeline,
    attempt: Callable[[Callable[[], Any]], Any],
    publish: Callable[[ImageAnswer], None],
    tally: Tally,
    logger: RcutilsLogger,
) -> None:
    """Identify the targets of a stack and publish an answer for each of its parts.

    Parameters
    ----------
    stack : Gathered of HeldImage
    pipeline : Pipeline
    attempt : callable
        Returns the result of a job, or counts and logs its error and raises `Refused`.
    publish : callable
        Publishes an answer.
    tally : Tally
        Counts to continue.
    logger : RcutilsLogger
        Gets warnings.
    """
    if stack.reason:
        tally.incomplete += 1
        logger.warning(f'a stack of {stack.reason}', throttle_duration_sec=LOG_PERIOD)
    images: list[tuple[Header, np.ndarray]] = []
    fresh = 0
    for number, held in enumerate(stack.items):
        with suppress(Refused):
            if image := attempt(held.decoded):
                images.append(image)
                fresh += number >= len(stack.items) - stack.fresh

    def answer() -> None:
        for of_part in pipeline.answers(images, fresh):
            if of_part.split:
                tally.split += 1
                text = f'a stack is split: {of_part.split}'
                logger.warning(text, throttle_duration_sec=LOG_PERIOD)
            publish(of_part)

    if fresh:
        with suppress(Refused):
            attempt(answer)
