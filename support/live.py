"""Real node processes, and a node of one's own to talk to them with: for benchmarks and tests."""

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

PATIENCE = 180.0
"""Time after which something that does not happen is a failure, s; machines may be slow."""

AGAIN = 1.0
"""Time after which what may have got lost is sent again, s."""

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


def errors_of(log: str) -> str:
    """Return the errors among what nodes write to standard error.

    Information is none, nor is a port of shared memory that a process of whatever domain takes at
    the same moment: Fast DDS says so and takes the next one. Nor is that this machine is slow.
    """
    lines = log.splitlines(keepends=True)
    none = 'Failed init_port', 'identification is slower than the camera'
    return ''.join(
        it for it in lines if not it.startswith('[INFO] ') and not any(text in it for text in none)
    )


class NodeProcess:
    """A node of this package that runs in a process of its own."""

    def __init__(self, node: str, *arguments: str, folder: Path | None = None) -> None:
        # A response to a client that the node does not know yet; the request is sent again.
        unwarned = '-W', 'ignore:failed to send response'
        command = [sys.executable, *unwarned, '-m', 'ahf_ros.nodes', node]
        command += ['--ros-args', *arguments]
        self.awaited = False
        self.output = self.log = ''
        # Not pipes, which hold up a process whose log nobody reads.
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
        return self.process.returncode, errors_of(self.log)

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
        self._clients: dict[tuple[type, str], Any] = {}

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

    def listen(self, kind: type, topic: str, depth: int = 100) -> list[Any]:
        """Return a list that messages come into, once there is somebody to send them."""
        received: list[Any] = []
        self.node.create_subscription(kind, topic, received.append, depth)
        for publisher in self.until(lambda: self._publishers(topic)):
            self.introduce(publisher)
        return received

    def newer(self, received: list[Any]) -> Any:
        """Return the last of the messages that a list gets, once one was stamped after now."""
        now = self.node.get_clock().now().to_msg()

        def is_newer() -> bool:
            stamp = received[-1].header.stamp
            return (stamp.sec, stamp.nanosec) > (now.sec, now.nanosec)

        self.until(lambda: received and is_newer())
        return received[-1]

    def _publishers(self, topic: str) -> set[str]:
        """Return the nodes that publish on a topic, none unless all of them are known by name."""
        found = self.node.get_publishers_info_by_topic(topic)
        nodes = {(it.node_namespace, it.node_name) for it in found}
        known = {(space, name) for name, space in self.node.get_node_names_and_namespaces()}
        if not nodes <= known:
            return set()
        return {f'{namespace.rstrip("/")}/{name}' for namespace, name in nodes}

    def introduce(self, node: str) -> None:
        """Return when a node knows all subscriptions and clients that are here already.

        What it sends to one that it does not know gets lost: it waits for 0.1 s with a response,
        then drops it (ros2/rmw_fastrtps#467). Once it has answered a new client, it has heard of
        what was here before, as announcements come in order.
        """
        from rcl_interfaces.srv import GetParameters

        client = self.node.create_client(GetParameters, f'{node}/get_parameters')
        try:
            self._response(client, GetParameters.Request(), AGAIN)
        finally:
            self.node.destroy_client(client)

    def publisher(self, kind: type, topic: str) -> Any:
        """Return a publisher, once there is somebody to receive its messages."""
        publisher = self.node.create_publisher(kind, topic, 10)
        self.until(publisher.get_subscription_count)
        return publisher

    def call(self, kind: type, service: str, request: Any) -> Any:
        """Return the response of a service of a node."""
        client = self._clients.get((kind, service))
        if client is None:
            client = self._clients[kind, service] = self.node.create_client(kind, service)
            self.introduce(service.rpartition('/')[0])
        return self._response(client, request, PATIENCE / 4)

    def _response(self, client: Any, request: Any, patience: float) -> Any:
        """Return the response to a request, which is sent again after some time without one."""
        self.until(client.service_is_ready)
        calls = [client.call_async(request)]
        repetition = time.monotonic() + patience

        def answered() -> Any:
            nonlocal repetition
            if time.monotonic() > repetition:
                repetition += patience
                calls.append(client.call_async(request))
            return next((it for it in calls if it.done()), None)

        return self.until(answered).result()


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
