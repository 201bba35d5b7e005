"""Files, read and written with errors that name them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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


def read_bytes(path: str | Path) -> bytes:
    """Return the content of a file, or raise a ValueError that names the file."""
    with file_errors(path, 'read'):
        return Path(path).read_bytes()


def read_text(path: str | Path) -> str:
    """Return the text of a UTF-8 file, or raise a ValueError that names the file."""
    try:
        return read_bytes(path).decode('utf-8-sig')
    except UnicodeDecodeError as error:
        raise ValueError(f'{path} is not in UTF-8, accepted is a text file') from error
