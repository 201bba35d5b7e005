"""The node `registration`: scans in, one frame for all of them out."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from ahf_ros.base.text import counted, printable
from ahf_ros.clouds.matching import ANSWER, ANSWERS, CLOUD, WAITING_MEMORY, Matcher
from ahf_ros.clouds.point_clouds import whole_points
from ahf_ros.clouds.registration_files import ScanRecord, in_common_frame, write_registration
from ahf_ros.clouds.scans import Scans, known_targets, scan_cloud
from ahf_ros.files.image_messages import nanoseconds
from ahf_ros.nodes.diagnostics import publish_status, status_of
from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.messages import (
    cloud_message,
    field_points,
    pose_message,
    residual_points,
    transform_message,
)
from ahf_ros.nodes.parameters import ParameterSettings
from ahf_ros.nodes.patience import SECONDS
from ahf_ros.nodes.process import LOG_PERIOD, ProcessNode
from ahf_ros.nodes.settings import RegistrationNodeSettings
from ahf_ros.nodes.tf import PACKAGE, Frames
from ahf_ros.nodes.topics import ANSWERS_KEPT, POINTS
from ahf_ros.nodes.watch import Expected, Silence

_NO_TF = (
    f'tf is True and the package {PACKAGE} is not there: no tf; ros-DISTRIBUTION-tf2-msgs '
    'installs it'
)

_MILLIMETRES = 1000.0

MAXIMUM_SECONDS = 2**31 - 1
"""Of a stamp; nanoseconds beyond a second may lead past it."""


@dataclass(slots=True)
class RegistrationTally:
    """Counts since the start, and what is to be said; empty if nothing is."""

    received: int = 0
    refused: int = 0
    reason: str = ''  # why the last refused scan was refused
    clouds: int = 0  # published in the frame
    clouds_refused: int = 0
    cloud_reason: str = ''
    lost: int = 0  # in transport


class RegistrationNode(ProcessNode):
    """Registers every scan, by its target points, in the frame of the scans before.

    A scan that does not fit is refused with the reason, and nothing changes.
    """

    def __init__(self) -> None:
        super().__init__('registration')
        self._settings = ParameterSettings(self, RegistrationNodeSettings)
        settings = self._settings.current
        self._registration = Scans(known_targets(settings), settings.scan_frame)
        self._clouds: dict[str, np.ndarray] = {}  # by the name of their scan
        self._tally = RegistrationTally()
        self._told = replace(self._tally)
        # One after the other: scans, clouds and services change the same field.
        group = MutuallyExclusiveCallbackGroup()
        self._transform = self.publisher(PoseWithCovarianceStamped, '~/transform', ANSWERS_KEPT)
        self._residuals = self.publisher(PointCloud2, '~/residuals', ANSWERS_KEPT)
        self._targets = self.publisher(PointCloud2, '~/targets')
        self._frames: Frames | None = None
        if settings.tf and find_spec(PACKAGE):
            self._frames = Frames(self, static=True, remedy='set scan_frame')
        elif settings.tf:
            self.get_logger().warning(_NO_TF)
        self._unmatched = [0, 0]  # clouds, and scans
        self._sources: dict[Input, Silence] = {}  # of target points
        self._inputs_of_scans: list[Input] = []
        if settings.cloud:
            self._cloud = self.publisher(PointCloud2, '~/cloud', 10)
        for scanner in settings.scanner_names:
            self._listen_to(scanner, settings, group)
        for name, work in (
            ('save', self._save),
            ('undo', self._undo),
            ('reset', self._reset),
            ('adjust', self._adjust),
        ):
            respond = partial(self._respond, work)
            self.create_service(Trigger, f'~/{name}', respond, callback_group=group)
        publish_status(self, 'registration', self._status)

    def _listen_to(
        self, scanner: str, settings: RegistrationNodeSettings, group: CallbackGroup
    ) -> None:
        """Subscribe to the target points and clouds of a scanner; its name may be empty."""
        targets, clouds = 'target_points', POINTS
        if scanner:
            targets, clouds = f'{scanner}/detector/target_points', f'{scanner}/{POINTS}'
        tolerance = round(settings.cloud_tolerance * 1e9)
        matcher = Matcher(tolerance, (WAITING_MEMORY, ANSWERS), self._unmatched)
        on_scan = partial(self._on_scan, scanner, matcher)
        source = self.subscribe(PointCloud2, targets, on_scan, group, lossless=True)
        self._sources[source] = Silence(self, 'target points')
        self._inputs_of_scans.append(source)
        if settings.cloud:
            on_cloud = partial(self._on_cloud, matcher)
            self._inputs_of_scans.append(
                self.subscribe(PointCloud2, clouds, on_cloud, group, lossless=True)
            )

    def introduction(self) -> str:
        """Return what is registered where."""
        settings = self._settings.current
        names = [self.resolve_topic_name(it.topic) for it in self._inputs_of_scans]
        known = self._registration.field.known
        origin = f'of {counted(known, "known target")}' if known else 'of the first scan'
        return f'registers scans in the frame {settings.frame}, that {origin}, from ' + ', '.join(
            names
        )

    def _on_scan(self, scanner: str, matcher: Matcher, message: PointCloud2) -> None:
        self._tally.received += 1
        stamp = nanoseconds(message.header)
        record = ScanRecord('')  # of a refused scan, whose cloud is given up, too
        try:
            self._register(message, stamp, scanner)
        except ValueError as error:
            self._tally.refused += 1
            self._tally.reason = printable(str(error), 1000)
            self.get_logger().warning(
                f'scan refused: {self._tally.reason}', throttle_duration_sec=LOG_PERIOD
            )
        else:
            record = self._registration.records[-1]
            self._publish(len(self._registration.records) - 1)
            self._publish_all()
        if self._settings.current.cloud:
            cloud = matcher.put(ANSWER, stamp, record)
            if cloud is not None:
                self._take(record, cloud)

    def _register(self, message: PointCloud2, stamp: int, scanner: str) -> None:
        """Register a scan, or raise a ValueError that says why not."""
        settings, count = self._settings.current, len(self._registration.records)
        if count >= settings.maximum_scans:
            raise ValueError(f'{count} scans are registered, accepted is maximum_scans')
        frame_id = message.header.frame_id
        confidence = settings.minimum_confidence
        self._registration.register(whole_points(message), confidence, stamp, frame_id, scanner)

    def _on_cloud(self, matcher: Matcher, cloud: PointCloud2) -> None:
        record = matcher.put(CLOUD, nanoseconds(cloud.header), cloud, len(cloud.data))
        if record is not None:
            self._take(record, cloud)

    def _take(self, record: ScanRecord, cloud: PointCloud2) -> None:
        """Publish the cloud of a scan in the frame, and keep it, unless the scan was refused."""
        if record not in self._registration.records:
            return
        try:
            points = scan_cloud(cloud, record.frame_id)
        except ValueError as error:
            self._refuse_cloud(str(error))
            return
        scan = self._registration.field.scans[self._registration.records.index(record)]
        moved = in_common_frame(points, scan.transform)
        self._cloud.publish(cloud_message(moved, self._header(record)))
        self._tally.clouds += 1
        used = sum(it.nbytes for it in self._clouds.values())
        if used + points.nbytes > self._settings.current.cloud_memory * 2**20:
            self._refuse_cloud(
                f'clouds take {used / 2**20:.0f} MB, and cloud_memory has no room for '
                f'{points.nbytes / 2**20:.0f} more; that of {record.name} is published and not '
                'kept'
            )
            return
        self._clouds[record.name] = points

    def _refuse_cloud(self, reason: str) -> None:
        self._tally.clouds_refused += 1
        self._tally.cloud_reason = printable(reason, 1000)
        self.get_logger().warning(
            f'cloud refused: {self._tally.cloud_reason}', throttle_duration_sec=LOG_PERIOD
        )

    def _header(self, record: ScanRecord) -> Header:
        seconds, rest = divmod(record.stamp, 10**9)
        stamp = Time(sec=min(seconds, MAXIMUM_SECONDS), nanosec=rest)
        return Header(stamp=stamp, frame_id=self._settings.current.frame)

    def _publish(self, number: int) -> None:
        field, header = self._registration.field, self._header(self._registration.records[number])
        scan = field.scans[number]
        self._transform.publish(pose_message(scan.transform, header))
        self._residuals.publish(residual_points(field, scan, header))

    def _publish_all(self) -> None:
        """Publish what belongs to all scans: targets and tf."""
        field = self._registration.field
        now = self.get_clock().now().to_msg()
        header = Header(stamp=now, frame_id=self._settings.current.frame)
        self._targets.publish(field_points(field, header))
        if self._frames:
            self._frames.publish(
                transform_message(scan.transform, header, record.name)
                for record, scan in zip(self._registration.records, field.scans, strict=True)
            )

    def _respond(
        self, work: Callable[[], str], _: Trigger.Request, response: Trigger.Response
    ) -> Any:
        try:
            response.message = work()
            response.success = True
        except ValueError as error:
            response.message = str(error)
        return response

    def _save(self) -> str:
        settings = self._settings.current
        if not settings.folder:
            raise ValueError("folder is '', accepted is the name of a folder")
        field, records = self._registration.field, self._registration.records
        clouds = [self._clouds.get(it.name) for it in records]
        paths = write_registration(settings.folder, settings.frame, field, records, clouds)
        return (
            f'{counted(len(field.scans), "scan")} in {counted(len(paths), "file")} in '
            f'{paths[-1].parent.resolve()}'
        )

    def _undo(self) -> str:
        what = 'the adjustment'
        names = [it.name for it in self._registration.records]
        if self._registration.undo():
            what = names[-1]
            self._clouds.pop(what, None)
        else:
            self._publish_scans()
        self._publish_all()
        left = counted(len(self._registration.records), 'scan')
        return f'{what} is taken back; {left} registered'

    def _reset(self) -> str:
        count = len(self._registration.records)
        self._registration.reset()
        self._clouds.clear()
        self._publish_all()
        return f'{counted(count, "scan")} forgotten'

    def _adjust(self) -> str:
        text = self._registration.adjust().words()
        self._publish_scans()
        self._publish_all()
        return text

    def _publish_scans(self) -> None:
        for number in range(len(self._registration.records)):
            self._publish(number)

    def _status(self) -> DiagnosticStatus:
        tally, told = self._tally, self._told
        for it in self._inputs_of_scans:
            tally.lost += it.losses.newly_lost()
        expected = Expected(SECONDS)  # each scan is triggered
        silent = [it.look(of, of.publishers(), expected) for of, it in self._sources.items()]
        reports = (
            *silent,
            tally.refused > told.refused
            and f'{tally.refused - told.refused} scans refused: {tally.reason}',
            tally.clouds_refused > told.clouds_refused and f'cloud refused: {tally.cloud_reason}',
            tally.lost > told.lost and f'{tally.lost - told.lost} messages lost in transport',
            self._frames.problem if self._frames else '',
        )
        self._told = replace(tally)
        field = self._registration.field
        values: dict[str, object] = {
            'scans received': tally.received,
            'scans registered': len(field.scans),
            'scans refused': tally.refused,
            'last reason for refusal': tally.reason,
            'targets': len(field.names),
            'known targets': field.known,
            'clouds published': tally.clouds,
            'clouds refused': tally.clouds_refused,
            'last reason for refusal of a cloud': tally.cloud_reason,
            'clouds without target points': self._unmatched[CLOUD],
            'target points without a cloud': self._unmatched[ANSWER],
            'messages lost in transport': tally.lost,
        }
        if field.scans:
            last = field.scans[-1]
            sigmas = np.sqrt(np.diag(last.transform.covariance))
            values |= {
                'common targets of the last scan': len(last.common),
                'residuals of the last scan (mm, RMS)': f'{last.rms * _MILLIMETRES:.4f}',
                'position of the last scan (mm, standard deviation)': (
                    f'{np.linalg.norm(sigmas[:3]) * _MILLIMETRES:.4f}'
                ),
            }
        registered = f'{counted(len(field.scans), "scan")} registered'
        return status_of(reports, registered, values)
