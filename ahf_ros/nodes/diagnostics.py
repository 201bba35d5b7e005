"""Diagnostics of the node `detector`."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from ahf_ros.edge_shift import edge_shift_remark
from ahf_ros.target import Identification
from ahf_ros.text import printable

LOSS_REMEDY = 'more depth of the publisher, or config/fastdds_shm.xml on both sides, may help'
"""What to do about images that get lost, in words."""


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
    lost : int
        Clouds lost in transport.
    waiting : str
        Message about images that wait for their cloud for long; empty if none do.
    """

    received: int = 0
    used: int = 0
    rejected: int = 0
    reason: str = ''
    unmatched: list[int] = field(default_factory=lambda: [0, 0])
    positions: str = ''
    lost: int = 0
    waiting: str = ''

    def values(self) -> dict[str, object]:
        """Return the entries of the diagnostics."""
        return {
            'clouds received': self.received,
            'clouds used': self.used,
            'clouds lost in transport': self.lost,
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
        turn; that were not accepted; whose stamp is earlier than the stamp before.
    reason : str
        Why the last rejected image was rejected.
    mistaken : str
        Message about other types on the topic of the images; empty if there are none.
    several : str
        Message about several publishers of images; empty if there are none.
    silent : str
        Message about images that do not arrive; empty if they do.
    kind : str
        Size and encoding of the last image.
    changes : int
        Images of another size or encoding than the one before.
    change : str
        The last of these changes.
    lost : int
        Images lost in transport.
    lossless : bool
        Whether every image counts.
    lost_unknown : str
        Why images lost in transport are not counted; empty if they are.
    uncalibrated : str
        Why the last answer has no undistorted targets; empty if it has, or if none are asked for.
    inactive : str
        State of a managed node that is not active; empty while it is.
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
    several: str = ''
    silent: str = ''
    kind: str = ''
    changes: int = 0
    change: str = ''
    lost: int = 0
    lossless: bool = False
    lost_unknown: str = ''
    uncalibrated: str = ''
    inactive: str = ''
    latency: float = 0.0
    last: Identification = field(default_factory=lambda: Identification(()))
    clouds: CloudTally | None = None
    stamp: tuple[int, int] = (0, 0)

    @property
    def lost_in_transport(self) -> str:
        """Images lost in transport, and whether they are counted."""
        return (
            f'{self.lost}, not counted: {self.lost_unknown}'
            if self.lost_unknown
            else str(self.lost)
        )

    def give_up(self) -> int:
        """Count the images that wait as dropped, and return their number."""
        waiting = max(0, self.received - self.answered - self.dropped - self.rejected)
        self.dropped += waiting
        return waiting

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

    def compare_kinds(self, kind: str) -> str:
        """Count changes of size or encoding; return what to report."""
        before, self.kind = self.kind, kind
        if not before or before == kind:
            return ''
        self.changes += 1
        self.change = f'images are now {printable(kind)}, before {printable(before)}'
        return self.change


class Diagnostics:
    """Turns a tally into one status per period, with the rate and the level of the period."""

    def __init__(self, name: str, tally: Tally) -> None:
        self._name = name
        self._tally = tally
        self._before = replace(tally)

    def status(self, period: float) -> DiagnosticStatus:
        """Return the status of the last `period` seconds."""
        tally = replace(self._tally)
        before, self._before = self._before, replace(tally, clouds=copy(tally.clouds))
        answered = tally.answered - before.answered
        warning = '' if tally.inactive else _warning(tally, before)
        message = f'the node is {tally.inactive}' if tally.inactive else ''
        level = DiagnosticStatus.WARN if warning else DiagnosticStatus.OK
        used, shift = tally.last.filter, tally.last.edge_shift
        values = {
            'rate (Hz)': f'{answered / period:.2f}',
            'latency (s)': f'{tally.latency:.3f}',
            'received': tally.received,
            'answered': tally.answered,
            'dropped': tally.dropped,
            'lost in transport': tally.lost_in_transport,
            'rejected': tally.rejected,
            'last reason for rejection': tally.reason,
            'stamps that went backwards': tally.backwards,
            'changes of size or encoding': tally.changes,
            'stacks that were not full': tally.incomplete,
            'stacks that were split': tally.split,
            'identified (n)': tally.last.count,
            'expected (N)': tally.last.expected,
            'N estimated': tally.last.estimated,
            'mirrored': tally.last.mirrored,
            'edge shift (px)': '' if shift is None else f'{shift:.2f}',
            'filter applied': used.applied,
            'gamma_high': f'{used.gamma_high:.2f}',
            'gamma_low': f'{used.gamma_low:.2f}',
            'evaluations': used.evaluations,
        }
        if tally.clouds:
            values |= tally.clouds.values()
        return DiagnosticStatus(
            level=level,
            name=self._name,
            message=message or warning or f'{answered} images identified',
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )


def _warning(tally: Tally, before: Tally) -> str:
    """Return everything that is wrong since the last status; empty if nothing is."""
    clouds, clouds_before = tally.clouds or CloudTally(), before.clouds or CloudTally()
    rejected = tally.rejected - before.rejected
    rejected_clouds = clouds.rejected - clouds_before.rejected
    backwards = tally.backwards - before.backwards
    incomplete, split = tally.incomplete - before.incomplete, tally.split - before.split
    changes, lost = tally.changes - before.changes, tally.lost - before.lost
    reports = (
        tally.mistaken,
        rejected and f'{rejected} images rejected: {tally.reason}',
        not tally.mistaken and tally.silent,
        rejected_clouds and f'{rejected_clouds} clouds rejected: {clouds.reason}',
        clouds.waiting,
        backwards and f'{backwards} stamps went backwards',
        (incomplete or split) and f'{incomplete} stacks were not full, {split} were split',
        lost and tally.lossless and f'{lost} images were lost in transport; {LOSS_REMEDY}',
        tally.several,
        changes and f'size or encoding changed {changes} times: {tally.change}',
        tally.last.mirrored and 'the last image seems to be mirrored',
        edge_shift_remark(tally.last.edge_shift),
        tally.uncalibrated,
    )
    return '; '.join(text for text in reports if text)
