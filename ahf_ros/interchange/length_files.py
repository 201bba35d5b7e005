"""Calibrated lengths as a table."""

from __future__ import annotations

from pathlib import Path

from ahf_ros.interchange.tables import read_table
from ahf_ros.orientation.measurement import CalibratedLength


def read_lengths(path: str | Path) -> tuple[CalibratedLength, ...]:
    """Return calibrated lengths from a table with id_1, id_2, length and, perhaps, sigma and line.

    `line` names the measuring line that a length is part of. A ValueError names line and column
    of what is not accepted.
    """
    columns, rows = read_table(path, ('id_1', 'id_2', 'length'))
    lengths = []
    for row in rows:
        ends = row.text('id_1'), row.text('id_2')
        if ends[0] == ends[1]:
            raise ValueError(f'{row.where}: both ends are {ends[0]}, accepted are two targets')
        sigma = row.number('sigma', 0.0) if 'sigma' in columns else 0.0
        line = row.cells.get('line', '')
        lengths.append(CalibratedLength(ends, row.positive('length'), sigma, line))
    return tuple(lengths)
