"""Messages of two topics that belong together by their stamps, without message_filters."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any, NamedTuple


class _Waiting(NamedTuple):
    stamp: int
    item: Any
    size: int


class Matcher:
    """Pairs what two topics say of the same moment, whichever of them comes first.

    Each topic keeps its order. So where two messages match, what came before them on either topic
    waits in vain, and is given up.

    Parameters
    ----------
    tolerance : int
        Largest distance of two stamps that match, ns; of several the nearest matches.
    limits : tuple of int
        What all that waits of either topic may take together; one message may always wait.
    unmatched : list of int
        Goes on to count the messages of either topic that were given up.
    """

    def __init__(self, tolerance: int, limits: tuple[int, int], unmatched: list[int]) -> None:
        self._unmatched = unmatched
        self._tolerance = tolerance
        self._limits = limits
        self._waiting: tuple[deque[_Waiting], deque[_Waiting]] = (deque(), deque())
        self._lock = threading.Lock()

    def put(self, side: int, stamp: int, item: Any, size: int = 1) -> Any:
        """Return what matches a message, or None and let the message wait.

        Parameters
        ----------
        side : int
            The topic, 0 or 1.
        stamp : int
            In ns.
        item : object
            The message.
        size : int
            What it takes while it waits.
        """
        other = 1 - side
        with self._lock:
            stamps = [abs(waiting.stamp - stamp) for waiting in self._waiting[other]]
            if stamps and min(stamps) <= self._tolerance:
                for _ in range(stamps.index(min(stamps))):
                    self._give_up(other)
                while self._waiting[side]:
                    self._give_up(side)
                return self._waiting[other].popleft().item
            self._waiting[side].append(_Waiting(stamp, item, size))
            while len(self._waiting[side]) > 1 and self._taken(side) > self._limits[side]:
                self._give_up(side)
        return None

    def _taken(self, side: int) -> int:
        return sum(waiting.size for waiting in self._waiting[side])

    def _give_up(self, side: int) -> None:
        self._waiting[side].popleft()
        self._unmatched[side] += 1
