"""A real scheduler and real workers on this machine, which die."""

import json
import logging
import os
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('distributed', reason='distributed is not installed')
pytest.importorskip('rosbags', reason='rosbags is not installed')

import distributed

from ahf_ros.bag.definitions import typestore
from ahf_ros.batch import cluster
from ahf_ros.batch.cluster import DaskEngine
from ahf_ros.batch.engine import EngineLost, TaskFailed, finished_tasks
from ahf_ros.cli import main
from ahf_ros.files.image_files import write_image
from support import bags, environment
from support.jobs import do_as_told

LIMIT = 300.0


def free_port() -> int:
    with socket.socket() as bound:
        bound.bind(('127.0.0.1', 0))
        port: int = bound.getsockname()[1]
        return port


class LocalCluster(ExitStack):
    """Begins without a scheduler and without workers; all processes end with it."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.address = f'tcp://127.0.0.1:{free_port()}'
        self._folder = folder

    def scheduler(self) -> subprocess.Popen[bytes]:
        """Start a scheduler, and return once it listens."""
        port = self.address.rpartition(':')[2]
        process = self._start('scheduler', '--host', '127.0.0.1', '--port', port)
        limit = time.monotonic() + LIMIT
        while True:
            with suppress(ConnectionRefusedError), socket.create_connection(('127.0.0.1', port)):
                return process
            assert process.poll() is None and time.monotonic() < limit
            time.sleep(0.05)

    def wait_for_workers(self, count: int) -> None:
        with distributed.Client(self.address, timeout=LIMIT, set_as_default=False) as client:
            client.wait_for_workers(count, timeout=LIMIT)

    def worker(self, name: str, **variables: str) -> subprocess.Popen[bytes]:
        return self._start(
            'worker', self.address, '--no-nanny', '--nthreads', '1', '--name', name,
            '--host', '127.0.0.1', '--local-directory', str(self._folder),
            **variables,
        )  # fmt: skip

    def _start(self, what: str, *arguments: str, **variables: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, '-m', f'distributed.cli.dask_{what}', '--no-dashboard', *arguments],
            cwd=self._folder,
            env=environment(**variables),
            stderr=(self._folder / f'{what}.log').open('ab'),
        )
        self.callback(process.wait)
        self.callback(process.kill)
        return process


def lose_one(client: Any) -> None:
    """Let a connection break while a result comes over it, though not that to the scheduler."""
    gather = client._gather

    async def broken(*_: object, **__: object) -> None:
        client._gather = gather
        raise ConnectionResetError('gone')

    client._gather = broken


def test_nothing_is_lost_and_nothing_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    foreign = tmp_path / 'foreign' / 'ahf_ros-0.1.dist-info' / 'METADATA'
    foreign.parent.mkdir(parents=True)
    foreign.write_text('Metadata-Version: 2.1\nName: ahf_ros\nVersion: 0.1\n')
    monkeypatch.setattr(cluster, '_CONNECT', LIMIT)
    said: list[str] = []
    reports: list[tuple[int, str]] = []
    tasks = [('pid', 0), ('die once', str(tmp_path / 'mark')), ('die', 0)]
    tasks += [('square', number) for number in range(60)]
    with LocalCluster(tmp_path) as local:
        scheduler = local.scheduler()
        first, _ = local.worker('first'), local.worker('second')
        local.worker('foreign', PYTHONPATH=str(tmp_path / 'foreign'))
        local.wait_for_workers(3)
        engine = DaskEngine(
            do_as_told, local.address, lambda *it: reports.append(it), said.append,
            lambda result, machine: (result, machine),
        )  # fmt: skip
        with closing(engine):
            results = {}
            for item in finished_tasks(engine, tasks):
                assert item.number not in results
                results[item.number] = item.result[0]
                assert 'tcp://127.0.0.1' in item.result[1]
                if len(results) == 20:
                    first.kill()
                if len(results) == 55:
                    lose_one(engine._client)
        assert sorted(results) == list(range(len(tasks)))
        assert results[0] != os.getpid() and isinstance(results[1], int)
        assert isinstance(results[2], TaskFailed) and 'by SIGKILL' in results[2].reason
        assert [results[number + 3] for number in range(60)] == [it**2 for it in range(60)]
        told = {(number, f'{what} {value}') for number, (what, value) in enumerate(tasks)}
        assert set(reports) <= told and len(reports) > 30
        assert any('has ahf_ros 0.1, accepted is' in text for text in said)

        images = [tmp_path / name for name in ('a.png', 'missing.png', 'b.png')]
        for path in images[::2]:
            write_image(path, np.tile(np.arange(40, dtype=np.uint8), (30, 1)))
        monkeypatch.chdir(tmp_path)
        command = ['identify', *(path.name for path in images), '--json']
        found = []
        for where in (['--jobs', '1'], ['--scheduler', local.address]):
            assert main([*command, '--detector', 'traditional', *where]) == 1
            printed = capsys.readouterr()
            lines = map(json.loads, printed.out.splitlines())
            found.append([{**line, 'elapsed_s': 0} for line in lines])
        assert found[0] == found[1] and len(found[0]) == 2
        assert 'missing.png cannot be read: No such file or directory (on ' in printed.err

        pictures = [np.tile(np.arange(40, dtype=np.uint8) + it, (30, 1)) for it in range(2)]
        pictures[1][:] = 7  # is refused
        sources = [
            bags.write_ros2(tmp_path / name, bags.recorded(typestore(), pictures))
            for name in ('monday', 'tuesday')
        ]
        command = ['bag', *(path.name for path in sources), 'out', '--detector', 'traditional']
        assert main([*command, '--scheduler', local.address]) == 1
        told = capsys.readouterr().err
        for source in sources:
            assert f'out/{source.name}: 2 images answered, 1 of them not accepted' in told
            assert f'ahf bag: {source}: /' in told and 'constant' in told
            answers = [it for _, it in bags.answers(tmp_path / 'out' / source.name)]
            first_answer, second_answer = answers
            assert first_answer.status == first_answer.OK
            assert second_answer.status == second_answer.REJECTED

        with closing(DaskEngine(do_as_told, local.address)) as engine:
            finished = finished_tasks(engine, [('square', number) for number in range(60)])
            assert next(finished).result == 0
            scheduler.kill()
            with pytest.raises(EngineLost, match='is away; the same command goes on'):
                list(finished)
    command = ['identify', 'a.png']
    monkeypatch.setattr(cluster, '_CONNECT', 0.3)
    address = f'tcp://127.0.0.1:{free_port()}'
    assert main([*command, '--scheduler', address]) == 2
    assert f"scheduler is '{address}', accepted is the address" in capsys.readouterr().err


class OtherVersions:
    """A client of a cluster of other versions."""

    def get_versions(self, packages: Sequence[str] = ()) -> dict[str, Any]:
        def version(python: str, distributed: str, release: str | None) -> dict[str, Any]:
            known = {'distributed': distributed, 'ahf_ros': release}
            return {'host': {'python': python}, 'packages': known}

        return {
            'client': version('3.12.3.final.0', '2026.1', '1.0'),
            'scheduler': version('3.12.3.final.0', '2023.4', None),
            'workers': {
                'tcp://a': version('3.1.4.final.0', '2026.1', '1.0'),
                'tcp://b': version('3.12.9.final.0', '2026.1', None),
                'tcp://c': version('3.12.9.final.0', '2026.1', '1.0'),
            },
        }


def test_other_versions_are_named() -> None:
    client = OtherVersions()
    with pytest.raises(ValueError, match=r'has dask\.distributed 2023\.4, accepted is 2026\.1'):
        cluster.check_version(client, 'tcp://b')
    assert cluster.refused_workers(client) == {
        'tcp://a': 'has Python 3.1, accepted is 3.12',
        'tcp://b': 'has ahf_ros not installed, accepted is 1.0',
        'tcp://c': '',
    }


def test_a_lost_connection_is_no_news_to_log() -> None:
    for error, news in ((ConnectionResetError('gone'), False), (ValueError('wrong'), True)):
        record = logging.makeLogRecord({'exc_info': (type(error), error, None)})
        assert cluster._is_news(record) == news
