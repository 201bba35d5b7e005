"""Programs of the user's: run with limits of time and output, and ended with this process."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO, Any

from ahf_ros import ending
from ahf_ros.detectors.contract import Unavailable
from ahf_ros.text import MAXIMUM_LENGTH, printable

MAXIMUM_OUTPUT = 64 * 2**20
"""Bytes that a program may write to standard output or standard error."""

_running: set[subprocess.Popen[Any]] = set()
_lock = threading.RLock()  # a signal handler may interrupt its own thread


def check_running(name: str) -> None:
    """Refuse to run a program while this process ends.

    Raises
    ------
    ValueError
        With the name that errors call it.
    """
    if ending.has_begun():
        raise ValueError(f'{name} was ended with this process')


def output_of(words: list[str], folder: Path, timeout: float, name: str) -> str:
    """Run a program and return what it writes to standard output.

    Parameters
    ----------
    words : list of str
        Program and arguments.
    folder : Path
        Empty folder for what it writes.
    timeout : float
        Time limit, s.
    name : str
        What errors call it.

    Raises
    ------
    Unavailable
        If the program cannot be started.
    ValueError
        If it takes longer, writes more than `MAXIMUM_OUTPUT`, ends with another status than 0, or
        this process ends.
    """
    output, errors = folder / 'output', folder / 'errors'
    with output.open('wb') as out, errors.open('wb') as err:
        try:
            # A signal interrupts the main thread only: what another one starts is always known.
            with ThreadPoolExecutor(1) as starter:
                process = starter.submit(_started, words, out, err).result()
        except (OSError, ValueError) as error:  # ValueError: a zero byte in a word
            reason = error.strerror if isinstance(error, OSError) else error
            raise Unavailable(f'{name} cannot be started: {reason}') from error
        try:
            status = _awaited(process, (output, errors), timeout, name)
        finally:
            with _lock:
                _running.discard(process)
            _end(process)
    if status:
        said = printable(_tail(errors).decode(errors='replace').strip())
        how = f'with status {status}' if status > 0 else f'by signal {-status}'
        raise ValueError(f'{name} ended {how}: {said!r}')
    return output.read_text(encoding='utf-8', errors='replace')


def _started(words: list[str], out: IO[bytes], err: IO[bytes]) -> subprocess.Popen[Any]:
    """Start a program that ends with this process, whenever that begins to end."""
    with _lock:
        process = subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True
        )
        _running.add(process)
    if ending.has_begun():
        _kill(process)
    return process


def _awaited(
    process: subprocess.Popen[Any], files: tuple[Path, ...], timeout: float, name: str
) -> int:
    """Return the status of a program, or raise a ValueError as soon as it breaks a limit."""
    limit = time.monotonic() + timeout
    while True:
        check_running(name)
        remaining = limit - time.monotonic()
        status = None
        try:
            status = process.wait(max(min(ending.POLL, remaining), 0))
        except subprocess.TimeoutExpired as error:
            if remaining <= 0:
                raise ValueError(
                    f'{name} took longer than detector_timeout, {timeout:g} s'
                ) from error
        size = max(file.stat().st_size for file in files)
        if size > MAXIMUM_OUTPUT:
            raise ValueError(f'{name} wrote {size} bytes, accepted are at most {MAXIMUM_OUTPUT}')
        if status is not None:
            return status


def _tail(path: Path) -> bytes:
    """Return the last bytes of a file."""
    with path.open('rb') as file:
        file.seek(max(path.stat().st_size - MAXIMUM_LENGTH, 0))
        return file.read()


def _end(process: subprocess.Popen[Any]) -> None:
    """End a process that has not, and all that it started."""
    _kill(process)
    process.wait()


def _kill_running() -> None:
    with _lock:
        running = list(_running)
    for process in running:
        _kill(process)


def _kill(process: subprocess.Popen[Any]) -> None:
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        return


ending.at_begin(_kill_running)
