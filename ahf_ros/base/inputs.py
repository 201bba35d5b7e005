"""The files that a command was named or has read: no output takes the place of one.

What options name is registered where they are parsed, and what that refers to, such as the images
of results, where it is read. A library that reads and writes files has no such list.
"""

import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

_inputs: dict[tuple[int, int], str] | None = None  # names by identity; None outside of commands


@contextmanager
def inputs_kept(names: Iterable[str] = ()) -> Iterator[None]:
    """Register inputs, these to begin with, and keep them from being replaced until the end."""
    global _inputs
    before, _inputs = _inputs, {}
    try:
        for name in names:
            register_input(name)
        yield
    finally:
        _inputs = before


def register_input(path: str | Path) -> None:
    """Register a file as an input; what is no regular file, or not there, is left out."""
    if _inputs is not None and (identity := _identity(path)):
        _inputs[identity] = os.path.abspath(path)  # noqa: PTH100  resolves no link


def release_input(path: str | Path) -> None:
    """Take back that a file is an input: it was read because this command goes on with it."""
    if _inputs is not None and (identity := _identity(path)):
        _inputs.pop(identity, None)


def registered_inputs() -> tuple[str, ...]:
    """Return what is registered, for other processes."""
    return tuple((_inputs or {}).values())


def check_output(path: str | Path) -> None:
    """Raise a ValueError if an output would replace an input, whatever that was called.

    It is the same file if its number is, through links and whatever a file system makes of case.
    """
    identity = _inputs and _identity(path)
    # The number of a file that was removed may be that of another one now.
    if _inputs and identity and identity == _identity(name := _inputs.get(identity, '')):
        raise ValueError(
            f'{path} cannot be written: it is an input, {name}; accepted is another output'
        )


def _identity(path: str | Path) -> tuple[int, int] | None:
    """Return what is the same for all names of a regular file."""
    try:
        status = os.stat(path)  # noqa: PTH116  a name may be no path
    except (OSError, ValueError):
        return None
    return (status.st_dev, status.st_ino) if stat.S_ISREG(status.st_mode) else None
