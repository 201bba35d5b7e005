"""The detector that calls a ROS 2 service, in one process with the service."""

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from ahf_ros.nodes.service_detector import ServiceDetector
from ahf_ros.srv import Identify


def test_a_lost_response_is_asked_for_again_by_who_had_none_before(graph: Any) -> None:
    asked: list[int] = []

    def answer(request: Identify.Request, response: Identify.Response) -> Identify.Response:
        asked.append(request.image.width)
        response.success = True
        return response

    service = graph.node.create_service(Identify, '/lossy', answer)
    send = service.send_response
    service.send_response = lambda *response: send(*response) if len(asked) > 1 else None
    detector = ServiceDetector(graph.node, '/lossy', 'metashape12', 9.0, threading.Event())
    with ThreadPoolExecutor(1) as pool:
        for width in (3, 4):
            found = pool.submit(detector, np.zeros((2, width), np.uint8))
            graph.until(found.done)
            assert found.result() == []
        assert asked == [3, 3, 4]
        service.send_response = lambda *response: None
        detector.timeout = 1.0
        lost = pool.submit(detector, np.zeros((2, 5), np.uint8))
        graph.until(lambda: lost.done() and len(asked) == 4)
        with pytest.raises(ValueError, match='took longer than detector_timeout, 1 s'):
            lost.result()
        assert asked == [3, 3, 4, 5]
    graph.node.destroy_service(service)
