"""Messages of two topics matched by their stamps, without message_filters."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any, NamedTuple


class _Message(NamedTuple):
    stamp: int
    item: Any
    size: int
    arrived: float


class Waiting(NamedTuple):
    """What waits for its match.

    Attributes
    ----------
    counts : tuple of 2 int
        Messages of each topic.
    seconds : tuple of 2 float
        How long the oldest message of each topic has waited, s; 0 where there is none.
    nearest : int
        Smallest difference of two stamps since the last match, ns; 0 if none were compared.
    """

    counts: tuple[int, int]
    seconds: tuple[float, float]
    nearest: int


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
        self._waiting: tuple[deque[_Message], deque[_Message]] = (deque(), deque())
        self._nearest = 0
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
                self._nearest = 0
                return self._waiting[other].popleft().item
            if stamps:
                self._nearest = min(self._nearest or min(stamps), min(stamps))
            self._waiting[side].append(_Message(stamp, item, size, time.monotonic()))
            while len(self._waiting[side]) > 1 and self._taken(side) > self._limits[side]:
                self._discard(side)
        return None

    def waiting(self) -> Waiting:
        """Return what waits, and for how long."""
        now = time.monotonic()
        with self._lock:
            first, second = self._waiting
            seconds = [now - it[0].arrived if it else 0.0 for it in self._waiting]
            return Waiting((len(first), len(second)), (seconds[0], seconds[1]), self._nearest)

    def _taken(self, side: int) -> int:
        return sum(waiting.size for waiting in self._waiting[side])

    def _discard(self, side: int) -> None:
        self._waiting[side].popleft()
        self._unmatched[side] += 1
