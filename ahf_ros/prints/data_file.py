"""Data files that describe families of targets, read so that errors name line and field."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from ahf_ros.base.opening import Most, read_text, reader
from ahf_ros.base.parsed_yaml import Listing, Mapping, parsed_yaml


@dataclass(frozen=True, slots=True)
class Entry:
    """A value in a data file, and where it stands.

    `source` is the name of the file, `field` the path of the value from its top, such as
    `codes.18`, empty for the whole file; lines count from 1.
    """

    source: str
    field: str
    line: int
    value: Any

    def refuse(self, accepted: str) -> NoReturn:
        """Raise a ValueError that names file, line, field, value and what is accepted."""
        text = repr(self.value)
        text = text if len(text) <= 80 else f'{text[:77]}...'
        raise ValueError(
            f'{self.source}, line {self.line}: {self.field or "the file"} is {text}, '
            f'accepted is {accepted}'
        )

    def keys(self, required: Sequence[str], optional: Sequence[str] = ()) -> dict[str, Entry]:
        """Return the entries of a mapping that has the required keys and no unknown ones."""
        entries = dict(self.items())
        known = (*required, *optional)
        for name, entry in entries.items():
            if name not in known:
                entry.refuse(f'one of the fields {", ".join(known)} in its place')
        for name in required:
            if name not in entries:
                self.refuse(f'a mapping with the field {name}')
        return entries

    def items(self) -> Iterator[tuple[str, Entry]]:
        """Yield keys, as texts, and entries of a mapping."""
        if not isinstance(self.value, Mapping):
            self.refuse('a mapping')
        for key, value in self.value.items():
            line = self.value.lines[key]
            field = f'{self.field}.{key}' if self.field else str(key)
            yield str(key), Entry(self.source, field, line, value)

    def list(self, accepted: str, lengths: Sequence[int] = ()) -> list[Entry]:
        """Return the entries of a list, of one of some lengths where these are given."""
        if not isinstance(self.value, Listing) or (lengths and len(self.value) not in lengths):
            self.refuse(accepted)
        return [
            Entry(self.source, f'{self.field}[{index}]', self.value.lines[index], value)
            for index, value in enumerate(self.value)
        ]

    def integer(self, minimum: int, maximum: int) -> int:
        """Return an integer in a range."""
        value = self.value
        whole = isinstance(value, int) and not isinstance(value, bool)
        if not whole or not minimum <= value <= maximum:
            self.refuse(f'an integer from {minimum} to {maximum}')
        return int(value)

    def number(self, accepted: str, minimum: float = -math.inf) -> float:
        """Return a finite number of at least `minimum`."""
        value = self.value
        known = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not known or not math.isfinite(value) or value < minimum:
            self.refuse(accepted)
        return float(value)

    def text(self) -> str:
        """Return a text that is not empty."""
        if not isinstance(self.value, str) or not self.value.strip():
            self.refuse('a text')
        return str(self.value)


@reader('a data file of a family, in YAML or JSON')
def read_data_file(path: str | Path) -> Entry:
    """Return the content of a YAML or JSON file.

    Raise a ValueError that names the line if it is neither, or says why it cannot be read.
    """
    return Entry(str(path), '', 1, parsed_yaml(read_text(path, Most.YAML), str(path)))


def pinhole_in(fields: dict[str, Entry]) -> float:
    """Return the radius of the hole in a dot, in its radii, 0 where the fields have none."""
    accepted = 'a radius from 0 to 0.5 radii of the dot'
    radius = fields['pinhole'].number(accepted, 0.0) if 'pinhole' in fields else 0.0
    return radius if radius <= 0.5 else fields['pinhole'].refuse(accepted)
