"""Tables of the targets that images show, as CSV files."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

from ahf_ros.interchange.fields import checked_file_name, parsed_integer, parsed_number
from ahf_ros.interchange.files import read_text, write_whole
from ahf_ros.target import UNDECODED, TrueTarget, Truth
from ahf_ros.target_check import MAXIMUM_ID, MAXIMUM_LENGTH_PX


def read_truth(path: str | Path) -> dict[str, tuple[TrueTarget, ...]]:
    """Return the targets that images show, from a table.

    Parameters
    ----------
    path : str or Path
        CSV file in UTF-8. Its header names the columns image, id, x, y and, optionally, confirmed
        (1 or 0), in any order; other columns are ignored, and so are the folders of an image.

    Returns
    -------
    dict of str to tuple of TrueTarget
        The targets of each image.

    Raises
    ------
    ValueError
        If the file cannot be read or a line is not as described; the message names both.
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
            name = checked_file_name(row['image'], f'{where}: image')
            if images.setdefault(name, row['image']) != row['image']:
                raise ValueError(
                    f'{where}: {name} is in two folders, accepted is one image a name'
                )
            truth.setdefault(name, []).append(_target(row, where))
    except csv.Error as error:
        raise ValueError(f'{path}, line {rows.line_num + 1}: {error}') from error
    return {name: tuple(targets) for name, targets in truth.items()}


def write_truth(path: str | Path, truth: Truth) -> None:
    """Write the targets that images show as a table for `read_truth`.

    Parameters
    ----------
    path : str or Path
        The file; an existing one is replaced, a missing folder is created.
    truth : mapping of str to sequence of TrueTarget
        The targets of each image; coordinates are written to 0.0001 px.

    Raises
    ------
    ValueError
        If the file cannot be written.
    """
    rows = [['image', 'id', 'x', 'y', 'confirmed']]
    for name, targets in truth.items():
        for item in targets:
            place = [f'{item.x:.4f}', f'{item.y:.4f}']
            rows.append([name, str(item.id), *place, str(int(item.confirmed))])
    table = io.StringIO()
    csv.writer(table, lineterminator='\n').writerows(rows)
    write_whole(path, table.getvalue().encode())


def _target(row: dict[str, Any], where: str) -> TrueTarget:
    place = -MAXIMUM_LENGTH_PX, MAXIMUM_LENGTH_PX
    return TrueTarget(
        parsed_integer(row['id'], f'{where}: id', UNDECODED, MAXIMUM_ID),
        parsed_number(row['x'], f'{where}: x', *place),
        parsed_number(row['y'], f'{where}: y', *place),
        parsed_integer(row.get('confirmed', 1), f'{where}: confirmed', 0, 1) == 1,
    )
