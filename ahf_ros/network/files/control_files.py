"""Known lengths and coordinates as tables: scale bars, calibrated lengths, control points."""

from collections.abc import Collection, Iterable
from pathlib import Path

import numpy as np

from ahf_ros.base.opening import reader
from ahf_ros.files.tables import POINT, Row, one_of, read_table
from ahf_ros.network.measurement import CalibratedLength
from ahf_ros.network.network import ControlPoint, FloatArray, ScaleBar

_ROLES = ('control', 'check')
_SIGMAS = ('sigma_x', 'sigma_y', 'sigma_z')
_ENTRIES = tuple(f'covariance_{it}' for it in ('xx', 'xy', 'xz', 'yy', 'yz', 'zz'))
_MIXED = tuple(f'covariance_{it}' for it in ('xy', 'xz', 'yz'))  # beside sigmas, as in points.csv


@reader('a table of scale bars in CSV')
def read_scale_bars(path: str | Path) -> tuple[ScaleBar, ...]:
    """Return scale bars from a table with id_1, id_2, length, sigma and, perhaps, role."""
    _, rows = read_table(path, ('id_1', 'id_2', 'length', 'sigma'))
    return tuple(
        ScaleBar(_ends(row), row.positive('length'), row.positive('sigma'), _is_check(row))
        for row in rows
    )


@reader('a table of lengths in CSV')
def read_lengths(path: str | Path) -> tuple[CalibratedLength, ...]:
    """Return calibrated lengths from a table with id_1, id_2, length and, perhaps, sigma and line.

    `line` names the measuring line that a length is part of.
    """
    columns, rows = read_table(path, ('id_1', 'id_2', 'length'))
    return tuple(
        CalibratedLength(
            _ends(row),
            row.positive('length'),
            row.number('sigma', 0.0) if 'sigma' in columns else 0.0,
            row.cells.get('line', ''),
        )
        for row in rows
    )


def _ends(row: Row) -> tuple[str, str]:
    ends = row.label('id_1'), row.label('id_2')
    if ends[0] == ends[1]:
        raise ValueError(f'{row.where}: both ends are {ends[0]}, accepted are two targets')
    return ends


def _is_check(row: Row) -> bool:
    return row.choice('role', _ROLES, 'control') == 'check'


@reader('a table of control points in CSV')
def read_control(path: str | Path, sigma: float = 0.0) -> tuple[ControlPoint, ...]:
    """Return control points from a table with id, x, y, z and, perhaps, role.

    Their precision is in sigma_x, sigma_y, sigma_z, perhaps with covariance_xy, covariance_xz,
    covariance_yz as in our points.csv, or in covariance_xx to covariance_zz. `sigma` counts where
    the table says nothing; 0 fixes a point.
    """
    columns, rows = read_table(path, POINT)
    return control_points(path, columns, rows, sigma)


def control_points(
    path: str | Path, columns: Collection[str], rows: Iterable[Row], sigma: float = 0.0
) -> tuple[ControlPoint, ...]:
    """Return control points from rows with these columns, as `read_control` accepts them."""
    whole = 'covariance_xx' in columns
    group = one_of(path, columns, [_SIGMAS, _ENTRIES if whole else ('covariance_xx',)])
    points: dict[str, ControlPoint] = {}
    for row in rows:
        name = row.label('id')
        if name in points:
            raise ValueError(f'{row.where}: {name} is there twice, accepted is one row a point')
        covariance = _covariance(row, group, sigma)
        smallest = np.linalg.eigvalsh(covariance)[0]
        if smallest < -1e-9 * np.abs(covariance).max():
            raise ValueError(
                f'{row.where}: the covariance has the eigenvalue {smallest:.3g}, accepted is none '
                'below 0'
            )
        xyz = np.array([row.number(axis) for axis in 'xyz'])
        points[name] = ControlPoint(name, xyz, covariance, _is_check(row))
    return tuple(points.values())


def _covariance(row: Row, group: int, sigma: float) -> FloatArray:
    """Return the covariance of a control point by the columns that the table has."""
    covariance = sigma**2 * np.eye(3)
    if group == 0:
        covariance = np.diag([row.number(name, 0) ** 2 for name in _SIGMAS])
        if all(name in row.cells for name in _MIXED):
            covariance[np.triu_indices(3, 1)] = [row.number(name) for name in _MIXED]
    elif group == 1:
        covariance[np.triu_indices(3)] = [row.number(name) for name in _ENTRIES]
    upper = np.triu(covariance, 1)
    return np.diag(np.diag(covariance)) + upper + upper.T
