"""Files, read and written with errors that name them."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from ahf_ros.interchange.urls import is_url, read_url

RESULTS_FILE = 'results.jsonl'
"""Name of the file in a folder that `ahf identify --output` writes."""

_TRY_LOCK = 0.1  # s between two attempts


@contextmanager
def file_errors(path: str | Path, action: str) -> Iterator[None]:
    """Turn errors of the operating system into a ValueError that names a file.

    Parameters
    ----------
    path : str or Path
        The file.
    action : str
        'read' or 'written', for the message.
    """
    try:
        yield
    except OSError as error:
        raise ValueError(f'{path} cannot be {action}: {error.strerror}') from error


@contextmanager
def locked(folder: str | Path, lock_timeout: float = 0.0) -> Iterator[None]:
    """Lock a folder against other processes, until this process ends at the latest.

    Parameters
    ----------
    folder : str or Path
    lock_timeout : float
        Time to wait for another process that has locked it, s.

    Raises
    ------
    ValueError
        If another process has locked it.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    limit = time.monotonic() + lock_timeout
    try:
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError as error:
                if time.monotonic() >= limit:
                    raise ValueError(f'{folder} is being written by another process') from error
                time.sleep(_TRY_LOCK)
        yield
    finally:
        os.close(descriptor)


def read_bytes(path: str | Path) -> bytes:
    """Return the content of a file or URL, or raise a ValueError that names it."""
    if is_url(str(path)):
        return read_url(str(path))
    with file_errors(path, 'read'):
        return Path(path).read_bytes()


def read_text(path: str | Path) -> str:
    """Return the text of a UTF-8 file, or raise a ValueError that names the file."""
    try:
        return read_bytes(path).decode('utf-8-sig')
    except UnicodeDecodeError as error:
        raise ValueError(f'{path} is not in UTF-8, accepted is a text file') from error


def write_whole(path: str | Path, content: bytes) -> None:
    """Write a file that is never there in part, whatever fails.

    Parameters
    ----------
    path : str or Path
        As for `whole_file`.
    content : bytes

    Raises
    ------
    ValueError
        If the file cannot be written; the message names it.
    """
    with whole_file(path) as file:
        file.write(content)


@contextmanager
def whole_file(path: str | Path) -> Iterator[BinaryIO]:
    """Open a file to write that is never there in part, whatever fails.

    Parameters
    ----------
    path : str or Path
        The file; an existing one is replaced once the new one is complete, a missing folder is
        created. What is no ordinary file, such as a pipe, is written to directly.

    Raises
    ------
    ValueError
        If the file cannot be written; the message names it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with whole_file(f'{folder}/a.txt') as file:
    ...         _ = file.write(b'half')
    ...         print([path.suffix for path in Path(folder).iterdir()])
    ...     print([path.name for path in Path(folder).iterdir()])
    ['.part']
    ['a.txt']
    """
    with file_errors(path, 'written'):
        final = Path(path).resolve()
        if final.exists() and not final.is_file():
            with final.open('wb') as file:
                yield file
            return
        final.parent.mkdir(parents=True, exist_ok=True)
        part = final.with_name(f'.{final.name[:200]}.{os.getpid()}.part')
        part.unlink(missing_ok=True)  # of a killed process of that number, as in containers
        try:
            with part.open('xb') as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            part.replace(final)
        finally:
            part.unlink(missing_ok=True)
