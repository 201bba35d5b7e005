"""Tables of the targets that images show, as CSV files."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

from ahf_ros.interchange.files import checked_file_name, csv_table, csv_text, read_text
from ahf_ros.target import UNDECODED, TrueTarget, Truth
from ahf_ros.target_check import MAXIMUM_ID, MAXIMUM_LENGTH_PX
from ahf_ros.text import shown
from ahf_ros.writing import write_whole

_LIMITS = {
    'id': (UNDECODED, MAXIMUM_ID),
    'x': (-MAXIMUM_LENGTH_PX, MAXIMUM_LENGTH_PX),
    'y': (-MAXIMUM_LENGTH_PX, MAXIMUM_LENGTH_PX),
    'confirmed': (0, 1),
}
"""Columns with numbers, and what is accepted in them: integers if the limits are integers."""


def read_truth(path: str | Path) -> dict[str, tuple[TrueTarget, ...]]:
    """Return the targets that images show, from a CSV file in UTF-8.

    Its header names the columns image, id, x, y and, optionally, confirmed (1 or 0), in any order;
    other columns are ignored, and so are the folders of an image. A ValueError names a file or
    line that is not like that.
    """
    rows = csv.DictReader(read_text(path).splitlines())
    truth: dict[str, list[TrueTarget]] = {}
    images: dict[str, str] = {}
    try:
        missing = {'image', 'id', 'x', 'y'} - set(rows.fieldnames or ())
        if missing:
            raise ValueError(f'{path} has no column {", ".join(sorted(missing))}')
        for row in rows:
            where = f'{path}, line {rows.line_num}'
            image = csv_text(row['image'] or '')
            name = checked_file_name(image, f'{where}: image')
            if images.setdefault(name, image) != image:
                raise ValueError(
                    f'{where}: {name} is in two folders, accepted is one image a name'
                )
            truth.setdefault(name, []).append(_target(row, where))
    except csv.Error as error:
        raise ValueError(f'{path}, line {rows.line_num + 1}: {error}') from error
    return {name: tuple(targets) for name, targets in truth.items()}


def write_truth(path: str | Path, truth: Truth) -> None:
    """Write the targets that images show for `read_truth`, as a file that is whole or not there.

    Coordinates are written to 0.0001 px. A ValueError names a file that cannot be written.
    """
    rows = [['image', 'id', 'x', 'y', 'confirmed']]
    for name, targets in truth.items():
        for item in targets:
            place = [f'{item.x:.4f}', f'{item.y:.4f}']
            rows.append([name, str(item.id), *place, str(int(item.confirmed))])
    write_whole(path, csv_table(rows))


def _target(row: dict[str, Any], where: str) -> TrueTarget:
    values = {}
    for name, (minimum, maximum) in _LIMITS.items():
        text = row.get(name, 1)  # only `confirmed` may be missing
        whole = isinstance(minimum, int)
        try:
            number = int(text) if whole else float(text)
        except (TypeError, ValueError):
            number = math.nan
        if not minimum <= number <= maximum:
            raise ValueError(
                f'{where}: {name} is {shown(text)}, accepted is '
                f'{"an integer" if whole else "a number"} from {minimum:.10g} to {maximum:.10g}'
            )
        values[name] = number
    confirmed = values['confirmed'] == 1
    return TrueTarget(int(values['id']), values['x'], values['y'], confirmed)
