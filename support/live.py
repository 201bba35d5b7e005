"""Real node processes, and a node of one's own to talk to them with: for benchmarks and tests."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import IO, Any
from unittest import mock

import ahf_ros.blas  # noqa: F401  before numpy, as in processes that are ours

PATIENCE = 60.0
"""Time after which something that does not happen is a failure, s; machines may be slow."""

DOMAINS = range(1, 101)


@cache
def ros_environment() -> dict[str, str]:
    """Return the variables that keep ROS on this machine, in a domain that nobody else tests in.

    The domain is this process's until it ends: a lock on a file says so.
    """
    start = os.getpid() % len(DOMAINS)
    for domain in (*DOMAINS[start:], *DOMAINS[:start]):
        try:
            file = os.open(f'{tempfile.gettempdir()}/ahf_ros_domain_{domain}', os.O_CREAT)
        except PermissionError:  # of another user
            continue
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(file)
            continue
        return {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'ROS_DOMAIN_ID': str(domain)}
    raise RuntimeError('all domains are taken by other tests')


class NodeProcess:
    """A node of this package that runs in a process of its own."""

    def __init__(self, node: str, *arguments: str, folder: Path | None = None) -> None:
        command = [sys.executable, '-m', 'ahf_ros.nodes', node, '--ros-args', *arguments]
        self.awaited = False
        self.output = self.log = ''
        # Not pipes, which hold up a process of which nobody reads the log.
        self._written = [tempfile.TemporaryFile('w+') for _ in range(2)]  # noqa: SIM115
        self.process = subprocess.Popen(
            command,
            env={**os.environ, **ros_environment()},
            stdout=self._written[0],
            stderr=self._written[1],
            cwd=folder,
        )

    def wait(self) -> tuple[int, str]:
        """Return exit status and error output of the process when it has ended.

        What it logs for information is not an error and is left to `log`.
        """
        self.awaited = True
        try:
            self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        self.output, self.log = (self._read(it) for it in self._written)
        lines = self.log.splitlines(keepends=True)
        return self.process.returncode, ''.join(it for it in lines if not it.startswith('[INFO] '))

    def kill(self) -> None:
        """End the process without notice."""
        self.process.kill()
        self.wait()

    @staticmethod
    def _read(written: IO[str]) -> str:
        with written:
            written.seek(0)
            return written.read()

    def end(self, number: signal.Signals = signal.SIGINT) -> tuple[int, str]:
        """Send a signal, then `wait`."""
        self.process.send_signal(number)
        return self.wait()


class Graph:
    """The ROS graph as seen by a node of one's own."""

    def __init__(self, node: Any) -> None:
        self.node = node
        self._processes: list[NodeProcess] = []

    def start(self, node: str, *arguments: str, folder: Path | None = None) -> NodeProcess:
        """Start a node of this package, or of another checkout; it ends with the graph."""
        self._processes.append(NodeProcess(node, *arguments, folder=folder))
        return self._processes[-1]

    def close(self) -> None:
        """End every process that is still running."""
        for item in self._processes:
            if item.process.poll() is None:
                item.end()

    def until(self, condition: Callable[[], Any]) -> Any:
        """Return what the condition gives as soon as it gives something."""
        import rclpy

        limit = time.monotonic() + PATIENCE
        while not (result := condition()):
            assert time.monotonic() < limit, 'waited in vain'
            for item in self._processes:
                assert item.awaited or item.process.poll() is None, item.wait()[1]
            rclpy.spin_once(self.node, timeout_sec=0.05)
        return result

    def listen(self, kind: type, topic: str, depth: int = 100) -> list:
        """Return a list that messages come into, once there is somebody to send them."""
        received: list = []
        self.node.create_subscription(kind, topic, received.append, depth)
        self.until(lambda: self.node.count_publishers(topic))
        return received

    def publisher(self, kind: type, topic: str) -> Any:
        """Return a publisher, once there is somebody to receive its messages."""
        publisher = self.node.create_publisher(kind, topic, 10)
        self.until(publisher.get_subscription_count)
        return publisher

    def call(self, kind: type, service: str, request: Any) -> Any:
        """Return the response of a service.

        A response that is sent before the service has discovered the client gets lost, so that
        the request is repeated if nothing comes.
        """
        client = self.node.create_client(kind, service)
        try:
            self.until(client.service_is_ready)
            calls = [client.call_async(request)]
            repetition = time.monotonic() + PATIENCE / 4

            def answered() -> Any:
                nonlocal repetition
                if time.monotonic() > repetition:
                    repetition += PATIENCE / 4
                    calls.append(client.call_async(request))
                return next((it for it in calls if it.done()), None)

            return self.until(answered).result()
        finally:
            self.node.destroy_client(client)


@contextmanager
def opened() -> Iterator[Graph]:
    """Yield a graph on this machine only, in which nobody else is.

    Raises
    ------
    ModuleNotFoundError
        If ROS 2 is not installed.
    """
    import rclpy

    with mock.patch.dict(os.environ, ros_environment()):
        rclpy.init()
        graph = Graph(rclpy.create_node('test'))
        try:
            yield graph
        finally:
            graph.close()
            graph.node.destroy_node()
            rclpy.shutdown()
