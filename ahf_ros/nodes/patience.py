"""When silence on a topic means something: a clock that is given its times."""

from collections.abc import Hashable

UNKNOWN, TRIGGERED, CONTINUOUS = 'unknown', 'triggered', 'continuous'
"""When a camera takes images: nobody says, when it is triggered, all the time."""

SECONDS = 10.0
"""Time after which silence is reported, unless a parameter sets it, s."""


class Patience:
    """For how long nothing has come on a topic that should have come.

    The clock starts anew when a message or another publisher comes, and when the last publisher
    goes. It stands still while the node is at work on what came.
    """

    def __init__(self, now: float) -> None:
        self.waited = 0.0  # s
        self._looked = now
        self._publishers: frozenset[Hashable] = frozenset()
        self._delivered: frozenset[Hashable] = frozenset()  # publishers whose messages arrive

    def look(
        self, now: float, publishers: frozenset[Hashable], arrived: float, busy: bool
    ) -> None:
        """Take note of what is there `now`.

        `publishers` are those of the right type, `arrived` is the time of the last message. Both
        times are of one clock, s.
        """
        came = arrived > self._looked
        gone = self._publishers and not publishers
        if came or gone or publishers - self._publishers:
            self.waited = 0.0
        elif not busy:
            self.waited += now - self._looked
        self._delivered = publishers if came else self._delivered & publishers
        self._looked, self._publishers = now, publishers

    def ended(self, timeout: float, acquisition: str, fit: bool = True) -> bool:
        """Return whether silence of more than `timeout`, s, is worth a warning; 0: never.

        It is not if publishers that `fit` the subscription only send when they are triggered.
        Where the acquisition is unknown, this holds as soon as one of them has sent something.
        """
        triggered = acquisition == TRIGGERED or (acquisition == UNKNOWN and self._delivered)
        usual = fit and self._publishers and triggered
        return bool(timeout) and self.waited > timeout and not usual
