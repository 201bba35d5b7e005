from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import CancelledError

import pytest

from ahf_ros.nodes.worker import Worker
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


def test_of_the_jobs_that_wait_only_the_latest_runs(worker: Worker) -> None:
    gate, done = Gate(), list[int]()
    assert not worker.offer(gate)
    assert gate.begun.wait(PATIENCE)
    dropped = [worker.offer(lambda number=number: done.append(number)) for number in range(4)]
    gate.opened.set()
    worker.call(lambda: None)
    assert dropped == [False, True, True, True]
    assert done == [3]


def test_a_call_returns_the_result_or_raises_the_error(worker: Worker) -> None:
    assert worker.call(lambda: 7) == 7
    with pytest.raises(ZeroDivisionError):
        worker.call(lambda: 1 // 0)
    assert worker.call(lambda: 8) == 8


def test_every_call_runs_while_jobs_are_offered(worker: Worker) -> None:
    results = []
    for number in range(20):
        worker.offer(lambda: None)
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
    worker.offer(gate)
    assert gate.begun.wait(PATIENCE)
    worker.offer(lambda: done.append(1))
    threading.Timer(0.1, gate.opened.set).start()
    worker.stop()
    assert gate.opened.is_set()
    worker.offer(lambda: done.append(2))
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


def test_only_the_next_job_is_prepared(worker: Worker) -> None:
    gates, prepared = [Gate() for _ in range(4)], [threading.Event() for _ in range(4)]
    for gate, event in zip(gates, prepared, strict=True):
        worker.append(gate, event.set)
    for number, gate in enumerate(gates):
        assert gate.begun.wait(PATIENCE)
        assert all(event.wait(PATIENCE) for event in prepared[: number + 2])
        assert not any(event.is_set() for event in prepared[number + 2 :])
        gate.opened.set()


def test_of_the_jobs_that_wait_one_is_prepared_and_runs_beside_the_latest(worker: Worker) -> None:
    gate, second, done, prepared = Gate(), Gate(), list[int](), list[int]()

    def offer(number: int) -> bool:
        return worker.offer(lambda: done.append(number), lambda: prepared.append(number))

    def prepare() -> None:
        prepared.append(0)
        second()

    assert not worker.offer(gate, lambda: prepared.append(-1))
    assert gate.begun.wait(PATIENCE)
    assert not worker.offer(lambda: done.append(0), prepare)
    assert second.begun.wait(PATIENCE)
    assert [offer(number) for number in range(1, 4)] == [False, True, True]
    assert worker.waiting
    second.opened.set()
    gate.opened.set()
    worker.call(lambda: None)
    assert not worker.waiting
    assert done == [0, 3]
    # The last one is prepared only if its turn comes while the one before it runs.
    assert prepared in ([0], [0, 3])


def test_jobs_are_offered_anew_after_those_that_waited_are_discarded(worker: Worker) -> None:
    done = list[int]()
    worker.pause()
    for number in range(3):
        worker.offer(lambda number=number: done.append(number), lambda: None)
    worker.discard()
    assert not worker.offer(lambda: done.append(3), lambda: None)
    worker.call(lambda: None)
    assert done == [3]
