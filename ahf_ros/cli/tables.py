"""Tables for people, on standard error, and IDs in options."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence

_ROWS = 30
"""Rows that are shown; files and JSON have all."""

_WIDTH = 120  # characters
_HELD = 1e-6  # of the largest standard deviation: what is held by an alignment, and rounding


def identifiers(text: str) -> tuple[str, ...]:
    """Return IDs that commas separate, each once."""
    names = tuple(it.strip() for it in text.split(','))
    if not all(names) or len(set(names)) < len(names):
        raise ValueError(f'{text!r} is no list of IDs, accepted is A,B,C with each ID once')
    return names


def print_table(title: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table, numbers to the right; of long ones the first rows."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    rows = list(rows)
    table = Table(title=escape(title), title_justify='left', title_style='bold')
    for number, name in enumerate(head):
        table.add_column(escape(name), justify='right' if number else 'left')
    for row in rows[:_ROWS]:
        table.add_row(*map(escape, row))
    if len(rows) > _ROWS:
        table.add_row(f'and {len(rows) - _ROWS} more', *[''] * (len(head) - 1))
    # A pipe has no width; cells are not broken there.
    Console(stderr=True, width=None if sys.stderr.isatty() else _WIDTH).print(table)


def decimals(sigmas: Iterable[float]) -> int:
    """Return how many decimals show the smallest standard deviation with two digits."""
    listed = list(sigmas)
    above = [it for it in listed if it > _HELD * max(listed)]
    return min(max(1 - math.floor(math.log10(min(above))), 0), 12) if above else 6
