"""How a node is entered and left."""

from __future__ import annotations

import ctypes
import os
import signal
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

ARENAS = 2
"""Parts of memory that the threads of a node share; glibc would give most of them one each."""

_M_ARENA_MAX = -8  # of glibc's malloc.h

ENDING = {signal.SIGINT, signal.SIGTERM}
"""Signals that end a node."""


class Ending(Future):
    """A future for the one executor that waits for it; it keeps the first callback only.

    Up to Jazzy an executor adds the same one with every spin, and would so grow for ever.
    """

    def __init__(self) -> None:
        super().__init__()
        self._waited_for = False

    def add_done_callback(self, callback: Callable[[Future], None]) -> None:
        """Call `callback` when done, unless another one is called already."""
        if not self._waited_for:
            self._waited_for = True
            super().add_done_callback(callback)


class ProcessNode(Node):
    """A node that is the whole of a process.

    Attributes
    ----------
    ended : Ending of int
        The exit status, as soon as the node is to end, by a signal or of its own accord.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.ended = Ending()

    def close(self) -> None:
        """End the threads of the node; topics and the log still work."""

    def publisher(self, kind: type, topic: str, depth: int = 1) -> Publisher:
        """Return a publisher, reliable and of this depth where `qos_overrides` do not say more."""
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
        """Subscribe to a topic, reliable and of depth 1 where `qos_overrides` do not say more."""
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
        """Subscribe to every message of a topic: those that wait are kept, and hold back others.

        `qos_overrides` name it `subscription_lossless`.
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
    """Run a node until it has ended or gets SIGINT or SIGTERM, and return the exit status.

    Parameters
    ----------
    make_node : callable
        Makes the node, once rclpy is initialised.
    arguments : list of str, optional
        Of the command line; those of the process where not given.

    Returns
    -------
    int
        That with which the node has ended, 0 where a signal ended it; 1 where a parameter given
        at the start is refused: stderr tells which and why.
    """
    _share_memory()
    signalled = _signalled()
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = make_node()
    except (ValueError, ParameterException) as error:
        print(error, file=sys.stderr)
        rclpy.shutdown()
        return 1
    threading.Thread(target=_end_at_signal, args=(node.ended, signalled), daemon=True).start()
    # One thread for a service that takes as long as an identification, one for images that wait
    # for room in a queue, one for all that is short.
    executor = MultiThreadedExecutor(num_threads=3)
    executor.add_node(node)
    try:
        executor.spin_until_future_complete(node.ended)
    finally:
        node.close()
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown()
        for number in ENDING:
            # What is left to do, Python and the middleware do, for some tenths of a second.
            signal.signal(number, signal.SIG_IGN)
    return node.ended.result()


def _share_memory() -> None:
    """Let threads that come and go use the same memory, in which what they free stays.

    Each search has threads of its own. With an arena each, the process grew for hours.
    """
    with suppress(AttributeError):  # where malloc is not that of glibc
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, ARENAS)


def _signalled() -> int:
    """Return a file descriptor that can be read from as soon as there was a signal.

    A node then ends in order, and a second signal, as a terminal and a launch file send for the
    same Ctrl-C, does not break that order off.
    """
    signalled, written = os.pipe()
    os.set_blocking(written, False)
    signal.set_wakeup_fd(written)
    for number in ENDING:
        signal.signal(number, lambda *_: None)
    return signalled


def _end_at_signal(ended: Future, signalled: int) -> None:
    os.read(signalled, 1)
    ended.set_result(0)
