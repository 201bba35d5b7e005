from __future__ import annotations

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


def test_every_call_runs_between_other_jobs(worker: Worker) -> None:
    results = []
    for number in range(20):
        worker.append(lambda: None)
        results.append(worker.call(lambda number=number: number))
    assert results == list(range(20))


def test_one_job_at_a_time(worker: Worker) -> None:
    running = threading.Lock()

    def job() -> bool:
        alone = running.acquire(blocking=False)
        running.release()
        return alone

    assert all(worker.call(job) for _ in range(100))


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


def test_what_is_appended_runs_in_order(worker: Worker) -> None:
    gate, done = Gate(), list[int]()
    worker.append(gate)
    assert gate.begun.wait(PATIENCE)
    for number in range(5):
        worker.append(lambda number=number: done.append(number))
    gate.opened.set()
    worker.call(lambda: None)
    assert done == list(range(5))


def test_what_is_appended_after_the_end_does_not_run() -> None:
    worker, done = Worker(), list[int]()
    worker.stop()
    worker.append(lambda: done.append(1))
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
