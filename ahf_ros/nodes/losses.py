"""Messages lost in transport, counted from the numbers that publishers give them.

The event `message_lost` of ROS 2 is not enough. Under Fast DDS on Jazzy, it was silent when newer
messages replaced 188 of 200 in the queue of a reliable subscription; the numbers showed them all.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import Any

NUMBER, SENDER, SENT = 'publication_sequence_number', 'publisher_gid', 'source_timestamp'
"""Entries of the information that rclpy gives with a message."""

SENDERS = 100
"""Maximum number of publishers that are remembered, the latest ones."""


class Losses:
    """Counts gaps in the numbers of the messages of each publisher.

    Up to Jazzy, rclpy does not say which publisher a message is from. The gaps are then counted
    while there is one publisher, and the same one before and after the gap.

    Parameters
    ----------
    publishers : callable
        Returns the identifiers of the publishers on the topic.

    Attributes
    ----------
    lost : int
        Messages lost so far, including those that a newer one replaced in a full queue of the
        middleware.
    unknown : str
        Why losses cannot be counted at present; empty if they can.
    """

    def __init__(self, publishers: Callable[[], frozenset[Hashable]]) -> None:
        self._publishers = publishers
        self._last: dict[str, tuple[int, int]] = {}
        self._before_pause: set[str] = set()
        self._known: frozenset[Hashable] = frozenset()
        self._told = 0
        self.lost = 0
        self.unknown = ''

    def pause(self) -> None:
        """Do not count what is missed from now on until the next message of each publisher."""
        self._before_pause = set(self._last)
        self._known = frozenset()

    def add(self, information: Mapping[str, Any]) -> bool:
        """Count what was lost before a message; return whether the message is a new one.

        A subscription that takes the place of another one may get the last message again.

        Parameters
        ----------
        information : mapping of str to value
            What rclpy knows about the message.
        """
        number, sent = information.get(NUMBER) or 0, information.get(SENT) or 0
        if not number:
            self.unknown = 'the middleware does not number messages'
            return True
        sender = information.get(SENDER)
        before = self._last.pop(str(sender), None)
        self._last[str(sender)] = number, sent
        if sent and before == (number, sent):
            return False
        if len(self._last) > SENDERS:
            del self._last[next(iter(self._last))]
        paused = str(sender) in self._before_pause
        self._before_pause.discard(str(sender))
        gap = number - before[0] - 1 if before and not paused else -1
        if sender is not None:
            self.unknown = ''
            self.lost += max(gap, 0)
        elif gap or self.unknown:
            self.lost += max(gap, 0) if self._from_one() else 0
        return True

    def newly_lost(self) -> int:
        """Return how many messages were lost since the last call."""
        new = self.lost - self._told
        self._told += new
        return new

    def _from_one(self) -> bool:
        """Return whether all messages since the last look come from the same publisher."""
        before, self._known = self._known, self._publishers()
        several = len(self._known) > 1
        self.unknown = f'messages come from {len(self._known)} publishers' if several else ''
        return not several and before == self._known
