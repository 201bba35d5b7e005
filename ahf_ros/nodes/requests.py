"""The services of the node `detector`."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import CancelledError
from functools import partial
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from ahf_ros.nodes.managed import ACTIVE, ManagedNode
from ahf_ros.nodes.pipeline import STOPPING, Pipeline, Refused
from ahf_ros.nodes.worker import Worker
from ahf_ros.srv import Identify

REQUESTS_KEPT = 1000
"""Requests to a service that may wait. The middleware drops more without an answer."""


class Requests:
    """Answers `~/identify` and `~/reset`, one request at a time, while the node is active.

    Parameters
    ----------
    node : ManagedNode
        Has the services.
    worker : Worker
        Does the work, between two images.
    pipeline : callable
        Returns the pipeline in force; called while the node is active.
    attempt : callable
        Returns the result of a job, or counts and logs its error and raises `Refused`.
    """

    def __init__(
        self,
        node: ManagedNode,
        worker: Worker,
        pipeline: Callable[[], Pipeline],
        attempt: Callable[[Callable[[], Any]], Any],
    ) -> None:
        self._node = node
        self._worker = worker
        self._pipeline = pipeline
        self._attempt = attempt
        group = MutuallyExclusiveCallbackGroup()
        kept = QoSProfile(depth=REQUESTS_KEPT)
        for kind, name, answer in (
            (Identify, '~/identify', self._identify),
            (Trigger, '~/reset', self._reset),
        ):
            callback = partial(self._respond, answer)
            node.create_service(kind, name, callback, qos_profile=kept, callback_group=group)

    def _respond(self, answer: Callable[[Any, Any], None], request: Any, response: Any) -> Any:
        state = self._node.state
        if state != ACTIVE:
            response.message = f'the node is {state}, accepted is {ACTIVE}'
            return response
        try:
            answer(request, response)
            response.success = True
        except Refused as error:
            response.message = str(error)
        except CancelledError:
            response.message = STOPPING
        return response

    def _identify(self, request: Identify.Request, response: Identify.Response) -> None:
        expected = request.expected or None
        job = partial(self._pipeline().answer, request.image, expected)
        answer = self._worker.call(partial(self._attempt, job))
        response.coded_targets = answer.message

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> None:
        self._worker.call(self._pipeline().reset)
