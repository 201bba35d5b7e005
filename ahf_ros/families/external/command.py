"""A detector that is another program: it gets an image file and prints what it found as JSON.

A program has limits of time and output, and ends with this process, with all that it started. Of
these, processes with a session of their own are found by their environment in /proc; where there
is none, as on macOS, or where they clear their environment, they go on. On Windows, what a program
started is ended with it if it is still there itself.
"""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from secrets import token_hex
from typing import IO, Any, ClassVar

import cv2
import numpy as np

from ahf_ros.base import ending
from ahf_ros.base.target import Target, sorted_targets
from ahf_ros.base.text import MAXIMUM_LENGTH, printable, reason_of
from ahf_ros.families.contract import DetectorSettings, Unavailable
from ahf_ros.files.target_json import targets_from_json
from ahf_ros.vision.image import as_gray, check_image

MAXIMUM_OUTPUT = 64 * 2**20
"""Bytes that a program may write to standard output or standard error."""

_LOOKS = 100  # at most, for processes of a program that ends

_running: dict[subprocess.Popen[Any], str] = {}  # with the marks in their environments
_lock = threading.RLock()  # a signal handler may interrupt its own thread


@dataclass(frozen=True, slots=True)
class CommandDetector:
    """Identify targets by a program of the user's, one process an image.

    The program gets the path of a PNG file, 8 bit gray, where the command says {image}, or else as
    its last argument. It prints one JSON object, {"targets": [{"id": 7, "x": 1.5, "y": 2.5}]};
    of a target further fields of `Target` are accepted, and others of the object left out. So
    `ahf identify --json` is such a program itself.

    A ValueError says if there is no command, or it cannot be split into words.
    """

    settings: DetectorSettings = field(default_factory=DetectorSettings)
    name: ClassVar[str] = 'command'

    def __post_init__(self) -> None:
        """Refuse a command that is none."""
        self._words('image.png')

    @property
    def family(self) -> str:
        """Family of the targets, by which the results are named."""
        return self.settings.family

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`.

        Raises
        ------
        Unavailable
            If the command cannot be started.
        ValueError
            If the image is not accepted; if this process ends; if the temporary folder cannot be
            used; if the command takes longer than its time limit, ends with another status than
            0, or prints what is not accepted.
        """
        check_image(image)
        _check_running(self._named)
        try:
            with tempfile.TemporaryDirectory(prefix='ahf_') as folder:
                path = Path(folder, 'image.png')
                _, encoded = cv2.imencode('.png', as_gray(image).astype(np.uint8, copy=False))
                path.write_bytes(encoded.tobytes())
                words = self._words(str(path))
                timeout = self.settings.detector_timeout
                printed = _output_of(words, Path(folder), timeout, self._named)
        except OSError as error:
            raise ValueError(
                f'{self._named}: the temporary folder cannot be used: {error.strerror}'
            ) from error
        try:
            record = json.loads(printed)
        except (ValueError, RecursionError) as error:
            told = printable(printed.strip())
            raise ValueError(
                f'{self._named} printed {told!r}, accepted is JSON: {reason_of(error)}'
            ) from error
        return sorted_targets(targets_from_json(record, self._named))

    @property
    def _named(self) -> str:
        return f'command {self.settings.command!r}'

    def _words(self, image: str) -> list[str]:
        try:
            words = words_of(self.settings.command)
        except ValueError as error:
            raise ValueError(f'{self._named} cannot be split into words: {error}') from error
        if not words:
            raise ValueError(f'{self._named} is empty, accepted is a program and its arguments')
        if not any('{image}' in word for word in words):
            words.append('{image}')
        return [word.replace('{image}', image) for word in words]


def words_of(command: str, escape: str = '' if os.name == 'nt' else '\\') -> list[str]:
    r"""Return the words of a command, as a shell does; on Windows a backslash is part of a path.

    Examples
    --------
    >>> words_of(r'"C:\My tools\find.exe" --fast C:\a', escape='')
    ['C:\\My tools\\find.exe', '--fast', 'C:\\a']
    >>> words_of(r'./find\ it a')
    ['./find it', 'a']
    """
    words = shlex.shlex(command, posix=True, punctuation_chars=False)
    words.whitespace_split = True
    words.commenters = ''
    words.escape = escape
    return list(words)


def _check_running(name: str) -> None:
    """Refuse to run a program, called by its name, while this process ends."""
    if ending.has_begun():
        raise ValueError(f'{name} was ended with this process')


def _output_of(words: list[str], folder: Path, timeout: float, name: str) -> str:
    """Run a program and return what it writes to standard output, by way of files in a folder."""
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
                mark = _running.pop(process)
            _kill(process, mark)
            process.wait()
    if status:
        with errors.open('rb') as file:
            file.seek(max(errors.stat().st_size - MAXIMUM_LENGTH, 0))
            said = printable(file.read().decode(errors='replace').strip())
        how = f'with status {status}' if status > 0 else f'by signal {-status}'
        raise ValueError(f'{name} ended {how}: {said!r}')
    return output.read_text(encoding='utf-8', errors='replace')


def _started(words: list[str], out: IO[bytes], err: IO[bytes]) -> subprocess.Popen[Any]:
    """Start a program that ends with this process, whenever that begins to end."""
    mark = f'AHF_COMMAND_{token_hex(8)}=1'
    with _lock:
        process = subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=err,
            start_new_session=True,
            env={**os.environ, **dict([mark.split('=')])},
        )
        _running[process] = mark
    if ending.has_begun():
        _kill(process, mark)
    return process


def _awaited(
    process: subprocess.Popen[Any], files: tuple[Path, ...], timeout: float, name: str
) -> int:
    """Return the status of a program, or raise a ValueError as soon as it breaks a limit."""
    limit = time.monotonic() + timeout
    status = None
    while status is None:
        _check_running(name)
        remaining = limit - time.monotonic()
        with suppress(subprocess.TimeoutExpired):
            status = process.wait(max(min(ending.POLL, remaining), 0))
        if status is None and remaining <= 0:
            raise ValueError(f'{name} took longer than detector_timeout, {timeout:g} s')
        size = max(file.stat().st_size for file in files)
        if size > MAXIMUM_OUTPUT:
            raise ValueError(f'{name} wrote {size} bytes, accepted are at most {MAXIMUM_OUTPUT}')
    return status


def _kill_running() -> None:
    with _lock:
        running = list(_running.items())
    for process, mark in running:
        _kill(process, mark)


def _kill(process: subprocess.Popen[Any], mark: str) -> None:
    """End a process that has not, and all that it started: these have a mark in their environment.

    What they start meanwhile is found by another look.
    """
    if not hasattr(os, 'killpg'):
        _kill_tree(process)
        return
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    for _ in range(_LOOKS):
        found = [pid for pid in _marked(mark) if pid != process.pid]
        for pid in found:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        if not found:
            return


def _kill_tree(process: subprocess.Popen[Any]) -> None:
    """End a process and what it started with the tool that Windows has for it."""
    if process.poll() is not None:
        return
    with suppress(OSError):  # there is no such tool
        tool = ['taskkill', '/F', '/T', '/PID', str(process.pid)]
        subprocess.run(tool, capture_output=True)
    process.kill()


def _marked(mark: str) -> Iterator[int]:
    """Yield the processes of this user that have a mark in their environment."""
    for environment in Path('/proc').glob('[0-9]*/environ'):
        with suppress(OSError):
            if mark.encode() in environment.read_bytes().split(b'\0'):
                yield int(environment.parent.name)


ending.at_begin(_kill_running)
