"""Node start-up and shutdown."""

import ctypes
import faulthandler
import math
import os
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, NoReturn

import rclpy
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidHandle, ParameterException
from rclpy.executors import MultiThreadedExecutor
from rclpy.logging import LoggingSeverity, get_logger_effective_level, set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.utilities import remove_ros_args

from ahf_ros.base.ending import ignore_ending, signalled
from ahf_ros.base.text import reason_of, shown
from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.parameters import unknown_parameters
from ahf_ros.nodes.processes import Processes
from ahf_ros.nodes.topics import PUBLISHER, declare_qos, qos_profile

LOG_PERIOD = 5.0
"""Minimum time between two log lines of the same kind about messages, s."""

MAXIMUM_PARAMETERS = 1000
"""Maximum number of parameters in one call of a service."""

ENDING = 60.0
"""Time that a node has to end in order, s; then it says where it waits, and ends at once."""

PAUSE = 1e-3
"""Time between two waits for messages of which the first ended with nothing, s."""

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # of glibc's malloc.h

_PLACE = re.compile(r',? at /\S+:\d+')  # in the sources of rcl, as its errors name it


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


class PatientExecutor(MultiThreadedExecutor):
    """An executor that waits where rclpy's does not, up to Kilted.

    Its shutdown waits for callbacks. While a part of a large message has not arrived, Fast DDS
    ends each wait at once, with nothing: thousands of waits a second took a processor, which the
    part needed, too. So the next wait begins after a pause.
    """

    def __init__(self, num_threads: int) -> None:
        super().__init__(num_threads)
        self._waited, self._condition = -math.inf, lambda: False

    def spin_until(self, ended: Future) -> None:
        """Run callbacks until a future is done.

        rclpy takes it well if another thread ends a subscription that is waited for, but not the
        events of one.
        """
        while not ended.done():
            with suppress(InvalidHandle):
                self.spin_until_future_complete(ended)

    def wait_for_ready_callbacks(
        self,
        timeout_sec: Any = None,
        nodes: Any = None,
        condition: Callable[[], bool] = lambda: False,
    ) -> Any:
        """Return a callback that is ready; rclpy asks for the condition before each wait."""
        self._waited, self._condition = -math.inf, condition
        return super().wait_for_ready_callbacks(timeout_sec, nodes, self._after_pause)

    def _after_pause(self) -> bool:
        """Return whether the condition holds, after a pause if the last wait ended at once."""
        if time.monotonic() - self._waited < PAUSE:
            time.sleep(PAUSE)
        self._waited = time.monotonic()
        return self._condition()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Wait until the callbacks that have begun have ended, then shut down."""
        self._executor.shutdown(wait=True)
        return super().shutdown(timeout_sec)


class ProcessNode(Node):
    """A node with a process of its own."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        for service in self.services:
            service.callback = partial(self._bounded, service.callback)
        self.ended = Ending()  # an exit status ends the node, as a signal does
        self._inputs: list[Input] = []
        self._listening = True
        present = super().get_publishers_info_by_topic('/parameter_events')  # each node has one
        self._processes = Processes(it.endpoint_gid for it in present)
        self.every(1.0, self._follow)

    def introduction(self) -> str:
        """Return what the node will do, for the log at its start; empty if that is not needed."""
        return ''

    def ineffective(self, arguments: Sequence[str]) -> Iterator[str]:
        """Yield a message for each argument and parameter that has no effect on the node."""
        yield from unknown_parameters(self._parameter_overrides, self.get_parameters_by_prefix(''))
        if '--params-file' in arguments and not self._parameter_overrides:
            yield f'the parameter file is for other nodes than {self.get_fully_qualified_name()}'
        if unread := remove_ros_args(arguments):
            meant = '--ros-args -p NAME:=VALUE sets a parameter'
            yield f'arguments {shown(" ".join(unread))} have no effect; {meant}'

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters together; a value that is read only and stays what it is, is no mistake.

        `ros2 param dump` writes these, too, and `ros2 param load` sets them.
        """
        changed = [it for it in parameter_list if not self._is_settled(it)]
        if parameter_list and not changed:
            return SetParametersResult(successful=True)
        return super().set_parameters_atomically(changed)

    def _is_settled(self, given: Parameter) -> bool:
        if not self.has_parameter(given.name) or not self.describe_parameter(given.name).read_only:
            return False
        return str(given.value) == str(self.get_parameter(given.name).value)

    def _bounded(self, answer: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        """Answer a request about parameters, unless it is about more than a node can have."""
        fields = ('parameters', 'names', 'prefixes')
        count = max(len(getattr(request, name, ())) for name in fields)
        if count <= MAXIMUM_PARAMETERS:
            return answer(request, response)
        reason = f'{count} parameters in one call, accepted are at most {MAXIMUM_PARAMETERS}'
        self.get_logger().warning(reason, throttle_duration_sec=LOG_PERIOD)
        refused = SetParametersResult(successful=False, reason=reason)
        if hasattr(response, 'results'):
            response.results = [refused] * count
        elif isinstance(response, SetParametersAtomically.Response):
            response.result = refused
        return response

    def get_publishers_info_by_topic(
        self, topic_name: str, no_mangle: bool = False
    ) -> list[TopicEndpointInfo]:
        """Return who publishes on a topic, without processes that were killed."""
        found = super().get_publishers_info_by_topic(topic_name, no_mangle)
        return [it for it in found if not self._processes.ended(it.endpoint_gid)]

    def close(self) -> None:
        """End the threads of the node, while topics and the log still work."""

    def every(self, period: float, callback: Callable[[], None]) -> None:
        """Call a function every `period` seconds, also where a simulated clock stands still."""
        self.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publisher(self, kind: type, topic: str, depth: int = 1) -> Publisher:
        """Return a publisher, reliable and of this depth unless `qos_overrides` differ."""
        profile = qos_profile(declare_qos(self, PUBLISHER, topic, depth))
        return self.create_publisher(kind, topic, profile)

    def subscribe(
        self,
        kind: type,
        topic: str,
        callback: Callable[[Any], None],
        group: CallbackGroup | None = None,
        lossless: bool = False,
    ) -> Input:
        """Subscribe to a topic, as its publishers offer it unless `qos_overrides` differ.

        Only the latest message is kept; where lossless, every one, and the callback must take each
        at once. In `qos_overrides`, that is called `subscription_lossless`.
        """
        made = Input(self, kind, topic, callback, group, lossless)
        self._inputs.append(made)
        if self._listening:
            made.open()
        return made

    def listen(self, wanted: bool) -> None:
        """Begin or stop to receive messages on all topics that the node subscribes to."""
        self._listening = wanted
        for it in tuple(self._inputs):
            if wanted:
                it.open()
            else:
                it.close()

    def unsubscribe(self, old: Input) -> None:
        """End a subscription."""
        self._inputs.remove(old)
        old.close()

    def _follow(self) -> None:
        for it in tuple(self._inputs):
            it.follow()


def run(make_node: Callable[[], ProcessNode], arguments: list[str] | None = None) -> int:
    """Run a node until it ends itself or receives one of `ending_signals`, and return its status.

    That is 0 after a signal, and 1 if the node cannot start with these arguments, with the reason
    on stderr. A node that does not end within `ENDING` ends the process with 1 and a traceback of
    all threads. Where there are no arguments, `sys.argv` has them.
    """
    reuse_memory()
    outlive_others()
    arrived = signalled()
    given = sys.argv[1:] if arguments is None else arguments
    try:
        set_logger_level('rcl', LoggingSeverity.FATAL)  # its errors are raised as well
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        if get_logger_effective_level('rcl') == LoggingSeverity.FATAL:
            set_logger_level('rcl', LoggingSeverity.UNSET)
        node = make_node()
    except (ValueError, ParameterException, RuntimeError) as error:
        # In one line, without the places in the sources of rcl.
        own = isinstance(error, ValueError)
        print(str(error) if own else _PLACE.sub('', reason_of(error)), file=sys.stderr)
        rclpy.try_shutdown()
        return 1
    for text in node.ineffective(given):
        node.get_logger().warning(text)
    if text := node.introduction():
        node.get_logger().info(text)
    threading.Thread(target=_end_at_signal, args=(node.ended, arrived), daemon=True).start()
    # One thread for a service that takes as long as an identification, one for an image that is
    # written to disk, one for everything short.
    executor = PatientExecutor(num_threads=3)
    executor.add_node(node)
    try:
        executor.spin_until(node.ended)
    finally:
        # Threads that wait for each other in C++ hold up whatever is written in Python.
        faulthandler.dump_traceback_later(ENDING, exit=True, file=2)
        node.close()
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown()
        faulthandler.cancel_dump_traceback_later()
        ignore_ending()
    return node.ended.result()


def outlive_others() -> None:
    """Let a detector of another package that calls `os._exit(0)` fail, and not end this process.

    It would seem to have ended in order. A process that the detector has forked ends as it likes.
    """
    leave, own = os._exit, os.getpid()

    def refused(status: int) -> NoReturn:
        if status or os.getpid() != own:
            leave(status)
        raise SystemExit('os._exit(0) would end the process')

    os._exit = refused


def reuse_memory() -> None:
    """Let the threads of a node share memory, and keep what an image needs for the next one.

    Each search starts threads, and memory that a thread frees stays in its arena. With an arena
    each, the process grew for hours. By default, glibc also takes the memory of every large array
    from the system, which clears it page by page: for an image of 10.6 MP, that took two thirds of
    the time between the middleware and the node, and a tenth of the identification.
    """
    with suppress(AttributeError):  # where malloc is not glibc's
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_M_ARENA_MAX, 2)
        mallopt(_M_MMAP_THRESHOLD, 32 * 2**20)  # the maximum of glibc
        mallopt(_M_TRIM_THRESHOLD, 256 * 2**20)  # buffers of an image of 10 MP


def release_memory() -> None:
    """Give memory back that `reuse_memory` keeps, where no further image is expected."""
    with suppress(AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def _end_at_signal(ended: Future, arrived: int) -> None:
    os.read(arrived, 1)
    ended.set_result(0)
