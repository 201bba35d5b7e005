"""Registered scans as files: clouds in the common frame, transforms and targets."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.base.writing import write_set
from ahf_ros.clouds.registration.field import Field, RegisteredScan
from ahf_ros.files.cloud_files import AXES, write_pcd, write_ply
from ahf_ros.files.files import csv_table
from ahf_ros.network.network import FloatArray
from ahf_ros.network.transform import Transform

TRANSFORMS_JSON, TRANSFORMS_CSV, TARGETS_CSV = 'transforms.json', 'transforms.csv', 'targets.csv'

_POSE = ('x', 'y', 'z', 'qx', 'qy', 'qz', 'qw')
_AXES = ('x', 'y', 'z', 'rx', 'ry', 'rz')
_COVARIANCE = [f'covariance_{_AXES[i]}_{_AXES[j]}' for i in range(6) for j in range(i, 6)]


@dataclass(frozen=True)
class ScanRecord:
    """What a scan is called; the stamp is in ns, `frame_id` is the frame of the scanner."""

    name: str
    stamp: int = 0
    frame_id: str = ''
    scanner: str = ''  # name, where there are several


def in_common_frame(cloud: np.ndarray, transform: Transform) -> np.ndarray:
    """Return a copy of a cloud in the common frame.

    Points that are not finite or at 0, 0, 0 are missing: their coordinates become NaN. All other
    fields stay as they are.
    """
    points = np.stack([cloud[name].astype(float) for name in AXES], axis=-1)
    with np.errstate(invalid='ignore', over='ignore'):
        moved = transform.moved(points)
        moved[~(np.isfinite(points).all(axis=-1) & points.any(axis=-1))] = np.nan
        result = np.zeros(cloud.shape, cloud.dtype)  # also between the fields
        result[...] = cloud
        for axis, name in enumerate(AXES):
            result[name] = moved[..., axis]
    return result


def write_registration(
    folder: str | Path,
    frame: str,
    field: Field,
    records: Sequence[ScanRecord],
    clouds: Iterable[np.ndarray | None],
) -> tuple[Path, ...]:
    """Write the scans of a field to a folder as a set of files, and return the paths.

    There are one record and one cloud, an array (height, width), or None for each scan. Clouds are
    taken one after the other. Each becomes a PLY and a PCD file with the name of its scan, in the
    common frame.
    """

    def files() -> Iterator[tuple[str, bytes]]:
        for record, scan, cloud in zip(records, field.scans, clouds, strict=True):
            if cloud is not None:
                moved = in_common_frame(cloud, scan.transform)
                yield f'{record.name}.ply', write_ply(moved)
                yield f'{record.name}.pcd', write_pcd(moved)
        yield TRANSFORMS_CSV, _as_table(field, records)
        yield TARGETS_CSV, _targets(field)

    scans = [_scan(record, scan) for record, scan in zip(records, field.scans, strict=True)]
    about = {'version': 1, 'unit': 'm', 'frame': frame, 'scans': scans}
    return write_set(folder, TRANSFORMS_JSON, about, files())


def _scan(record: ScanRecord, scan: RegisteredScan) -> dict[str, Any]:
    transform = scan.transform
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = transform.rotation, transform.translation
    return {
        'name': record.name,
        'stamp': record.stamp,
        'frame_id': record.frame_id,
        'translation': transform.translation.tolist(),
        'quaternion': transform.quaternion.tolist(),
        'matrix': matrix.tolist(),
        'covariance': transform.covariance.tolist(),
        'residuals': {
            name: residual.tolist()
            for name, residual in zip(scan.common, scan.residuals, strict=True)
        },
    }


def _as_table(field: Field, records: Sequence[ScanRecord]) -> bytes:
    rows: list[Sequence[object]] = [['name', 'stamp', *_POSE, *_COVARIANCE]]
    for record, scan in zip(records, field.scans, strict=True):
        transform = scan.transform
        place = [*transform.translation, *transform.quaternion]
        entries = transform.covariance[np.triu_indices(6)]
        rows.append([record.name, record.stamp, *_digits(place, 12), *_digits(entries, 9)])
    return csv_table(rows)


def _targets(field: Field) -> bytes:
    """Return the targets of a field as `ahf orient --control` reads them, m."""
    header = 'id x y z sigma_x sigma_y sigma_z covariance_xy covariance_xz covariance_yz unit'
    rows: list[Sequence[object]] = [header.split()]
    for name, point, own in zip(field.names, field.points, field.covariances, strict=True):
        precision = [*np.sqrt(np.diag(own)), *own[np.triu_indices(3, 1)]]
        rows.append([name, *_digits(point, 12), *_digits(precision, 9), 'm'])
    return csv_table(rows)


def _digits(values: Sequence[float] | FloatArray, count: int) -> list[str]:
    return [f'{value:.{count}g}' for value in values]
