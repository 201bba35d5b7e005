"""Diagnostics of the node `detector`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from ahf_ros.target import Identification


@dataclass(slots=True)
class CloudTally:
    """Counts of point clouds since the start.

    Attributes
    ----------
    received, used, rejected : int
        Clouds that arrived; that matched an image, so that positions were published; that were
        not accepted.
    reason : str
        Why the last rejected cloud was rejected.
    unmatched : list of int
        Number of clouds without an image, and of images without a cloud.
    positions : str
        How many targets of the last image have a position.
    """

    received: int = 0
    used: int = 0
    rejected: int = 0
    reason: str = ''
    unmatched: list[int] = field(default_factory=lambda: [0, 0])
    positions: str = ''

    def values(self) -> dict[str, object]:
        """Return the entries of the diagnostics."""
        return {
            'clouds received': self.received,
            'clouds used': self.used,
            'clouds rejected': self.rejected,
            'last reason for rejection of a cloud': self.reason,
            'clouds without an image': self.unmatched[0],
            'images without a cloud': self.unmatched[1],
            'targets with a position': self.positions,
        }


@dataclass(slots=True)
class Tally:
    """Counts of images since the start.

    Attributes
    ----------
    received, answered, dropped, rejected, backwards : int
        Images that arrived; that were answered; that were replaced by a newer one before their
        turn; that were not accepted; whose stamp is earlier than that of the image before.
    reason : str
        Why the last rejected image was rejected.
    mistaken : str
        Message about other types on the topic of the images; empty if there are none.
    incomplete, split : int
        Stacks that were answered with fewer images; that were split.
    latency : float
        Time from the arrival of the last image to its answer, s.
    last : Identification
        The last identification.
    clouds : CloudTally or None
        Counts of clouds; None while they are not subscribed to.
    stamp : tuple of 2 int
        Stamp of the last image, s and ns.
    """

    received: int = 0
    answered: int = 0
    dropped: int = 0
    rejected: int = 0
    backwards: int = 0
    incomplete: int = 0
    split: int = 0
    reason: str = ''
    mistaken: str = ''
    latency: float = 0.0
    last: Identification = field(default_factory=lambda: Identification(()))
    clouds: CloudTally | None = None
    stamp: tuple[int, int] = (0, 0)

    def compare_stamps(self, header: Header) -> str:
        """Count stamps that go backwards, as when a replay starts over; return what to report."""
        (sec, nanosec), before = (header.stamp.sec, header.stamp.nanosec), self.stamp
        self.stamp = sec, nanosec
        if self.stamp >= before:
            return ''
        self.backwards += 1
        return (
            f'stamp is {sec}.{nanosec:09} s, that of the image before is '
            f'{before[0]}.{before[1]:09} s'
        )


class Diagnostics:
    """Turns a tally into one status per period, whose rate and level are those of the period."""

    def __init__(self, name: str, tally: Tally) -> None:
        self._name = name
        self._tally = tally
        self._before = replace(tally)
        self._rejected_clouds = 0

    def status(self, period: float) -> DiagnosticStatus:
        """Return the status of the last `period` seconds."""
        tally = replace(self._tally)
        answered = tally.answered - self._before.answered
        rejected = tally.rejected - self._before.rejected
        backwards = tally.backwards - self._before.backwards
        incomplete = tally.incomplete - self._before.incomplete
        split = tally.split - self._before.split
        self._before = tally
        level, message = DiagnosticStatus.OK, f'{answered} images identified'
        if rejected:
            level, message = DiagnosticStatus.WARN, f'{rejected} images rejected: {tally.reason}'
        elif backwards:
            level, message = DiagnosticStatus.WARN, f'{backwards} stamps went backwards'
        elif incomplete or split:
            level = DiagnosticStatus.WARN
            message = f'{incomplete} stacks were not full, {split} were split'
        clouds = tally.clouds or CloudTally()
        rejected_clouds = clouds.rejected - self._rejected_clouds
        self._rejected_clouds = clouds.rejected
        if rejected_clouds and not rejected:
            level = DiagnosticStatus.WARN
            message = f'{rejected_clouds} clouds rejected: {clouds.reason}'
        if tally.last.mirrored and level == DiagnosticStatus.OK:
            level, message = DiagnosticStatus.WARN, 'the last image seems to be mirrored'
        if tally.mistaken:
            level, message = DiagnosticStatus.WARN, tally.mistaken
        used = tally.last.filter
        values = {
            'rate (Hz)': f'{answered / period:.2f}',
            'latency (s)': f'{tally.latency:.3f}',
            'received': tally.received,
            'answered': tally.answered,
            'dropped': tally.dropped,
            'rejected': tally.rejected,
            'last reason for rejection': tally.reason,
            'stamps that went backwards': tally.backwards,
            'stacks that were not full': tally.incomplete,
            'stacks that were split': tally.split,
            'identified (n)': tally.last.count,
            'expected (N)': tally.last.expected,
            'N estimated': tally.last.estimated,
            'mirrored': tally.last.mirrored,
            'filter applied': used.applied,
            'gamma_high': f'{used.gamma_high:.2f}',
            'gamma_low': f'{used.gamma_low:.2f}',
            'evaluations': used.evaluations,
        }
        if tally.clouds:
            values |= clouds.values()
        return DiagnosticStatus(
            level=level,
            name=self._name,
            message=message,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
