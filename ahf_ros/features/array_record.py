"""Records of arrays with one row an object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np

_Record = TypeVar('_Record', bound='ArrayRecord')


@dataclass(frozen=True, slots=True)
class ArrayRecord:
    """Base of frozen dataclasses whose fields are arrays of k rows, row i being of object i.

    Examples
    --------
    >>> @dataclass(frozen=True)
    ... class Points(ArrayRecord):
    ...     x: np.ndarray
    ...     y: np.ndarray
    >>> points = Points(np.array([1, 2, 3]), np.array([4, 5, 6]))
    >>> points.select(points.x > 1)
    Points(x=array([2, 3]), y=array([5, 6]))
    """

    def select(self: _Record, which: np.ndarray | slice) -> _Record:
        """Return the rows of an index array, a mask of shape (k,) or a slice."""
        return type(self)(*(getattr(self, item.name)[which] for item in fields(self)))

    def replaced(self: _Record, which: np.ndarray, rows: _Record) -> _Record:
        """Return a copy whose rows in an index array or a mask are replaced by `rows`."""
        columns = []
        for item in fields(self):
            column = getattr(self, item.name).copy()
            column[which] = getattr(rows, item.name)
            columns.append(column)
        return type(self)(*columns)

    @classmethod
    def joined(cls: type[_Record], parts: Sequence[_Record]) -> _Record:
        """Return the rows of at least one record, one after the other."""
        names = [item.name for item in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
