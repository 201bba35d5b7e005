"""Names of files, lines, and tables in CSV in which a spreadsheet computes nothing."""

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import PurePath
from typing import Any

from ahf_ros.base.text import printable, shown

RESULTS_FILE = 'results.jsonl'
"""Name of the file in a folder that `ahf identify --output` writes."""

_APOSTROPHE = "'"
_FORMULA = frozenset('=+-@')  # how a formula begins; tabs and line ends are escaped


def checked_file_name(value: Any, name: str) -> str:
    """Return the file name of a path without folders, or raise a ValueError that calls it so."""
    if not isinstance(value, str) or not PurePath(value).name:
        raise ValueError(f'{name} is {shown(value)}, accepted is the name of a file')
    return PurePath(value).name


def text_of(lines: Iterable[str]) -> bytes:
    """Return the file of some lines in UTF-8."""
    return ''.join(f'{line}\n' for line in lines).encode()


def csv_table(rows: Iterable[Sequence[object]]) -> bytes:
    """Return rows as CSV in UTF-8, in which no text is a formula or has control characters.

    Before a text that a spreadsheet would compute stands an apostrophe, as OWASP advises;
    `csv_text` takes it away.
    """
    file = io.StringIO()
    lines = csv.writer(file, lineterminator='\n')
    lines.writerows([_csv_cell(cell) for cell in row] for row in rows)
    return file.getvalue().encode()


def csv_text(cell: str) -> str:
    """Return the text of a cell that `csv_table` has written.

    Examples
    --------
    >>> csv_text("'=1+1"), csv_text("'a'"), csv_text('-1')
    ('=1+1', "'a'", '-1')
    """
    return cell[1:] if cell.startswith(_APOSTROPHE) and _is_formula(cell) else cell


def _csv_cell(value: object) -> object:
    if not isinstance(value, str):
        return value
    text = printable(value, len(value))
    return _APOSTROPHE + text if _is_formula(text) else text


def _is_formula(text: str) -> bool:
    """Return whether a spreadsheet would compute a text without the apostrophes before it."""
    if text.lstrip(_APOSTROPHE)[:1] not in _FORMULA:
        return False
    try:
        float(text)
    except ValueError:
        return True
    return False
