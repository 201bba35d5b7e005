"""Pairs of messages by their stamps: images and clouds of one shot."""

import threading
import time
from collections import deque
from typing import Any, NamedTuple

ANSWERS = 100
"""Maximum number of answers waiting for the cloud of their image."""

CLOUD, ANSWER = 0, 1
"""Sides of the matcher."""

WAITING_MEMORY = 1024 * 2**20
"""Memory for clouds that wait for what belongs to them, bytes."""


class _Message(NamedTuple):
    stamp: int
    item: Any
    size: int
    arrived: float


class Waiting(NamedTuple):
    """What waits for its match, of each of two topics."""

    counts: list[int]
    seconds: list[float]  # for how long the oldest has waited, s; 0 where there is none
    nearest: int  # smallest difference of two stamps since the last match, ns; 0 without any


class Matcher:
    """Pairs messages of two topics, whichever of them arrives first.

    The stamps of a match differ by at most `tolerance`, ns; the nearest message matches. Each
    topic keeps its order, so a match discards all messages that arrived before it on either topic.
    The messages of a topic that wait have together at most the size in `limits`; a single one may
    always wait. `unmatched` has counts of discarded messages of each topic, to continue.
    """

    def __init__(self, tolerance: int, limits: tuple[int, int], unmatched: list[int]) -> None:
        self._unmatched = unmatched
        self._tolerance = tolerance
        self._limits = limits
        self._waiting: tuple[deque[_Message], deque[_Message]] = (deque(), deque())
        self._nearest = 0
        self._lock = threading.Lock()

    def put(self, side: int, stamp: int, item: Any, size: int = 1) -> Any:
        """Return the match of a message of topic 0 or 1, or None and let the message wait.

        The stamp is in ns, the size in the unit of `limits`.
        """
        other = 1 - side
        own, others = self._waiting[side], self._waiting[other]
        with self._lock:
            apart = [abs(it.stamp - stamp) for it in others]
            nearest = min(apart, default=0)
            if apart and nearest <= self._tolerance:
                for _ in range(apart.index(nearest)):
                    self._discard(other)
                while own:
                    self._discard(side)
                self._nearest = 0
                return others.popleft().item
            if apart:
                self._nearest = min(self._nearest or nearest, nearest)
            own.append(_Message(stamp, item, size, time.monotonic()))
            while len(own) > 1 and sum(it.size for it in own) > self._limits[side]:
                self._discard(side)
        return None

    def waiting(self) -> Waiting:
        """Return what waits, and for how long."""
        now = time.monotonic()
        with self._lock:
            seconds = [now - it[0].arrived if it else 0.0 for it in self._waiting]
            return Waiting([len(it) for it in self._waiting], seconds, self._nearest)

    def _discard(self, side: int) -> None:
        self._waiting[side].popleft()
        self._unmatched[side] += 1
