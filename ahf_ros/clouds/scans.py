"""Scans on their way into one frame: the same from messages, bags and files."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.target import Target
from ahf_ros.clouds.cloud_settings import CloudSettings
from ahf_ros.clouds.localisation import Positions, positions
from ahf_ros.clouds.point_clouds import organised_points, target_scan, whole_points
from ahf_ros.clouds.registration.field import RegisteredScan
from ahf_ros.clouds.registration.session import Registration
from ahf_ros.clouds.registration_files import ScanRecord
from ahf_ros.clouds.registration_settings import RegistrationSettings
from ahf_ros.network.files.coordinate_files import read_coordinates
from ahf_ros.network.points import MeasuredPoints


def located(
    cloud: np.ndarray, targets: Sequence[Target], image: tuple[int, int], settings: CloudSettings
) -> Positions:
    """Return the positions of the targets of an image with so many rows and columns.

    A ValueError says why the cloud, one of `ahf_ros.clouds.localisation.positions`, does not fit.
    The number of threads of BLAS changes no bit of the positions.
    """
    rows, columns = cloud.shape
    settings.grid.check((rows, columns), image)
    with one_blas_thread():
        return positions(cloud, targets, settings.cloud_radius, settings.grid)


def scan_cloud(message: Any, frame_id: str) -> np.ndarray:
    """Return the cloud of a scan with all its fields, a view of a sensor_msgs/PointCloud2.

    A ValueError says so if it is not organised, or not in the frame of the target points.
    """
    if message.header.frame_id != frame_id:
        raise ValueError(
            f'frame_id is {message.header.frame_id!r}, accepted is that of the target points, '
            f'{frame_id!r}'
        )
    organised_points(message)
    return whole_points(message)


def known_targets(settings: RegistrationSettings) -> MeasuredPoints | None:
    """Return the targets whose coordinates are known, None if no file says them."""
    return read_coordinates(settings.coordinates, settings.unit) if settings.coordinates else None


class Scans(Registration):
    """Scans that are registered in the order of their stamps, with a record of each."""

    def __init__(self, known: MeasuredPoints | None = None, names: str = 'scan_') -> None:
        super().__init__(known)
        self.records: list[ScanRecord] = []
        self._names = names

    def register(
        self,
        target_points: np.ndarray,
        minimum_confidence: float,
        stamp: int = 0,
        frame_id: str = '',
        scanner: str = '',
    ) -> RegisteredScan:
        """Register a scan by its `TARGET_POINT`s; a ValueError says why it does not fit.

        The scans of each scanner come in the order of their stamps, ns; 0 is no stamp.
        """
        last = max((it.stamp for it in self.records if it.scanner == scanner), default=0)
        if last and stamp <= last:
            relation = 'before' if stamp < last else 'like'
            raise ValueError(
                f'stamp is {stamp / 1e9:.9f} s, {relation} that of the last scan, '
                f'{last / 1e9:.9f} s; accepted is a later one, or ~/reset of the node'
            )
        found = self.add(target_scan(target_points, minimum_confidence))
        name = f'{self._names}{len(self.records) + 1}'
        self.records.append(ScanRecord(name, stamp, frame_id, scanner))
        return found

    def last(self) -> str:
        """Return what became of the last scan, in words."""
        scan = self.field.scans[-1]
        return (
            f'{self.records[-1].name}, {len(scan.common)} of {len(scan.scan.names)} targets in '
            f'common, residuals {1e3 * scan.rms:.3f} mm (RMS)'
        )

    def undo(self) -> bool:
        """Take back the last scan or adjustment, as `Registration.undo` does."""
        is_scan = super().undo()
        if is_scan:
            self.records.pop()
        return is_scan

    def reset(self) -> None:
        """Forget all scans; known coordinates stay."""
        super().reset()
        self.records.clear()
