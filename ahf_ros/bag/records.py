"""Records of reading a bag: messages, and gaps that could not be read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from rosbags.interfaces import Connection

Message = tuple[Connection, int, bytes]
"""Connection of a message, its time of recording in ns, and its bytes."""


@dataclass(frozen=True, slots=True)
class Lost:
    """Messages that could not be read.

    Attributes
    ----------
    topics : tuple of str
        Topics that they may belong to; empty if unknown.
    start, stop : int or None
        Interval of their times of recording, ns; None if unknown.
    reason : str
        Why they could not be read.
    """

    topics: tuple[str, ...]
    start: int | None
    stop: int | None
    reason: str

    def __str__(self) -> str:
        """Return a line of text."""
        topics = ', '.join(self.topics) or 'messages'
        if self.start is None and self.stop is None:
            return f'{topics}: {self.reason}'
        if self.start == self.stop:
            return f'{topics} at {seconds(self.start)} s: {self.reason}'
        start = 'the beginning' if self.start is None else f'{seconds(self.start)} s'
        stop = 'the end' if self.stop is None else f'{seconds(self.stop)} s'
        return f'{topics} from {start} to {stop}: {self.reason}'


@dataclass(frozen=True, slots=True)
class Schema:
    """What describes the messages of a channel of MCAP.

    Attributes
    ----------
    name : str
    encoding : str
        Language of the description, such as 'ros2msg' or 'protobuf'.
    data : bytes
    """

    name: str
    encoding: str
    data: bytes


class BagFile(Protocol):
    """One file of a bag.

    Attributes
    ----------
    start : int
        Time of the first message, ns.
    """

    start: int

    @property
    def connections(self) -> list[Connection]:
        """Its topics."""
        ...

    @property
    def left_out(self) -> list[str]:
        """Other contents that cannot be copied; complete after all messages were read."""
        ...

    def schema(self, connection: Connection) -> Schema | None:
        """Return the schema of a topic as it was recorded, None where there is none."""
        ...

    def messages(self, selected: list[Connection]) -> Iterator[Message | Lost]:
        """Yield the messages of some topics in order of time.

        The result for a topic does not depend on the other selected topics.
        """
        ...


def seconds(timestamp: int | None) -> str:
    """Return a time in ns as seconds, exactly."""
    sign = '-' if (timestamp or 0) < 0 else ''
    whole, part = divmod(abs(timestamp or 0), 10**9)
    return f'{sign}{whole}.{part:09}'
