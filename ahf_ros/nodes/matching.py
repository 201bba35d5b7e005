"""Messages of two topics matched by their stamps, without message_filters."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any, NamedTuple


class _Waiting(NamedTuple):
    stamp: int
    item: Any
    size: int


class Matcher:
    """Pairs messages of two topics, whichever of them arrives first.

    Each topic keeps its order, so a match discards all messages that arrived before it on either
    topic.

    Parameters
    ----------
    tolerance : int
        Maximum difference of the stamps of a match, ns; the nearest message matches.
    limits : tuple of 2 int
        Maximum size of all waiting messages of each topic together; a single one may always wait.
    unmatched : list of 2 int
        Counts of discarded messages of each topic, to continue.
    """

    def __init__(self, tolerance: int, limits: tuple[int, int], unmatched: list[int]) -> None:
        self._unmatched = unmatched
        self._tolerance = tolerance
        self._limits = limits
        self._waiting: tuple[deque[_Waiting], deque[_Waiting]] = (deque(), deque())
        self._lock = threading.Lock()

    def put(self, side: int, stamp: int, item: Any, size: int = 1) -> Any:
        """Return the match of a message, or None and let the message wait.

        Parameters
        ----------
        side : int
            Topic, 0 or 1.
        stamp : int
            Stamp of the message, ns.
        item : object
            The message.
        size : int
            Its size, in the unit of `limits`.
        """
        other = 1 - side
        with self._lock:
            stamps = [abs(waiting.stamp - stamp) for waiting in self._waiting[other]]
            if stamps and min(stamps) <= self._tolerance:
                for _ in range(stamps.index(min(stamps))):
                    self._discard(other)
                while self._waiting[side]:
                    self._discard(side)
                return self._waiting[other].popleft().item
            self._waiting[side].append(_Waiting(stamp, item, size))
            while len(self._waiting[side]) > 1 and self._taken(side) > self._limits[side]:
                self._discard(side)
        return None

    def _taken(self, side: int) -> int:
        return sum(waiting.size for waiting in self._waiting[side])

    def _discard(self, side: int) -> None:
        self._waiting[side].popleft()
        self._unmatched[side] += 1
