"""Inner loops, compiled: the C library of this folder, called on numpy arrays without the GIL.

`kernels.h` declares the kernels, and nothing else does: each one is a function of this module that
takes its constant arrays and numbers and returns the others. Every shape is checked against the
declaration before the call, so that no kernel reads or writes beyond an array.

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
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

HEADER = Path(__file__).with_name('kernels.h')
SUFFIX = {'darwin': '.dylib', 'win32': '.dll'}.get(sys.platform, '.so')
LIBRARY = HEADER.with_name('libkernels' + SUFFIX)
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

    @staticmethod
    def parsed(text: str) -> Parameter:
        """Return the parameter that a declaration has."""
        constant, kind, name, shape = _PARAMETER.fullmatch(text.strip()).groups()  # type: ignore[union-attr]
        sides = tuple(re.findall(r'\w+', shape))
        return Parameter(name, kind, bool(constant) or (not sides and kind != 'count'), sides)


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
            if each.kind == 'count'
            else ctypes.c_void_p
            if each.sides
            else NUMBERS[each.kind][1]
            for each in self.parameters
        ]
        return function

    @cached_property
    def _given(self) -> list[Parameter]:
        return [each for each in self.parameters if each.given]

    def __call__(self, *values: ArrayLike, **counts: int) -> Any:
        """Call the kernel."""
        if len(values) != len(self._given):
            names = ', '.join(each.name for each in self._given)
            raise TypeError(
                f'the kernel {self.name} has {len(values)} arguments, accepted are {names}'
            )
        sizes = dict(counts)
        arguments: dict[str, Any] = {}
        for each, value in zip(self._given, values, strict=True):
            arguments[each.name] = self._array(each, value, sizes) if each.sides else value
        results = []
        for each in self.parameters:
            if each.kind == 'count':
                arguments[each.name] = sizes[each.name]
            elif not each.given:
                shape = [sizes[side] if side in sizes else int(side) for side in each.sides]
                result = np.empty(shape, NUMBERS[each.kind][0])
                results.append(result)
                arguments[each.name] = result
        if 0 in sizes.values():
            for result in results:
                result.fill(0)
        else:
            self._function(
                *(
                    arguments[each.name].ctypes.data if each.sides else arguments[each.name]
                    for each in self.parameters
                )
            )
        return results[0] if len(results) == 1 else tuple(results)

    def _array(self, each: Parameter, value: ArrayLike, sizes: dict[str, int]) -> np.ndarray:
        """Return an argument as the kernel takes it; its sides are added to the sizes."""
        array, dtype = np.asarray(value), NUMBERS[each.kind][0]
        if array.dtype != dtype and not np.can_cast(array.dtype, dtype, 'same_kind'):
            raise TypeError(
                f'{each.name} of the kernel {self.name} has the type {array.dtype}, '
                f'accepted is {dtype}'
            )
        agree = array.ndim == len(each.sides)
        for side, size in zip(each.sides, array.shape, strict=False):
            agree &= size == (int(side) if side.isdigit() else sizes.setdefault(side, size))
        if not agree:
            shape = ''.join(f'[{side}]' for side in each.sides)
            known = ', '.join(
                f'{it} = {sizes[it]}' for it in dict.fromkeys(each.sides) if it in sizes
            )
            if array.ndim != len(each.sides):
                known = ''
            raise ValueError(
                f'{each.name} of the kernel {self.name} has the shape {array.shape}, '
                f'accepted is {shape}{" with " if known else ""}{known}'
            )
        return np.ascontiguousarray(array, dtype)


def declared(header: str) -> dict[str, Kernel]:
    """Return the kernels of the text of a header, by their names."""
    return {
        name: Kernel(name, tuple(map(Parameter.parsed, parameters.split(','))))
        for name, parameters in _DECLARATION.findall(_COMMENT.sub('', header))
    }


@cache
def _kernels() -> dict[str, Kernel]:
    return declared(HEADER.read_text(encoding='utf-8'))


@cache
def _library() -> ctypes.CDLL:
    path = Path(os.environ.get(VARIABLE) or LIBRARY)
    if not path.exists():
        raise ImportError(
            f'{path} does not exist: the kernels of ahf_ros are not compiled; pip install . or '
            'python scripts/build_kernels.py compiles them'
        )
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise ImportError(
            f'{path} was compiled for another machine or is damaged ({error}); pip install . or '
            'python scripts/build_kernels.py compiles it for this one'
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
