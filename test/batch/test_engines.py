"""Engines of one machine: order, processes that die, errors, bounds."""

import os
from contextlib import closing
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from ahf_ros.batch import engine
from ahf_ros.batch.engine import (
    EngineLost,
    Finished,
    SerialEngine,
    TaskFailed,
    finished_tasks,
    in_order,
)
from ahf_ros.batch.processes import ProcessEngine
from ahf_ros.cli import main
from support.jobs import do_as_told


class Backwards:
    """An engine that finishes last what it was given first."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.held: list[tuple[int, Any]] = []
        self.largest = 0

    def submit(self, number: int, task: Any) -> None:
        self.held.append((number, task))
        self.largest = max(self.largest, len(self.held))

    def wait(self, timeout: float | None = None) -> tuple[int, Any]:
        number, task = self.held.pop()
        return number, -task

    def close(self) -> None:
        raise AssertionError('an engine outlives its batches')


def test_the_loop_keeps_to_its_bounds_and_the_order_to_the_tasks() -> None:
    engine = Backwards(3)
    drawn: list[int] = []
    tasks = (drawn.append(task) or task for task in range(20))
    found = []
    for item in finished_tasks(engine, tasks, ahead=5):
        found.append(item)
        assert len(drawn) <= len(found) + engine.capacity + 1
        begun = max(it.number for it in found)
        assert begun - min(set(range(21)) - {it.number for it in found}) < 5
    assert engine.largest == 3
    assert [it.number for it in found] != list(range(20))
    assert [(it.task, it.result) for it in in_order(found)] == [(it, -it) for it in range(20)]


def test_workers_that_die_cost_their_task_one_more_try_and_nothing_else(tmp_path: Path) -> None:
    reports: list[Any] = []
    tasks = [
        ('pid', 0),
        ('die once', tmp_path / 'mark'),
        ('die', 0),
        *(('square', number) for number in range(20)),
    ]
    engine = ProcessEngine(do_as_told, 2, report=lambda *report: reports.append(report))
    with closing(engine):
        results = {it.number: it.result for it in finished_tasks(engine, tasks)}
    assert sorted(results) == list(range(len(tasks)))
    assert results[0] != os.getpid()
    assert isinstance(results[1], int)
    assert isinstance(results[2], TaskFailed)
    assert results[2].reason == (
        'given up, 2 processes that worked on it died, the last by SIGKILL'
    )
    assert [results[number] for number in range(3, 23)] == [it**2 for it in range(20)]
    assert sorted(reports)[2:] == [(number + 3, f'square {number}') for number in range(20)]


@pytest.mark.parametrize('engine', [SerialEngine(do_as_told), ProcessEngine(do_as_told, 1)])
def test_what_a_job_raises_ends_the_batch(engine: Any) -> None:
    found: list[Finished[Any, Any]] = []
    with closing(engine), pytest.raises(ValueError, match='it is not accepted'):
        for item in finished_tasks(engine, [('square', 2), ('fail', 'it'), ('square', 3)]):
            found.append(item)
    assert [it.result for it in found] == [4]


def test_the_limit_of_a_container_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, '_LIMIT', tmp_path / 'cpu.max')
    every = engine.available_cores()
    for text, cores in (('max 100000', every), ('50000 100000', 1), ('9900000 100000', every)):
        (tmp_path / 'cpu.max').write_text(text)
        assert engine.available_cores() == cores


class Lost(Backwards):
    """An engine that cannot go on."""

    def wait(self, timeout: float | None = None) -> tuple[int, Any]:
        raise EngineLost('the scheduler is away')

    def close(self) -> None:
        self.held.clear()


@pytest.mark.parametrize('command', ['identify', 'watch', 'bag'])
def test_an_engine_that_is_lost_ends_the_command(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    pytest.importorskip('rosbags', reason='rosbags is not installed')
    (tmp_path / 'image.png').write_bytes(b'image')
    options = {
        'identify': [tmp_path / 'image.png'],
        'watch': [tmp_path, '--output', tmp_path / 'results', '--settling', 0],
        'bag': [tmp_path / 'in', tmp_path / 'out'],
    }
    module = import_module(f'ahf_ros.cli.{command}')
    monkeypatch.setattr(module, 'create_engine', lambda *_, **__: Lost(1))
    assert main([command, *map(str, options[command])]) == 1
    assert f'ahf {command}: the scheduler is away' in capsys.readouterr().err
