"""A detector that calls a ROS 2 service, so that it can be written in any language."""

import queue
import threading
import time
from contextlib import suppress

import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.client import Client
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Header

from ahf_ros.base.target import Target
from ahf_ros.base.target_check import checked_targets
from ahf_ros.base.text import printable
from ahf_ros.files.target_messages import identification_from
from ahf_ros.nodes.messages import image_message
from ahf_ros.nodes.pipeline import Stopping
from ahf_ros.srv import Identify

_POLL = 0.2  # interval between checks that the service still exists, s
_DISCOVERY = 3.0  # time that discovery may take, s


class ServiceDetector:
    """Identify targets by a service of type `ahf_ros/srv/Identify`, each within `timeout`, s.

    Do not call it from threads of the node's executor, which deliver the responses. The event
    `stopping` interrupts waiting for a response.
    """

    name = 'service'

    def __init__(
        self, node: Node, service: str, family: str, timeout: float, stopping: threading.Event
    ) -> None:
        self.service = service
        self.family = family
        self.timeout = timeout
        self._stopping = stopping
        self._client: Client = node.create_client(
            Identify, service, callback_group=ReentrantCallbackGroup()
        )
        self._named = f'service {service!r}'
        self._known = False  # whether the service has answered since it was there

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of an 8-bit gray image; see `ahf_ros.families.Detector`.

        Raises a ValueError that names the service if it does not exist, disappears, exceeds its
        time limit or refuses the image, and `Stopping` if the node stops first.
        """
        # A request that is sent before the service is discovered gets lost.
        if not self._client.wait_for_service(min(_DISCOVERY, self.timeout)):
            raise self._absent()
        response = self._asked(Identify.Request(image=image_message(image, Header())))
        if not response.success:
            raise ValueError(f'{self._named} refuses the image: {printable(response.message)}')
        return checked_targets(identification_from(response.coded_targets).targets, self._named)

    def _absent(self) -> ValueError:
        self._known = False
        return ValueError(f'{self._named} is not there')

    def _asked(self, request: Identify.Request) -> Identify.Response:
        """Return the first response.

        A response gets lost if the service has not discovered this node yet, so that a service
        that has not answered before is asked twice.
        """
        answers: queue.SimpleQueue[Future] = queue.SimpleQueue()
        asked: list[Future] = []

        def ask() -> None:
            asked.append(self._client.call_async(request))
            asked[-1].add_done_callback(answers.put)

        start = seen = time.monotonic()
        repeats = not self._known
        try:
            ask()
            while True:
                with suppress(queue.Empty):
                    response: Identify.Response = answers.get(timeout=_POLL).result()
                    self._known = True
                    return response
                if self._stopping.is_set():
                    raise Stopping
                now = time.monotonic()
                if self._client.service_is_ready():
                    seen = now
                elif now - seen > min(_DISCOVERY, self.timeout):
                    raise self._absent()
                if now - start > self.timeout:
                    limit = f'{self.timeout:g} s'
                    raise ValueError(f'{self._named} took longer than detector_timeout, {limit}')
                if repeats and now - start > self.timeout / 3:
                    repeats = False
                    ask()
        finally:
            for future in asked:
                self._client.remove_pending_request(future)
