"""Known coordinates of targets in metres, from what `ahf orient` writes, CSV or JSON."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ahf_ros.base.opening import Most, parsed_json, read_text, reader
from ahf_ros.base.text import shown
from ahf_ros.base.writing import complete
from ahf_ros.files.tables import POINT, Row, read_table
from ahf_ros.network.files.control_files import control_points
from ahf_ros.network.files.network_results import read_network
from ahf_ros.network.network import ControlPoint
from ahf_ros.network.points import MeasuredPoints
from ahf_ros.network.units import METRES


@reader('coordinates of targets: what ahf orient writes, CSV or JSON')
def read_coordinates(path: str | Path, unit: str = '') -> MeasuredPoints:
    """Return targets with their coordinates and covariance in metres.

    The file is a folder that `ahf orient` wrote or its network.json; a table with id, x, y, z and,
    perhaps, their precision as `ahf orient --control` reads it, and a column `unit`; or JSON with
    a `unit` and `points`, a list of objects with the same fields. `unit` is needed where the file
    does not say it. A ValueError names what is missing, damaged, or contradicts the unit.
    """
    file = Path(path)
    complete(file.parent)
    if file.is_dir() or file.suffix.lower() == '.json':
        content = None if file.is_dir() else parsed_json(read_text(file, Most.JSON), str(file))
        if not isinstance(content, dict) or 'covariance_of_points' in content:
            points = read_network(file).points
            said = points.unit
        else:
            points, said = _from_json(content, file)
    else:
        columns, rows = read_table(file, POINT)
        said = _one_unit(rows, file)
        points = _measured(control_points(file, columns, rows))
    return in_metres(points, _chosen(said, unit, file))


def in_metres(points: MeasuredPoints, unit: str) -> MeasuredPoints:
    """Return points that are in one of `METRES` in metres."""
    factor = METRES[unit]
    return replace(
        points, xyz=factor * points.xyz, covariance=factor**2 * points.covariance, unit='m'
    )


def _chosen(said: str, unit: str, file: Path) -> str:
    """Return the unit that a file says or is given."""
    names = ', '.join(METRES)
    if said and unit and said != unit:
        raise ValueError(f'unit is {unit!r}, accepted is that of {file}, {said!r}')
    if (chosen := said or unit) not in METRES:
        where = f'unit of {file} is {shown(said)}' if said else f"unit is '' and {file} has none"
        raise ValueError(f'{where}, accepted is one of {names}')
    return chosen


def _from_json(content: Mapping[str, object], file: Path) -> tuple[MeasuredPoints, str]:
    points, unit = content.get('points'), content.get('unit', '')
    if not isinstance(points, list) or not points or not isinstance(unit, str):
        raise ValueError(
            f'{file} has no points, accepted is an object with a unit and points, a list of '
            'objects with id, x, y, z'
        )
    rows = []
    for number, point in enumerate(points, start=1):
        where = f'{file}: points {number}'
        if not isinstance(point, dict) or not point.keys() >= set(POINT):
            raise ValueError(f'{where} is {shown(point)}, accepted is an object with id, x, y, z')
        if point.keys() != points[0].keys():
            raise ValueError(f'{where}: accepted are the fields of the first point')
        rows.append(Row({name: str(value) for name, value in point.items()}, where))
    return _measured(control_points(file, rows[0].cells.keys(), rows)), unit


def _one_unit(rows: Iterable[Row], file: Path) -> str:
    units = {row.cells.get('unit', '') for row in rows}
    if len(units) > 1:
        raise ValueError(f'{file} has the units {", ".join(sorted(units))}, accepted is one')
    return units.pop()


def _measured(control: tuple[ControlPoint, ...]) -> MeasuredPoints:
    """Return points that are known independently of each other."""
    count = len(control)
    covariance = np.zeros((count, 3, count, 3))
    each = np.arange(count)
    covariance[each, :, each] = [it.covariance for it in control]
    return MeasuredPoints(
        names=tuple(it.name for it in control),
        xyz=np.array([it.xyz for it in control]),
        covariance=covariance.reshape(3 * count, 3 * count),
    )
