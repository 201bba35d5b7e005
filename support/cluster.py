"""A scheduler of dask.distributed and its workers, as processes on this machine."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import distributed

from support import ROOT

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

    def worker(self, name: str, **environment: str) -> subprocess.Popen[bytes]:
        return self._start(
            'worker', self.address, '--no-nanny', '--nthreads', '1', '--name', name,
            '--host', '127.0.0.1', '--local-directory', str(self._folder),
            **environment,
        )  # fmt: skip

    def _start(self, what: str, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, '-m', f'distributed.cli.dask_{what}', '--no-dashboard', *arguments],
            cwd=self._folder,
            env={**os.environ, 'PYTHONPATH': str(ROOT), **environment},
            stderr=(self._folder / f'{what}.log').open('ab'),
        )
        self.callback(process.wait)
        self.callback(process.kill)
        return process
