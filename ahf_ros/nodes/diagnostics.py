"""The status of nodes on /diagnostics, and what the nodes `detector` and `pose` count."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from dataclasses import dataclass, field, replace

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from ahf_ros.base.edge_shift import edge_shift_remark
from ahf_ros.base.target import Identification
from ahf_ros.base.text import printable
from ahf_ros.files.image_messages import nanoseconds
from ahf_ros.nodes.process import ProcessNode

PERIOD = 1.0
"""Period of /diagnostics, s."""


BEHIND = 10
"""Images dropped in a row after which identification is slower than the camera."""

LOSS_REMEDY = 'more depth of the publisher, or config/fastdds_shm.xml on both sides, may help'
"""What to do about images that get lost, in words."""

MISFIT = 3.0
"""sigma0 from which on wrong weights alone do not explain residuals."""


def publish_status(node: ProcessNode, what: str, status: Callable[[], DiagnosticStatus]) -> None:
    """Publish what a function returns every `PERIOD` seconds, named after the node and `what`."""
    publisher = node.publisher(DiagnosticArray, '/diagnostics', 10)
    name = f'{node.get_fully_qualified_name().lstrip("/")}: {what}'

    def publish() -> None:
        # Before the counts, so that these are no older than the stamp.
        header = Header(stamp=node.get_clock().now().to_msg())
        found = status()
        found.name = name
        publisher.publish(DiagnosticArray(header=header, status=[found]))

    node.every(PERIOD, publish)


def status_of(
    reports: Iterable[object], otherwise: str, values: Mapping[str, object]
) -> DiagnosticStatus:
    """Return a warning of all reports that are not empty; without any, the other message."""
    warning = '; '.join(str(text) for text in reports if text)
    return DiagnosticStatus(
        level=DiagnosticStatus.WARN if warning else DiagnosticStatus.OK,
        message=warning or otherwise,
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )


@dataclass(slots=True)
class Stamps:
    """Stamps of images since the start."""

    backwards: int = 0  # whose stamp is earlier than the stamp before
    repeated: int = 0  # whose stamp is that of the image before
    stamp: int = 0  # of the last image, ns

    def compare_stamps(self, header: Header) -> str:
        """Count stamps that do not go forwards, as in a replay that starts over; return a report.

        Stamps of 0 are none.
        """
        before, self.stamp = self.stamp, nanoseconds(header)
        text = f'stamp is {seconds(self.stamp)}, that of the image before is {seconds(before)}'
        if self.stamp < before:
            self.backwards += 1
        elif self.stamp and self.stamp == before:
            self.repeated += 1
            text = f'stamp is {seconds(self.stamp)} twice: answers cannot be told apart by it'
        elif header.stamp.nanosec >= 10**9:
            text = (
                f'stamp.nanosec is {header.stamp.nanosec}, accepted is less than 10^9: it counts '
                f'as {seconds(self.stamp)}'
            )
        else:
            return ''
        return text


@dataclass(slots=True)
class CloudTally:
    """Counts of point clouds since the start."""

    received: int = 0
    used: int = 0  # matched an image, so that positions were published
    lost: int = 0  # in transport
    rejected: int = 0
    reason: str = ''  # why the last rejected cloud was rejected
    unmatched: list[int] = field(default_factory=lambda: [0, 0])  # clouds, and images
    positions: str = ''  # how many targets of the last image have one
    waiting: str = ''  # message about images that wait for their cloud for long

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


SEARCH = 'search for a filter'
"""A part of the identification."""

ANSWER = 'answer'

STAGES = ('waiting', 'conversion', 'identification', SEARCH, ANSWER, 'other topics')


def _no_time() -> dict[str, float]:
    return dict.fromkeys(STAGES, 0.0)


@dataclass(frozen=True, slots=True)
class Times:
    """Where the time of images went, s."""

    count: int = 0  # of answers so far
    latency: float = 0.0  # from the arrival of the last image to its answer
    last: dict[str, float] = field(default_factory=_no_time)  # in the stages of the last image
    sums: dict[str, float] = field(default_factory=_no_time)  # in those of all images so far

    def values(self, before: Times) -> dict[str, str]:
        """Return the entries of the diagnostics: of the last image, and means since before."""
        count = self.count - before.count
        entries = {'latency (s)': f'{self.latency:.4f}'}
        for stage in STAGES:
            spent = self.sums[stage] - before.sums[stage]
            entries[f'{stage} (s)'] = f'{self.last[stage]:.4f}'
            entries[f'mean {stage} (s)'] = f'{spent / count:.4f}' if count else ''
        return entries


class Stages:
    """A clock of the stages of an image, one after the other."""

    def __init__(self, arrived: float) -> None:
        self._arrived = self._since = arrived  # s of the monotonic clock
        self._latency = 0.0
        self.spent = _no_time()

    def end(self, stage: str) -> None:
        """Count the time since the stage before."""
        before, self._since = self._since, time.monotonic()
        self.spent[stage] += self._since - before
        if stage == ANSWER:
            self._latency = self._since - self._arrived

    def added(self, times: Times) -> Times:
        """Return times with those of an answer, and begin with the next one of the image."""
        spent, self.spent = self.spent, _no_time()
        sums = {stage: times.sums[stage] + spent[stage] for stage in STAGES}
        return Times(times.count + 1, self._latency, spent, sums)


@dataclass(slots=True)
class Tally(Stamps):
    """Counts of images since the start, and what is to be said about them; empty if nothing is."""

    received: int = 0
    answered: int = 0
    dropped: int = 0  # replaced by a newer one before their turn, or given up
    rejected: int = 0
    reason: str = ''  # why the last rejected image was rejected
    damaged: int = 0  # not whole, and identified as far as they go
    damage: str = ''  # of the last of these
    kind: str = ''  # size and encoding of the last image
    changes: int = 0  # of size or encoding
    change: str = ''  # the last of them
    incomplete: int = 0  # stacks that were answered with fewer images
    split: int = 0  # stacks that were split
    lost: int = 0  # in transport
    lost_unknown: str = ''  # why images lost in transport are not counted
    lossless: bool = False  # whether every image counts
    mistaken: str = ''  # message about other types on the topic of the images
    several: str = ''  # message about several publishers of images
    twins: str = ''  # message about other nodes with the same name or on the same topic of answers
    silent: str = ''  # message about images that do not arrive
    uncalibrated: str = ''  # why the last answer has no undistorted targets, if they are asked for
    advice: str = ''  # what may help where images in a row do not show what they should
    behind: int = 0  # images dropped since none last waited after an identification
    inactive: str = ''  # state of a managed node that is not active
    unasked: bool = False  # whether nobody subscribes to answers
    times: Times = field(default_factory=Times)
    settled: tuple[str, ...] = ()  # families, where all are looked for
    last: Identification = field(default_factory=lambda: Identification(()))
    clouds: CloudTally | None = None  # None while they are not subscribed to

    def give_up(self) -> int:
        """Count the images that wait as dropped, and return their number."""
        waiting = max(0, self.received - self.answered - self.dropped - self.rejected)
        self.dropped += waiting
        return waiting

    @property
    def slow(self) -> str:
        """Message about images that the identification is too slow for."""
        if self.behind < BEHIND:
            return ''
        searching = self.last.filter.evaluations > 1
        shorter = ', max_duration or max_evaluations to shorten searches,' if searching else ''
        return (
            f'{self.behind} images were dropped in a row, because identification is slower than '
            f'the camera: set queue to lossless to answer all of them later{shorter} or the '
            'camera to fewer images'
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

    def __init__(self, tally: Tally) -> None:
        self._tally = tally
        self._before = replace(tally)

    def status(self, period: float) -> DiagnosticStatus:
        """Return the status of the last `period` seconds."""
        tally = replace(self._tally)
        before, self._before = self._before, replace(tally, clouds=copy(tally.clouds))
        answered = tally.answered - before.answered
        reports, message = _reports_of_images(tally, before), f'{answered} images identified'
        if tally.unasked:
            message = 'nobody subscribes to answers, and always is False: no image is identified'
        if tally.inactive:
            reports, message = (), f'the node is {tally.inactive}'
        unknown = f', not counted: {tally.lost_unknown}' if tally.lost_unknown else ''
        used, shift = tally.last.filter, tally.last.edge_shift
        values = {
            'rate (Hz)': f'{answered / period:.2f}',
            **tally.times.values(before.times),
            'received': tally.received,
            'answered': tally.answered,
            'dropped': tally.dropped,
            'lost in transport': f'{tally.lost}{unknown}',
            'rejected': tally.rejected,
            'last reason for rejection': tally.reason,
            'damaged': tally.damaged,
            'stamps that went backwards': tally.backwards,
            'stamps that came twice': tally.repeated,
            'changes of size or encoding': tally.changes,
            'stacks that were not full': tally.incomplete,
            'stacks that were split': tally.split,
            'identified (n)': tally.last.count,
            'followed': sum(target.followed for target in tally.last),
            'expected (N)': tally.last.expected,
            'N estimated': tally.last.estimated,
            'mirrored': tally.last.mirrored,
            'settled families': ', '.join(tally.settled),
            'edge shift (px)': '' if shift is None else f'{shift:.2f}',
            'advice': tally.advice,
            'filter applied': used.applied,
            'gamma_high': f'{used.gamma_high:.2f}',
            'gamma_low': f'{used.gamma_low:.2f}',
            'evaluations': used.evaluations,
        }
        if tally.clouds:
            values |= tally.clouds.values()
        return status_of(reports, message, values)


def _reports_of_images(tally: Tally, before: Tally) -> tuple[object, ...]:
    """Return everything that is wrong since the last status, and empty texts and zeros."""
    clouds, clouds_before = tally.clouds or CloudTally(), before.clouds or CloudTally()
    rejected = tally.rejected - before.rejected
    rejected_clouds = clouds.rejected - clouds_before.rejected
    backwards, repeated = tally.backwards - before.backwards, tally.repeated - before.repeated
    incomplete, split = tally.incomplete - before.incomplete, tally.split - before.split
    changes, lost = tally.changes - before.changes, tally.lost - before.lost
    damaged = tally.damaged - before.damaged
    return (
        tally.mistaken,
        rejected and f'{rejected} images rejected: {tally.reason}',
        damaged and f'{damaged} images damaged, the last: {tally.damage}',
        not tally.mistaken and tally.silent,
        rejected_clouds and f'{rejected_clouds} clouds rejected: {clouds.reason}',
        clouds.waiting,
        backwards and f'{backwards} stamps went backwards',
        repeated and f'{repeated} stamps came twice',
        (incomplete or split) and f'{incomplete} stacks were not full, {split} were split',
        lost and tally.lossless and f'{lost} images were lost in transport; {LOSS_REMEDY}',
        tally.several,
        tally.twins,
        tally.slow,
        changes and f'size or encoding changed {changes} times: {tally.change}',
        tally.last.mirrored and 'the last image seems to be mirrored',
        edge_shift_remark(tally.last.edge_shift),
        tally.advice,
        tally.uncalibrated,
    )


def seconds(stamp: int) -> str:
    """Return a stamp, ns, in words."""
    sign = '-' if stamp < 0 else ''
    return f'{sign}{abs(stamp) // 10**9}.{abs(stamp) % 10**9:09} s'


@dataclass(slots=True)
class PoseTally(Stamps):
    """Counts of images since the start, and what is to be said; texts are empty if nothing is."""

    received: int = 0
    published: int = 0
    refused: int = 0  # without a pose
    reason: str = ''  # of the last of them
    ambiguous: int = 0  # with a second pose that fits about as well
    lost: int = 0  # in transport
    wrong: int = 0  # images with targets that do not agree
    rejected: str = ''  # names of the last of them, and why
    unknown: str = ''  # IDs of the last image that have no coordinates
    used: int = 0  # targets of the last pose
    sigma0: float = 0.0
    latency: float = 0.0  # from the arrival of the last message to its pose, s
    no_tf: str = ''  # why there is no tf
    rectified: str = ''  # message about images that are, or are not, rectified
    uncalibrated: str = ''  # why no camera_info arrives
    mistaken: str = ''  # message about other types on the topic
    silent: str = ''  # message about targets that do not arrive


class PoseDiagnostics:
    """Turns a tally into one status per period, with the rate and the level of the period."""

    def __init__(self, tally: PoseTally) -> None:
        self._tally = tally
        self._before = replace(tally)

    def status(self, period: float) -> DiagnosticStatus:
        """Return the status of the last `period` seconds."""
        tally, before = replace(self._tally), self._before
        self._before = tally
        published = tally.published - before.published
        values = {
            'rate (Hz)': f'{published / period:.2f}',
            'latency (s)': f'{tally.latency:.4f}',
            'received': tally.received,
            'published': tally.published,
            'not determined': tally.refused,
            'last reason': tally.reason,
            'ambiguous': tally.ambiguous,
            'lost in transport': tally.lost,
            'stamps that went backwards': tally.backwards,
            'stamps that came twice': tally.repeated,
            'images with targets left out': tally.wrong,
            'last targets left out': tally.rejected,
            'IDs without coordinates': tally.unknown,
            'targets used': tally.used,
            'sigma0': f'{tally.sigma0:.2f}',
        }
        return status_of(_reports_of_poses(tally, before), f'{published} poses', values)


def _reports_of_poses(tally: PoseTally, before: PoseTally) -> tuple[object, ...]:
    """Return everything that is wrong since the last status, and empty texts and zeros."""
    refused = tally.refused - before.refused
    ambiguous = tally.ambiguous - before.ambiguous
    backwards, repeated = tally.backwards - before.backwards, tally.repeated - before.repeated
    wrong = tally.wrong - before.wrong
    lost = tally.lost - before.lost
    misfit = tally.published > before.published and tally.sigma0 > MISFIT
    return (
        tally.mistaken,
        not tally.mistaken and tally.silent,
        tally.uncalibrated,
        refused and f'{refused} images without a pose: {tally.reason}',
        tally.no_tf,
        ambiguous and f'{ambiguous} images with a second pose that fits about as well',
        wrong and f'targets left out in {wrong} images, in the last: {tally.rejected}',
        misfit
        and f'image points fit {tally.sigma0:.0f} times worse than their covariances say: wrong '
        'calibration, camera_matrix or coordinates',
        tally.rectified,
        backwards and f'{backwards} stamps went backwards',
        repeated and f'{repeated} stamps came twice',
        lost and f'{lost} messages were lost in transport; {LOSS_REMEDY}',
    )
