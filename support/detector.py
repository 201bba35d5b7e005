"""The node `detector` as a process of its own, with its parameters and services."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import PurePosixPath
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from ahf_ros.msg import CodedTargetArray
from ahf_ros.srv import Identify
from support.live import Graph


def overrides(**given: Any) -> list[str]:
    """Return command line arguments that set parameters."""
    return [word for name, value in given.items() for word in ('-p', f'{name}:={value}')]


def own(namespace: str) -> tuple[str, ...]:
    """Return the arguments that put a node and its diagnostics into a namespace."""
    return '-r', f'__ns:={namespace}', '-r', f'/diagnostics:={namespace}/diagnostics'


def values(message: DiagnosticArray) -> dict[str, str]:
    """Return what a node says about itself."""
    return {item.key: item.value for item in message.status[0].values}


class DetectorProcess:
    """The node `detector` in a namespace of its own, and what it answers."""

    def __init__(
        self,
        graph: Graph,
        namespace: str,
        *arguments: str,
        images: str = 'image',
        subscribed: bool = True,
    ) -> None:
        self.graph = graph
        self.namespace = namespace
        self.start(*arguments)
        self.targets = graph.listen(CodedTargetArray, f'{self.namespace}/coded_targets')
        if subscribed:
            self.image = graph.publisher(Image, str(PurePosixPath(namespace, images)))

    def start(self, *arguments: str) -> None:
        """Start the process, as after the end of another one."""
        self.process = self.graph.start('detector', *own(self.namespace), *arguments)

    @cached_property
    def diagnostics(self) -> list[DiagnosticArray]:
        """What the node says about itself from now on, at least once."""
        said = self.graph.listen(DiagnosticArray, f'{self.namespace}/diagnostics')
        self.graph.until(lambda: said)
        return said

    def told(self, name: str) -> str:
        """Return what the node said last about something, nothing before it said anything."""
        return values(self.diagnostics[-1])[name] if self.diagnostics else ''

    def says(self, *words: str) -> dict[str, str]:
        """Wait until the diagnostics warn in these words; return their entries."""

        def said() -> DiagnosticStatus | None:
            every = (message.status[0] for message in self.diagnostics)
            return next((it for it in every if words[0] in it.message), None)

        status = self.graph.until(said)
        assert status.level == DiagnosticStatus.WARN
        assert all(it in status.message for it in words), status.message
        self.diagnostics.clear()
        return {item.key: item.value for item in status.values}

    @cached_property
    def images(self) -> Any:
        """A publisher of images that keeps as many as come at once."""
        topic = f'{self.namespace}/image'
        made = self.graph.node.create_publisher(Image, topic, 100)
        known = len(self.graph.node.get_subscriptions_info_by_topic(topic))
        self.graph.until(lambda: made.get_subscription_count() == known)
        return made

    def answers_to(self, message: Image) -> list[CodedTargetArray]:
        """Return what has been answered to an image."""
        return [it for it in self.targets if it.header == message.header]

    def answer(self, message: Image) -> CodedTargetArray:
        """Return the answer to an image."""
        self.image.publish(message)
        return self.graph.until(lambda: self.answers_to(message))[0]

    def identify(self, message: Image, expected: int = 0) -> Identify.Response:
        """Return the answer of the service."""
        request = Identify.Request(image=message, expected=expected)
        return self.graph.call(Identify, f'{self.namespace}/detector/identify', request)

    def until_served(self, message: Image) -> None:
        """Wait until the node has found the service that is its detector."""
        self.graph.until(lambda: self.identify(message).success)

    def reset(self) -> None:
        """Let the node forget what was learnt from earlier images."""
        response = self.graph.call(Trigger, f'{self.namespace}/detector/reset', Trigger.Request())
        assert response.success, response.message

    def set(self, *given: tuple[str, Any]) -> tuple[bool, str]:
        """Set parameters together; return whether they are accepted, or why not."""
        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in given]
        response = self.graph.call(
            SetParametersAtomically,
            f'{self.namespace}/detector/set_parameters_atomically',
            SetParametersAtomically.Request(parameters=parameters),
        )
        return response.result.successful, response.result.reason

    @contextmanager
    def resubscription(self, *topics: str) -> Iterator[None]:
        """Wait until other subscriptions have taken the place of those before.

        They go when the node gets round to it, and what they receive till then gets lost.
        """
        before = [self._subscriptions(it) for it in topics]
        yield

        def replaced() -> bool:
            pairs = zip(map(self._subscriptions, topics), before, strict=True)
            return all(len(now) == 1 and not now & old for now, old in pairs)

        self.graph.until(replaced)

    def _subscriptions(self, topic: str) -> frozenset[tuple[int, ...]]:
        known = self.graph.node.get_subscriptions_info_by_topic(f'{self.namespace}/{topic}')
        return frozenset(tuple(it.endpoint_gid) for it in known)

    def get(self, name: str) -> Any:
        """Return the value of a parameter."""
        response = self.graph.call(
            GetParameters,
            f'{self.namespace}/detector/get_parameters',
            GetParameters.Request(names=[name]),
        )
        return parameter_value_to_python(response.values[0])
