"""Lists of measured points: label, x, y, z and what else a program writes behind them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ahf_ros.interchange.files import csv_text, read_text


def read_point_list(path: str | Path) -> dict[str, np.ndarray]:
    """Return the coordinates of measured points, float64 of shape (3,), by their labels.

    The file is text, one point a line: label, x, y, z, separated by commas or semicolons, as
    V-STARS writes them. Columns after the fourth are left alone, as are empty lines, lines that
    start with # and a first line of column names. A ValueError names the line and the field if a
    row is bad or a label is there twice, and the file if it cannot be read or has no point at all.
    """
    points: dict[str, np.ndarray] = {}
    lines: dict[str, int] = {}
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        cells = [cell.strip().strip('"') for cell in line.replace(';', ',').split(',')]
        if not line.strip() or line.lstrip().startswith('#'):
            continue
        if len(cells) < 4:
            raise ValueError(f'{path}, line {number}: {line!r}, accepted is label, x, y, z')
        if number == 1 and not any(_is_number(cell) for cell in cells[1:4]):
            continue
        for name, cell in zip('xyz', cells[1:4], strict=True):
            if not _is_number(cell):
                raise ValueError(
                    f'{path}, line {number}: {name} is {cell!r}, accepted is a finite number'
                )
        label = csv_text(cells[0])
        if label in points:
            raise ValueError(
                f'{path}, line {number}: label is {label!r}, which line {lines[label]} has '
                'already, accepted is one row a point'
            )
        points[label] = np.array([float(cell) for cell in cells[1:4]])
        lines[label] = number
    if not points:
        raise ValueError(f'{path} has no points, accepted are rows of label, x, y, z')
    return points


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False
