"""Inner loops, compiled: the C library of this folder, called on numpy arrays without the GIL.

`kernels.h` declares the kernels, and nothing else does: each one is a function of this module that
takes its constant arrays and numbers and returns the others. Every shape is checked against the
declaration before the call, so that no kernel reads or writes beyond an array.

Rows that are independent of each other may be shared among threads, see `shared`.

Examples
--------
>>> from ahf_ros import kernels
>>> kernels.exponentials([0.0, 1.0]).round(6)
array([1.      , 2.718282])
>>> kernels.exponentials([[0.0]])
Traceback (most recent call last):
ValueError: x of the kernel exponentials has the shape (1, 1), accepted is [n]
"""

from __future__ import annotations

import ctypes
import os
import re
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

HEADER = Path(__file__).with_name('kernels.h')
# Its sources and what was compiled of them may be in two places.
_PACKAGE = sys.modules[__name__.partition('.')[0]]
_PLACES = [Path(folder, 'kernels', 'kernels.bin') for folder in _PACKAGE.__path__]
LIBRARY = next((path for path in _PLACES if path.exists()), HEADER.with_name('kernels.bin'))
VARIABLE = 'AHF_ROS_KERNELS'
"""Names another library, such as one with sanitizers."""

NUMBERS: dict[str, tuple[np.dtype[Any], Any]] = {
    'bool': (np.dtype(np.bool_), ctypes.c_bool),
    'double': (np.dtype(np.float64), ctypes.c_double),
    'float': (np.dtype(np.float32), ctypes.c_float),
    'int16_t': (np.dtype(np.int16), ctypes.c_int16),
    'int32_t': (np.dtype(np.int32), ctypes.c_int32),
    'int64_t': (np.dtype(np.int64), ctypes.c_int64),
    'uint8_t': (np.dtype(np.uint8), ctypes.c_uint8),
    'uint16_t': (np.dtype(np.uint16), ctypes.c_uint16),
}
"""The types of numbers in the header, in numpy and in ctypes."""

_COUNTS = 'count', 'rows'

WORTH = 5e-4
"""Time of a call from which it is shared among threads, s: ten times what it takes to share it."""

_THREADS: ContextVar[int] = ContextVar('threads', default=1)
_TIMES: dict[str, float] = {}  # of a row, s, in the last call of each kernel that may be shared

_COMMENT = re.compile(r'/\*.*?\*/', re.S)
_DECLARATION = re.compile(r'\bvoid\s+(\w+)\(([^)]*)\);')
_PARAMETER = re.compile(r'(const\s+)?(\w+)\s+(\w+)((?:\[\w+\])*)')


@dataclass(frozen=True)
class Parameter:
    """A parameter of a kernel."""

    name: str
    kind: str
    given: bool  # or else a count or a result
    sides: tuple[str, ...]  # of an array; names of counts, or numbers

    @cached_property
    def dimensions(self) -> int:
        """How many sides an array has."""
        return len(self.sides)

    @property
    def is_count(self) -> bool:
        """Whether it says how many there are of something."""
        return self.kind in _COUNTS

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """What numpy calls the type."""
        return NUMBERS[self.kind][0]

    @staticmethod
    def parsed(text: str) -> Parameter:
        """Return the parameter that a declaration has."""
        parts = _PARAMETER.fullmatch(text.strip())
        if not parts or parts[2] not in (*NUMBERS, *_COUNTS):
            raise ValueError(f'the parameter is {text.strip()}, accepted is TYPE name[count]')
        constant, kind, name, shape = parts.groups()
        sides = tuple(re.findall(r'\w+', shape))
        return Parameter(name, kind, bool(constant) or (not sides and kind not in _COUNTS), sides)


@dataclass(frozen=True)
class Kernel:
    """A compiled function.

    Parameters
    ----------
    *values : array_like
        Its constant arrays and its numbers, in the order of the declaration. What numpy casts
        within a kind becomes the type that is declared.
    **counts : int
        Those that no constant array has.

    Returns
    -------
    ndarray or tuple of ndarray
        The other arrays; 0 where a count is 0.

    Raises
    ------
    TypeError
        If there are more values or fewer, or if one of them is of another kind.
    ValueError
        If shapes do not agree.
    """

    name: str
    parameters: tuple[Parameter, ...]

    @cached_property
    def _function(self) -> Any:
        function = getattr(_library(), self.name)
        function.restype = None
        function.argtypes = [
            ctypes.c_ssize_t
            if each.is_count
            else ctypes.c_void_p
            if each.sides
            else NUMBERS[each.kind][1]
            for each in self.parameters
        ]
        return function

    @cached_property
    def _plan(self) -> tuple[list[Parameter], list[Parameter], dict[str, int]]:
        """The arguments; the results; and the sizes that shapes state as numbers."""
        given = [each for each in self.parameters if each.given]
        results = [each for each in self.parameters if not (each.given or each.is_count)]
        numbers = {
            side: int(side) for each in self.parameters for side in each.sides if side.isdigit()
        }
        return given, results, numbers

    def __call__(self, *values: Any, **counts: int) -> Any:
        """Call the kernel."""
        given, results, numbers = self._plan
        if len(values) != len(given):
            names = ', '.join(each.name for each in given)
            raise TypeError(
                f'the kernel {self.name} has {len(values)} arguments, accepted are {names}'
            )
        # Kernels are called often for small arrays: here is no call that can be spared.
        sizes, taken = numbers | counts, {}
        for each, value in zip(given, values, strict=True):
            if each.sides:
                if not (
                    type(value) is np.ndarray
                    and value.dtype is each.dtype
                    and value.flags.c_contiguous
                ):
                    value = _as_declared(value, each, self.name)
                if value.ndim != each.dimensions:
                    raise self._refusal(each, value, {})
                for side, size in zip(each.sides, value.shape, strict=True):
                    if side not in sizes:
                        sizes[side] = size
                    elif sizes[side] != size:
                        raise self._refusal(each, value, sizes)
            taken[each.name] = value
        for each in results:
            taken[each.name] = np.empty([sizes[side] for side in each.sides], each.dtype)
        if 0 in sizes.values():
            for each in results:
                taken[each.name].fill(0)
        else:
            taken |= sizes
            threads = _THREADS.get() if self._rows else 1
            if threads > 1:
                self._timed(taken, min(threads, sizes[self._rows]))
            else:
                self._run(taken)
        if len(results) == 1:
            return taken[results[0].name]
        return tuple([taken[each.name] for each in results])

    @cached_property
    def _rows(self) -> str:
        """The count of what is independent of each other; empty if nothing is."""
        return next((each.name for each in self.parameters if each.kind == 'rows'), '')

    def _run(self, taken: dict[str, Any]) -> None:
        """Call the compiled function."""
        self._function(
            *[
                taken[each.name].__array_interface__['data'][0] if each.sides else taken[each.name]
                for each in self.parameters
            ]
        )

    def _timed(self, taken: dict[str, Any], threads: int) -> None:
        """Call it, by threads where its rows took long enough the last time."""
        rows, started = taken[self._rows], perf_counter()
        parts = threads if rows * _TIMES.get(self.name, 0.0) > WORTH else 1
        if parts > 1:
            self._shared(taken, parts)
        else:
            self._run(taken)
        _TIMES[self.name] = parts * (perf_counter() - started) / rows

    def _shared(self, taken: dict[str, Any], parts: int) -> None:
        """Call it for parts of the rows at the same time."""
        bounds = [taken[self._rows] * number // parts for number in range(parts + 1)]
        pieces = [self._piece(taken, *of) for of in pairwise(bounds)]
        others = []
        for piece in pieces[1:]:
            try:
                others.append(_pool().submit(self._run, piece))
            except RuntimeError:  # the process ends, and no thread begins any more
                self._run(piece)
        self._run(pieces[0])
        for other in others:
            other.result()
        for each in self._plan[1]:
            if self._rows in each.sides[1:]:
                axis = each.sides.index(self._rows)
                taken[each.name] = np.concatenate([of[each.name] for of in pieces], axis=axis)

    def _piece(self, taken: dict[str, Any], start: int, stop: int) -> dict[str, Any]:
        """Return the values of some rows; what is no part of all has room of its own."""
        piece = taken | {self._rows: stop - start}
        for each in self.parameters:
            if not each.sides or (each.given and self._rows not in each.sides):
                continue
            some = [slice(start, stop) if of == self._rows else slice(None) for of in each.sides]
            part = taken[each.name][tuple(some)]
            if each.given:
                part = np.ascontiguousarray(part)
            elif each.sides[0] != self._rows:  # its rows do not follow each other
                part = np.empty(part.shape, each.dtype)
            piece[each.name] = part
        return piece

    def _refusal(self, each: Parameter, value: np.ndarray, sizes: dict[str, int]) -> ValueError:
        known = ', '.join(f'{it} = {sizes[it]}' for it in dict.fromkeys(each.sides) if it in sizes)
        return ValueError(
            f'{each.name} of the kernel {self.name} has the shape {value.shape}, accepted is '
            f'{"".join(f"[{side}]" for side in each.sides)}{" with " * bool(known)}{known}'
        )


def _as_declared(value: Any, each: Parameter, kernel: str) -> np.ndarray:
    """Return an argument as an array in C order of the declared type."""
    array = value if isinstance(value, np.ndarray) else np.asarray(value)
    if array.dtype != each.dtype and not np.can_cast(array.dtype, each.dtype, 'same_kind'):
        raise TypeError(
            f'{each.name} of the kernel {kernel} has the type {array.dtype}, accepted is '
            f'{each.dtype}'
        )
    return array.astype(each.dtype, order='C')


def declared(header: str) -> dict[str, Kernel]:
    """Return the kernels of the text of a header, by their names."""
    return {
        name: Kernel(name, tuple(map(Parameter.parsed, parameters.split(','))))
        for name, parameters in _DECLARATION.findall(_COMMENT.sub('', header))
    }


@cache
def _kernels() -> dict[str, Kernel]:
    return declared(HEADER.read_text(encoding='utf-8'))


@contextmanager
def shared(threads: int) -> Iterator[None]:
    """Share the rows of long calls among threads; the results are the same, bit for bit.

    It holds for the calls of the thread that enters it.
    """
    before = _THREADS.set(threads)
    try:
        yield
    finally:
        _THREADS.reset(before)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(thread_name_prefix=__name__)


if hasattr(os, 'register_at_fork'):  # a process has no threads of the one that it was forked from
    os.register_at_fork(after_in_child=_pool.cache_clear)


@cache
def _library() -> ctypes.CDLL:
    path = Path(os.environ.get(VARIABLE) or LIBRARY)
    if not path.exists():
        raise ImportError(
            f'{path} does not exist: the kernels of ahf_ros are not compiled; pip install . or '
            'python scripts/build_kernels.py compiles them',
            name=__name__,
        )
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise ImportError(
            f'{path} was compiled for another machine or is damaged ({error}); pip install . or '
            'python scripts/build_kernels.py compiles it for this one',
            name=__name__,
        ) from error


def __getattr__(name: str) -> Kernel:
    """Return a kernel."""
    try:
        kernel = _kernels()[name]
    except KeyError:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}') from None
    globals()[name] = kernel
    return kernel


def __dir__() -> list[str]:
    """Return the names of the kernels, too."""
    return sorted({*globals(), *_kernels()})
