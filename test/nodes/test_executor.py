"""The executor of the nodes waits: for callbacks in the end, and between waits in vain."""

import threading
import time
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

import rclpy
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.guard_condition import GuardCondition
from rclpy.waitable import NumberOfEntities, Waitable

from ahf_ros.nodes.process import PAUSE, Ending, PatientExecutor
from support import live

SPENT = 0.25
"""Time for which waits end with nothing, s."""


class Vain(Waitable):
    """What ends a wait at once, and then is not ready, as a message that arrives in parts."""

    def __init__(self) -> None:
        super().__init__(MutuallyExclusiveCallbackGroup())
        self._guard = GuardCondition(None, None)
        self.waits = 0

    def __enter__(self) -> None:
        """Begin a wait."""

    def __exit__(self, *_: object) -> None:
        """End it."""

    def get_num_entities(self) -> NumberOfEntities:
        return NumberOfEntities(0, 1)

    def add_to_wait_set(self, wait_set: Any) -> None:
        self.waits += 1
        self._guard.trigger()
        wait_set.add_guard_condition(self._guard.handle)

    def is_ready(self, wait_set: Any) -> bool:
        return False


def test_the_end_waits_for_callbacks(graph: Any) -> None:
    began, released = threading.Event(), threading.Event()
    ended: list[bool] = []

    def callback() -> None:
        began.set()
        ended.append(released.wait(live.PATIENCE))

    node = rclpy.create_node('ending')
    timer = node.create_timer(0.001, callback)
    executor = PatientExecutor(num_threads=2)
    executor.add_node(node)
    while not began.is_set():
        executor.spin_once(timeout_sec=0.01)
    threading.Timer(0.2, released.set).start()
    executor.shutdown()
    assert ended[0]
    node.destroy_timer(timer)
    node.destroy_node()


def test_a_wait_that_ended_with_nothing_is_not_repeated_at_once(graph: Any) -> None:
    node = rclpy.create_node('patient')
    vain = Vain()
    node.add_waitable(vain)
    executor = PatientExecutor(num_threads=2)
    executor.add_node(node)
    ended = Ending()
    threading.Timer(SPENT, ended.set_result, (0,)).start()
    began = time.monotonic()
    executor.spin_until(ended)
    spent = time.monotonic() - began
    executor.shutdown()
    node.destroy_node()
    assert 1 < vain.waits <= spent / PAUSE + 2
