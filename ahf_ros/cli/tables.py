"""Tables for people, on standard error, and IDs in options."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from ahf_ros.base.text import printable

if TYPE_CHECKING:
    from rich.console import Console

_ROWS = 30
"""Rows that are shown; files and JSON have all."""

_WIDTH = 120  # characters, of a pipe


def identifiers(text: str) -> tuple[str, ...]:
    """Return IDs that commas separate, each once."""
    names = tuple(it.strip() for it in text.split(','))
    if not all(names) or len(set(names)) < len(names):
        raise ValueError(f'{text!r} is no list of IDs, accepted is A,B,C with each ID once')
    return names


def terminal() -> Console:
    """Return where tables are shown: standard error, wide enough where it is a pipe."""
    from rich.console import Console

    return Console(stderr=True, width=None if sys.stderr.isatty() else _WIDTH)


def print_table(
    title: str, head: Sequence[str], rows: Iterable[Sequence[str]], console: Console | None = None
) -> None:
    """Print a table, numbers to the right; of long ones the first rows.

    Without names of columns there is no head.
    """
    from rich.markup import escape
    from rich.table import Table

    def cell(text: str) -> str:
        return escape(printable(text, len(text)))

    rows = list(rows)
    table = Table(title=cell(title), title_justify='left', title_style='bold')
    table.show_header = any(head)
    for number, name in enumerate(head):
        table.add_column(escape(name), justify='right' if number and name != 'why' else 'left')
    for row in rows[:_ROWS]:
        table.add_row(*map(cell, row))
    if len(rows) > _ROWS:
        table.add_row(f'and {len(rows) - _ROWS} more', *[''] * (len(head) - 1))
    (console or terminal()).print(table)
