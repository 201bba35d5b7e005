"""A detector behind a ROS 2 service, so that it can be written in any language."""

from __future__ import annotations

import threading
import time

import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.client import Client
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Header

from ahf_ros.nodes.image_msg import image_message
from ahf_ros.nodes.pipeline import STOPPING, Refused
from ahf_ros.nodes.target_msg import identification
from ahf_ros.srv import Identify
from ahf_ros.target import Target

_POLL = 0.2  # s, between two looks at whether there still is somebody to answer
_GONE = 3.0  # s, that a service may seem to be away; discovery takes a moment


class ServiceDetector:
    """Identify targets by a service of type `ahf_ros/srv/Identify`.

    It is called from other threads than those of the node's executor, which bring the answers.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose client it is.
    service : str
    family : str
        Family of the targets.
    timeout : float
        Time limit for one image, s.
    stopping : threading.Event
        Breaks off waiting for an answer.
    """

    def __init__(
        self, node: Node, service: str, family: str, timeout: float, stopping: threading.Event
    ) -> None:
        self.service = service
        self.timeout = timeout
        self._family = family
        self._stopping = stopping
        self._client: Client = node.create_client(
            Identify, service, callback_group=ReentrantCallbackGroup()
        )

    @property
    def name(self) -> str:
        """Name among the detectors of the node."""
        return 'service'

    @property
    def family(self) -> str:
        """Family of the targets, by which the results are named."""
        return self._family

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of an 8-bit gray image; see `ahf_ros.detectors.Detector`.

        Raises
        ------
        ValueError
            If the service is not there, goes away, takes longer than its time limit, or says that
            it does not accept the image; the message names the service.
        Refused
            If the node stops before.
        """
        # What is sent before the service is known to this node gets lost.
        if not self._client.wait_for_service(min(_GONE, self.timeout)):
            raise ValueError(f'{self._named} is not there')
        future = self._client.call_async(Identify.Request(image=image_message(image, Header())))
        try:
            response = self._awaited(future)
        finally:
            self._client.remove_pending_request(future)
        if not response.success:
            raise ValueError(f'{self._named} refuses the image: {response.message}')
        return list(identification(response.coded_targets).targets)

    @property
    def _named(self) -> str:
        return f'service {self.service!r}'

    def _awaited(self, future: Future) -> Identify.Response:
        answered = threading.Event()
        future.add_done_callback(lambda _: answered.set())
        patience = self.timeout
        limit = time.monotonic() + patience
        seen = time.monotonic()
        while not answered.wait(_POLL):
            if self._stopping.is_set():
                raise Refused(STOPPING)
            now = time.monotonic()
            if self._client.service_is_ready():
                seen = now
            elif now - seen > min(_GONE, patience):
                raise ValueError(f'{self._named} is not there')
            if now > limit:
                raise ValueError(
                    f'{self._named} took longer than detector_timeout, {patience:g} s'
                )
        response: Identify.Response = future.result()
        return response
