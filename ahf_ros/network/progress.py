"""How far an orientation is, told to whoever watches it; nobody does unless `watched` says so.

The stages tell what they do by one line each, so that none of them has a parameter for it.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Progress:
    """A stage of an orientation, how much of it is done in words, and its iteration from 1 on.

    Examples
    --------
    >>> print(Progress('start values', '12 of 36 photographs', 3))
    start values: 12 of 36 photographs, iteration 3
    """

    stage: str
    done: str = ''
    iteration: int = 0

    def __str__(self) -> str:
        """Return a line for people."""
        words = f'{self.stage}: {self.done}' if self.done else self.stage
        return f'{words}, iteration {self.iteration}' if self.iteration else words


Watcher = Callable[[Progress], None]
"""Is called with each step, in the thread that computes."""


class _Watched:
    """Who watches, and what was told last."""

    def __init__(self, watcher: Watcher) -> None:
        self.watcher = watcher
        self.last = Progress('')

    def tell(self, progress: Progress) -> None:
        if progress != self.last:
            self.last = progress
            self.watcher(progress)


_watched: ContextVar[_Watched | None] = ContextVar('watched', default=None)


@contextmanager
def watched(watcher: Watcher | None) -> Iterator[None]:
    """Tell a watcher, if there is one, what is done until the end.

    Examples
    --------
    >>> with watched(print):
    ...     stage('start values', '3 of 8 photographs')
    ...     iteration(1)
    start values: 3 of 8 photographs
    start values: 3 of 8 photographs, iteration 1
    """
    token = _watched.set(_Watched(watcher) if watcher else None)
    try:
        yield
    finally:
        _watched.reset(token)


def stage(name: str, done: str = '') -> None:
    """Tell that a stage has begun, or how much of it is done."""
    if (found := _watched.get()) is not None:
        found.tell(Progress(name, done))


def iteration(number: int) -> None:
    """Tell the iteration of the present stage, from 1 on."""
    if (found := _watched.get()) is not None:
        found.tell(Progress(found.last.stage, found.last.done, number))
