"""Node start-up and shutdown."""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import rclpy
from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import ParameterException
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.task import Future

from ahf_ros.ending import ignore_ending
from ahf_ros.nodes.signals import signalled
from ahf_ros.text import reason_of

ARENAS = 2
"""Number of memory arenas that the threads of a node share; glibc would give each its own."""

_M_ARENA_MAX = -8  # of glibc's malloc.h


class Ending(Future):
    """A future for a single executor, which keeps only the first callback.

    Up to Jazzy, an executor adds the same callback with every spin, and memory would grow.
    """

    def __init__(self) -> None:
        super().__init__()
        self._waited_for = False

    def add_done_callback(self, callback: Callable[[Future], None]) -> None:
        """Call `callback` when done, unless there is one already."""
        if not self._waited_for:
            self._waited_for = True
            super().add_done_callback(callback)


class JoiningExecutor(MultiThreadedExecutor):
    """An executor whose shutdown waits for callbacks, which rclpy's does not up to Kilted."""

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Wait until the callbacks that have begun have ended, then shut down."""
        self._executor.shutdown(wait=True)
        return super().shutdown(timeout_sec)


class ProcessNode(Node):
    """A node with a process of its own.

    Attributes
    ----------
    ended : Ending of int
        Exit status; set it to end the node. A signal sets it, too.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.ended = Ending()

    def close(self) -> None:
        """End the threads of the node, while topics and the log still work."""

    def publisher(self, kind: type, topic: str, depth: int = 1) -> Publisher:
        """Return a publisher, reliable and of this depth unless `qos_overrides` differ."""
        options = QoSOverridingOptions.with_default_policies()
        return self.create_publisher(
            kind, topic, QoSProfile(depth=depth), qos_overriding_options=options
        )

    def subscribe(
        self,
        kind: type,
        topic: str,
        callback: Callable[[Any], None],
        group: CallbackGroup | None = None,
    ) -> Subscription:
        """Subscribe to a topic, reliable and of depth 1 unless `qos_overrides` differ."""
        options = QoSOverridingOptions.with_default_policies()
        return self.create_subscription(
            kind,
            topic,
            callback,
            QoSProfile(depth=1),
            callback_group=group,
            qos_overriding_options=options,
        )

    def subscribe_to_all(
        self, kind: type, topic: str, callback: Callable[[Any], None], group: CallbackGroup
    ) -> Subscription:
        """Subscribe to every message of a topic; the callback must take each at once.

        In `qos_overrides` it is called `subscription_lossless`.
        """
        options = QoSOverridingOptions.with_default_policies(entity_id='lossless')
        return self.create_subscription(
            kind,
            topic,
            callback,
            QoSProfile(history=HistoryPolicy.KEEP_ALL),
            callback_group=group,
            qos_overriding_options=options,
        )


def run(make_node: Callable[[], ProcessNode], arguments: list[str] | None = None) -> int:
    """Run a node until it ends itself or receives one of `ending_signals`.

    Parameters
    ----------
    make_node : callable
        Returns the node; called when rclpy is initialised.
    arguments : list of str, optional
        Command line arguments; those of the process where None.

    Returns
    -------
    int
        Exit status: that of the node, 0 after a signal, 1 if the node cannot start with these
        arguments, with the reason on stderr.
    """
    _share_memory()
    arrived = signalled()
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
    except (ValueError, ParameterException, RuntimeError) as error:
        print(error if isinstance(error, ValueError) else reason_of(error), file=sys.stderr)
        rclpy.try_shutdown()
        return 1
    threading.Thread(target=_end_at_signal, args=(node.ended, arrived), daemon=True).start()
    # One thread for a service that takes as long as an identification, one for an image that waits
    # for room in the queue, one for everything short.
    executor = JoiningExecutor(num_threads=3)
    executor.add_node(node)
    try:
        executor.spin_until_future_complete(node.ended)
    finally:
        node.close()
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown()
        ignore_ending()
    return node.ended.result()


def _share_memory() -> None:
    """Let threads share arenas, because memory that a thread frees stays in its arena.

    Each search starts threads. With an arena each, the process grew for hours.
    """
    with suppress(AttributeError):  # where malloc is not that of glibc
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, ARENAS)


def _end_at_signal(ended: Future, arrived: int) -> None:
    os.read(arrived, 1)
    ended.set_result(0)
