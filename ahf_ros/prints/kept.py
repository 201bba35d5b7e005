"""What data files describe, kept as long as they do not change."""

from collections.abc import Callable
from functools import lru_cache, wraps
from pathlib import Path
from typing import TypeVar

Described = TypeVar('Described')


def kept_while_unchanged(read: Callable[[str], Described]) -> Callable[..., Described]:
    """Return a reader of data files that reads a file again only where it has changed.

    An empty path stands for what this package brings along, which does not change.
    """

    @lru_cache(maxsize=64)
    def kept(path: str, _state: object) -> Described:
        return read(path)

    @wraps(read)
    def reader(path: str = '') -> Described:
        state = Path(path).stat() if path and Path(path).exists() else None
        return kept(path, state and (state.st_mtime_ns, state.st_size))

    return reader
