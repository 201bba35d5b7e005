"""Which images of a queue are identified, which are dropped, and what is said of them."""

import threading
from typing import Any
from unittest import mock

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ahf_ros.base.settings.nested import assemble
from ahf_ros.nodes.diagnostics import Tally
from ahf_ros.nodes.image_queue import ImageQueue, Worker
from ahf_ros.nodes.messages import image_message
from ahf_ros.nodes.pipeline import Pipeline
from ahf_ros.nodes.settings import DetectorNodeSettings

PIXELS = np.tile(np.arange(40, dtype=np.uint8), (30, 1))


class Finder:
    """A detector that finds nothing, or fails as it is told."""

    name = family = 'finder'

    def __init__(self) -> None:
        self.error: Exception | None = None

    def __call__(self, image: np.ndarray) -> list:
        if self.error:
            raise self.error
        return []


class Bench:
    """A queue, and what becomes of the images in it."""

    def __init__(self, worker: Worker, **given: Any) -> None:
        self.worker = worker
        self.answers: list[list[int]] = []
        self.tally = Tally()
        self.detector = Finder()
        publisher = mock.Mock()
        publisher.publish = self._publish
        self.queue = ImageQueue(mock.MagicMock(), worker, publisher, self.tally)
        self.renew(**given)

    def renew(self, **given: Any) -> None:
        settings = assemble(DetectorNodeSettings, given)
        self.queue.renew(Pipeline(settings, threading.Event(), self.detector))

    def _publish(self, answer: Any, *_: Any) -> None:
        self.answers.append([header.stamp.sec for header in answer.items])
        self.tally.answered += answer.fresh

    def put(self, *seconds: int, pixels: np.ndarray = PIXELS) -> None:
        for number in seconds:
            header = Header()
            header.stamp.sec = number
            self.queue.put(image_message(pixels, header))

    def work(self) -> None:
        """Let the worker do what waits."""
        self.worker.resume()
        self.worker.call(lambda: None)
        self.worker.pause()


@pytest.fixture
def worker() -> Any:
    worker = Worker()
    worker.pause()
    yield worker
    worker.stop()


def test_of_the_images_that_wait_the_latest_is_identified(worker: Worker) -> None:
    bench = Bench(worker)
    bench.put(1, 2, 3)
    bench.work()
    bench.put(4)
    bench.work()
    assert bench.answers == [[3], [4]]
    assert (bench.tally.received, bench.tally.answered, bench.tally.dropped) == (4, 2, 2)


def test_images_that_are_dropped_in_a_row_are_counted_until_none_waits(worker: Worker) -> None:
    bench = Bench(worker)
    bench.put(*range(1, 11))
    assert (bench.tally.behind, bench.tally.slow) == (9, '')
    bench.put(11)
    assert bench.tally.slow.startswith('10 images were dropped in a row')
    bench.work()
    assert (bench.tally.behind, bench.tally.slow, bench.tally.dropped) == (0, '', 10)


def test_every_image_of_a_lossless_queue_is_identified(worker: Worker) -> None:
    bench = Bench(worker, queue='lossless', queue_memory=1)
    large = np.tile(np.arange(1000, dtype=np.uint8), (700, 1))
    bench.put(*range(1, 6), pixels=large)  # not all of them have room in memory
    bench.renew(queue='latest')
    bench.put(6, 7)
    bench.work()
    assert bench.answers == [[1], [2], [3], [4], [5], [7]]
    assert bench.tally.dropped == 1


@pytest.mark.parametrize('window', ['tumbling', 'sliding'])
def test_a_stack_has_no_images_on_both_sides_of_a_gap(worker: Worker, window: str) -> None:
    bench = Bench(worker, stack=3, stack_window=window)
    bench.put(1, 2)
    bench.work()
    bench.put(3, 4, 5, 6)  # 3 is dropped, so that 1 and 2 wait in vain
    bench.work()
    assert bench.answers == [[4, 5, 6]]
    tally = bench.tally
    assert (tally.received, tally.answered, tally.dropped) == (6, 3, 3)


def test_parameters_end_a_stack(worker: Worker) -> None:
    bench = Bench(worker, stack=3, queue='lossless')
    bench.put(1, 2)
    bench.renew(stack=2, queue='lossless')
    bench.put(3, 4, 5)
    bench.work()
    bench.renew(queue='lossless')
    bench.work()
    assert bench.answers == [[1, 2], [3, 4], [5]]
    assert bench.tally.incomplete == 2


def test_what_a_detector_raises_is_counted_and_ends_nothing(worker: Worker) -> None:
    bench = Bench(worker)
    for error in (RuntimeError('out of order'), ValueError('too dark')):
        bench.detector.error = error
        bench.put(1)
        bench.work()
        assert bench.tally.reason.endswith(str(error))
    with pytest.raises(ValueError, match='too dark'):
        bench.queue.identify(image_message(PIXELS, Header()))
    bench.detector.error = None
    bench.put(2)
    bench.work()
    bench.queue.put(Image(encoding='8SC1', height=4, width=4))
    bench.work()
    assert bench.answers == [[2]]
    assert bench.tally.rejected == 4


def test_what_is_discarded_is_not_identified(worker: Worker) -> None:
    bench = Bench(worker, stack=2, queue='lossless')
    bench.put(1)
    bench.work()
    bench.put(2)
    bench.queue.discard()
    worker.pause()
    bench.renew(stack=2, queue='lossless')
    bench.put(3, 4)
    bench.work()
    assert bench.answers == [[3, 4]]
