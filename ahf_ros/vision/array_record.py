"""Records of arrays with one row an object."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
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
        columns = _columns(tuple(self.__dataclass_fields__))(self)
        return type(self)(*[column[which] for column in columns])

    def replaced(self: _Record, which: np.ndarray, rows: _Record) -> _Record:
        """Return a copy whose rows in an index array or a mask are replaced by `rows`."""
        of = _columns(tuple(self.__dataclass_fields__))
        columns = [column.copy() for column in of(self)]
        for column, new in zip(columns, of(rows), strict=True):
            column[which] = new
        return type(self)(*columns)

    @classmethod
    def joined(cls: type[_Record], parts: Sequence[_Record]) -> _Record:
        """Return the rows of at least one record, one after the other."""
        columns = zip(*map(_columns(tuple(cls.__dataclass_fields__)), parts), strict=True)
        return cls(*[np.concatenate(of) for of in columns])


@cache
def _columns(names: tuple[str, ...]) -> Callable[[ArrayRecord], tuple[np.ndarray, ...]]:
    """Return what reads the columns of some names of a record, at least two."""
    return attrgetter(*names)
