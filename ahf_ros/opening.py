"""Errors of files that name them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def file_errors(path: str | Path, action: str) -> Iterator[None]:
    """Turn errors of the operating system into a ValueError: the file 'cannot be' `action`."""
    try:
        yield
    except OSError as error:
        raise ValueError(f'{path} cannot be {action}: {error.strerror}') from error
