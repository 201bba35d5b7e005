"""Tables in CSV with a header, read so that errors name line and column."""

from __future__ import annotations

import csv
import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from ahf_ros.interchange.files import csv_text, read_text
from ahf_ros.text import shown


@dataclass(frozen=True)
class Row:
    """A row of a table: texts by column, and what errors call it."""

    cells: dict[str, str]
    where: str

    def text(self, name: str) -> str:
        """Return a text that is not empty."""
        text = self.cells.get(name, '')
        if not text or not text.isprintable():
            raise ValueError(
                f'{self.where}: {name} is {shown(text)}, accepted is a printable text'
            )
        return text

    def number(self, name: str, minimum: float = -math.inf) -> float:
        """Return a finite number that is not below a minimum."""
        text = self.cells.get(name, '')
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not (math.isfinite(number) and number >= minimum):
            at_least = '' if minimum == -math.inf else f' from {minimum:g}'
            raise ValueError(
                f'{self.where}: {name} is {shown(text)}, accepted is a finite number{at_least}'
            )
        return number

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


def read_table(path: str | Path, required: Collection[str]) -> tuple[tuple[str, ...], list[Row]]:
    """Return the columns and the rows of a CSV file, which commas or semicolons separate.

    A ValueError names the file if it is empty or lacks a column, or the line of a row that is
    longer or shorter than the header.
    """
    lines = read_text(path).splitlines()
    header = next((line for line in lines if line.strip()), '')
    columns: tuple[str, ...] = ()
    rows: list[Row] = []
    for number, cells in _cells(lines, ';' if ';' in header else ',', str(path)):
        where = f'{path}, line {number}'
        if not columns:
            columns = tuple(cell.lower() for cell in cells)
            continue
        if len(cells) != len(columns):
            raise ValueError(
                f'{where} has {len(cells)} cells, accepted are as many as columns, {len(columns)}'
            )
        rows.append(Row(dict(zip(columns, cells, strict=True)), where))
    if not columns:
        raise ValueError(f'{path} is empty, accepted is a table with {", ".join(required)}')
    if missing := [name for name in required if name not in columns]:
        raise ValueError(
            f'{path} has no column {", ".join(missing)}, accepted is a header with '
            f'{", ".join(required)}'
        )
    if twice := [name for name in columns if columns.count(name) > 1]:
        raise ValueError(f'{path} has the column {twice[0]} twice, accepted is once')
    if not rows:
        raise ValueError(f'{path} has a header and no rows, accepted is at least one')
    return columns, rows


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


def _cells(lines: list[str], delimiter: str, path: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the number of a line that is neither empty nor a comment, and its cells."""
    reader = csv.reader(lines, delimiter=delimiter)
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells) and not cells[0].startswith('#'):
                yield reader.line_num, [csv_text(cell.strip()) for cell in cells]
    except csv.Error as error:
        raise ValueError(f'{path}, line {reader.line_num}: {error}') from error
