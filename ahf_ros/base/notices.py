"""What is said once of an image, however often it is searched: that some of many are left out."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_LOG = logging.getLogger(__name__)
_said: ContextVar[set[str] | None] = ContextVar('said', default=None)


@contextmanager
def said_once() -> Iterator[None]:
    """Say each thing once until the end; may be nested, and a decorator.

    Examples
    --------
    >>> with said_once():
    ...     tell_left_out(7000, 'candidates', 6000)
    ...     tell_left_out(6500, 'candidates', 6000)
    """
    if _said.get() is not None:
        yield
        return
    token = _said.set(set())
    try:
        yield
    finally:
        _said.reset(token)


def tell_left_out(count: int, what: str, limit: int) -> None:
    """Warn that of so many only the best are looked at, unless that is said already."""
    said = _said.get()
    if said is None or what not in said:
        _LOG.warning('%d %s; the %d best are looked at', count, what, limit)
    if said is not None:
        said.add(what)
