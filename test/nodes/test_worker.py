import threading
from collections.abc import Iterator
from concurrent.futures import CancelledError

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from ahf_ros.nodes.image_queue import Worker
from support.live import PATIENCE


class Gate:
    """A job that runs until it is let go."""

    def __init__(self) -> None:
        self.begun = threading.Event()
        self.opened = threading.Event()

    def __call__(self) -> None:
        self.begun.set()
        assert self.opened.wait(PATIENCE)


@pytest.fixture
def worker() -> Iterator[Worker]:
    worker = Worker()
    yield worker
    worker.stop()


def test_a_call_returns_the_result_or_raises_the_error(worker: Worker) -> None:
    assert worker.call(lambda: 7) == 7
    with pytest.raises(ZeroDivisionError):
        worker.call(lambda: 1 // 0)
    assert worker.call(lambda: 8) == 8


def test_one_job_at_a_time_in_order(worker: Worker) -> None:
    running, done = threading.Lock(), list[int]()

    def job(number: int) -> bool:
        alone = running.acquire(blocking=False)
        done.append(number)
        running.release()
        return alone

    for number in range(0, 100, 2):
        worker.append(lambda number=number: job(number))
        assert worker.call(lambda number=number: job(number + 1))
    assert done == list(range(100))


def test_stopping_waits_for_the_job_that_runs_and_drops_the_others() -> None:
    worker, gate, done = Worker(), Gate(), list[int]()
    worker.append(gate)
    assert gate.begun.wait(PATIENCE)
    worker.append(lambda: done.append(1))
    threading.Timer(0.1, gate.opened.set).start()
    worker.stop()
    assert gate.opened.is_set()
    worker.append(lambda: done.append(2))
    with pytest.raises(CancelledError):
        worker.call(lambda: done.append(3))
    assert done == []


def test_jobs_wait_while_the_worker_is_paused(worker: Worker) -> None:
    gate, done = Gate(), list[int]()
    worker.append(gate)
    for number in range(3):
        worker.append(lambda number=number: done.append(number))
    assert gate.begun.wait(PATIENCE)
    pausing = threading.Thread(target=worker.pause)
    pausing.start()
    gate.opened.set()
    pausing.join(PATIENCE)
    before = list(done)
    worker.append(lambda: done.append(3))
    assert done == before
    worker.resume()
    worker.call(lambda: None)
    assert done == [0, 1, 2, 3]


def test_jobs_that_wait_while_paused_may_be_discarded(worker: Worker) -> None:
    done = list[int]()
    worker.pause()
    for number in range(3):
        worker.append(lambda number=number: done.append(number))
    worker.discard()
    assert worker.call(lambda: 7) == 7
    assert done == []
