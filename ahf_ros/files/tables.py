"""Tables of texts and numbers, read by the names of their columns.

Cells are separated by tabs, semicolons or commas. Where they are not separated by commas, numbers
may have decimal commas, all of them or none. Every error names line and column.
"""

import csv
import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ahf_ros.base.opening import LARGEST, Most, read_text, reader
from ahf_ros.base.text import shown
from ahf_ros.files.files import csv_text

POINT = ('id', 'x', 'y', 'z')
"""Columns of a table of points, and what lists without a header have in this order."""

NAMES: Mapping[str, str] = {
    **dict.fromkeys(('label', 'name', 'point', 'point id', 'point_id'), 'id'),
    **dict.fromkeys(('x/east', 'x/easting', 'east', 'easting', 'e'), 'x'),
    **dict.fromkeys(('y/north', 'y/northing', 'north', 'northing', 'n'), 'y'),
    **dict.fromkeys(('z/altitude', 'z/height', 'altitude', 'height', 'h', 'alt', 'up'), 'z'),
}
"""What other programs call the columns of points, in small letters and without units."""

_SEPARATORS = '\t', ';', ','
_NUMBER = re.compile(r'[-+]?([0-9]+[.,]?[0-9]*|[.,][0-9]+)([eE][-+]?[0-9]{1,4})?', re.ASCII)
_TARGET = re.compile(r'target ([0-9]+)', re.IGNORECASE)  # as Metashape labels what it detects
_UNIT = re.compile(r' *[(\[][^)\]]*[)\]]$')  # behind the name of a column


@dataclass(frozen=True)
class Row:
    """A row of a table: texts by column, and what errors call it.

    `marks` are the decimal points and commas of all rows of the table that were read so far.
    """

    cells: Mapping[str, str]
    where: str
    separator: str = ','
    marks: set[str] = field(default_factory=set)

    def text(self, name: str) -> str:
        """Return a text that is not empty."""
        text = self.cells.get(name, '')
        if not text or not text.isprintable():
            raise ValueError(
                f'{self.where}: {name} is {shown(text)}, accepted is a printable text'
            )
        return text

    def label(self, name: str) -> str:
        """Return the label of a target: its ID of one that Metashape calls `target 5`."""
        text = self.text(name)
        found = _TARGET.fullmatch(text)
        return found[1] if found else text

    def number(self, name: str, minimum: float = -LARGEST, maximum: float = LARGEST) -> float:
        """Return a finite number in a range."""
        text = self.cells.get(name, '')
        marks = set(text) & set('.,')
        decimal_comma = ',' in marks and self.separator != ','
        number = math.nan
        if _NUMBER.fullmatch(text) and (decimal_comma or ',' not in marks):
            self.marks.update(marks)
            number = float(text.replace(',', '.'))
        if len(self.marks) > 1:
            raise ValueError(
                f'{self.where}: {name} is {shown(text)}, and other numbers of the table have '
                'another decimal mark, accepted are points only or commas only'
            )
        if not minimum <= number <= maximum:
            between = f' from {minimum:g}' * (minimum > -LARGEST)
            between += f' to {maximum:g}' * (maximum < LARGEST)
            raise ValueError(
                f'{self.where}: {name} is {shown(text)}, accepted is a finite number{between}'
            )
        return number

    def integer(self, name: str, minimum: int, maximum: int) -> int:
        """Return an integer in a range."""
        text = self.cells.get(name, '')
        number = float(text) if _NUMBER.fullmatch(text) and ',' not in text else math.nan
        if not (number.is_integer() and minimum <= number <= maximum):
            raise ValueError(
                f'{self.where}: {name} is {shown(text)}, accepted is an integer from {minimum} to '
                f'{maximum}'
            )
        return int(number)

    def positive(self, name: str) -> float:
        """Return a finite number above 0."""
        number = self.number(name)
        if number <= 0:
            raise ValueError(f'{self.where}: {name} is {number:g}, accepted is a number above 0')
        return number

    def choice(self, name: str, accepted: Collection[str], default: str) -> str:
        """Return one of some words, the default where the cell is empty."""
        text = self.cells.get(name, '').lower() or default
        if text not in accepted:
            raise ValueError(
                f'{self.where}: {name} is {shown(text)}, accepted is {" or ".join(accepted)}'
            )
        return text


@reader('a table in CSV with a header')
def read_table(
    path: str | Path, required: Sequence[str], *, empty: bool = False
) -> tuple[tuple[str, ...], list[Row]]:
    """Return the columns and the rows of a table that has some columns.

    Columns of points may be called as in `NAMES`, and a list of points needs no header: its first
    columns are `POINT`, the others are left alone. A ValueError names the file if it lacks a
    column or, unless `empty` is accepted, has no rows; or the line of a row that is longer or
    shorter than the header.
    """
    lines = read_text(path, Most.TABLE).splitlines()
    columns, separator, first = _header(lines, str(path), required)
    rows: list[Row] = []
    marks: set[str] = set()
    longest, pointed = 0, False
    for number, cells in _cells(lines[first:], separator, str(path), first):
        where = f'{path}, line {number}'
        while len(cells) > len(columns) and not cells[-1]:
            cells.pop()
        if len(cells) < len(columns) or (first and len(cells) > len(columns)):
            raise ValueError(
                f'{where} has {len(cells)} cells, accepted are as many as columns, {len(columns)}'
                + _advice(separator)
            )
        longest = max(longest, len(cells))
        pointed |= any('.' in cell for cell in cells[1:])
        rows.append(Row(dict(zip(columns, cells, strict=False)), where, separator, marks))
    if longest > len(columns) and separator == ',' and not pointed:
        raise ValueError(
            f'{path} has {longest} cells a line, no header and no decimal points, accepted are '
            f'rows of {", ".join(columns)}{_advice(separator)}'
        )
    if not (rows or empty):
        raise ValueError(f'{path} has a header and no rows, accepted is at least one')
    return columns, rows


@reader('a table of points in CSV')
def read_points(path: str | Path) -> dict[str, np.ndarray]:
    """Return the coordinates of points, float64 of shape (3,), by their labels.

    The file is a table with the columns `POINT`, or a list of them without a header, as V-STARS
    writes it. A ValueError names the line and the field if a row is bad or a label is there twice.
    """
    points: dict[str, np.ndarray] = {}
    lines: dict[str, str] = {}
    for row in read_table(path, POINT)[1]:
        label = row.label('id')
        if label in points:
            raise ValueError(
                f'{row.where}: id is {shown(label)}, which {lines[label]} has already, accepted '
                'is one row a point'
            )
        points[label] = np.array([row.number(axis) for axis in 'xyz'])
        lines[label] = row.where.rpartition(', ')[2]
    return points


@reader('a table in CSV with a header')
def read_by_image(path: str | Path, column: str) -> dict[str, str]:
    """Return the text of a column for each image, from a table with image and that column."""
    _, rows = read_table(path, ('image', column))
    found: dict[str, str] = {}
    for row in rows:
        image, text = row.text('image'), row.text(column)
        if found.setdefault(image, text) != text:
            raise ValueError(f'{row.where}: {image} has two {column}s, accepted is one')
    return found


def one_of(path: str | Path, columns: Collection[str], groups: Collection[tuple[str, ...]]) -> int:
    """Return the number of the group of columns that a table has, -1 if it has none of them.

    A ValueError is raised if it has columns of two groups, or only a part of one.
    """
    present = [[name for name in group if name in columns] for group in groups]
    found = [index for index, names in enumerate(present) if names]
    if len(found) > 1:
        both = ' and '.join(', '.join(present[index]) for index in found)
        raise ValueError(f'{path} has the columns {both}, accepted is one of them')
    for index, group in enumerate(groups):
        if index in found and len(present[index]) < len(group):
            lacking = [name for name in group if name not in columns]
            raise ValueError(
                f'{path} has {", ".join(present[index])} and no {", ".join(lacking)}, accepted '
                'is all of them or none'
            )
    return found[0] if found else -1


def _header(
    lines: Sequence[str], path: str, required: Sequence[str]
) -> tuple[tuple[str, ...], str, int]:
    """Return the columns of a table, what separates its cells, and the line after its header.

    The header may be a comment, as Metashape writes it. The line is 0 where there is none.
    """
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if not text:
            continue
        separator = next((it for it in _SEPARATORS if it in line), ',')
        (_, cells), *_ = _cells([line.lstrip().removeprefix('#')], separator, path, number - 1, '')
        columns = _columns(cells, required)
        missing = [name for name in required if name not in columns]
        if text.startswith('#') and missing:
            continue
        place = cells[1 : len(POINT)] if tuple(required) == POINT else []
        if missing and len(place) == 3 and all(map(_NUMBER.fullmatch, place)):
            return POINT, separator, 0
        if missing:
            raise ValueError(
                f'{path} has no column {", ".join(missing)}, its columns are '
                f'{shown(", ".join(cells))}, accepted is a header with {", ".join(required)}'
            )
        if twice := [name for name in columns if columns.count(name) > 1]:
            raise ValueError(f'{path} has the column {twice[0]} twice, accepted is once')
        return columns, separator, number
    raise ValueError(f'{path} is empty, accepted is a table with {", ".join(required)}')


def _columns(cells: Sequence[str], required: Sequence[str]) -> tuple[str, ...]:
    """Return the names of columns, those of points as ours, unless ours are there as well."""
    names = tuple(cell.lower() for cell in cells)
    if tuple(required) != POINT:
        return names
    ours = [NAMES.get(_UNIT.sub('', name), _UNIT.sub('', name)) for name in names]
    return tuple(
        our if our in POINT and (our == name or our not in names) else name
        for name, our in zip(names, ours, strict=True)
    )


def _cells(
    lines: Sequence[str], separator: str, path: str, before: int, comment: str = '#'
) -> Iterator[tuple[int, list[str]]]:
    """Yield the number of a line that is neither empty nor a comment, and its cells."""
    rows = csv.reader(lines, delimiter=separator)
    try:
        for cells in rows:
            if any(cell.strip() for cell in cells) and not (
                comment and cells[0].startswith(comment)
            ):
                yield before + rows.line_num, [csv_text(cell.strip()) for cell in cells]
    except csv.Error as error:
        raise ValueError(f'{path}, line {before + rows.line_num}: {error}') from error


def _advice(separator: str) -> str:
    return '; decimal commas need semicolons or tabs between cells' * (separator == ',')
