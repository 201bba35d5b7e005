"""The one gate for results of detectors: behind it, targets fit into messages, JSON and overlays.

Detectors of other packages, commands, services and refinements pass it. Nothing else checks.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields
from functools import partial
from itertools import islice
from numbers import Real
from typing import Any

import numpy as np

from ahf_ros.base.target import UNDECODED, SquareMarker, Target
from ahf_ros.base.text import shown

MAXIMUM_ID = 2**31 - 1
"""Maximum ID, as in the message."""

MAXIMUM_LENGTH_PX = 65536.0
"""Maximum size of a coordinate or a semi-axis, px: more than the side of the largest image."""

_MAXIMUM_COUNT = 100_000  # of targets in a result
_MAXIMUM_TEXT = 200  # characters of the name of a family
_ASYMMETRY = 1e-5  # of a covariance, which rounding may leave, as a share of its largest element


def checked_targets(found: Any, name: str) -> list[Target]:
    """Return a result as a list of targets of Python numbers in the ranges of `CodedTarget.msg`.

    A ValueError is raised if what a detector or a refinement returned is not a list or tuple of
    `Target` with fields as `checked_target` accepts them. The message names the detector as
    `name` does, the target, the field, its value and what is accepted.
    """
    if not isinstance(found, (list, tuple)):
        raise ValueError(f'{name} returned {shown(found)}, accepted is a list of targets')
    items = list(islice(found, _MAXIMUM_COUNT + 1))
    if len(items) > _MAXIMUM_COUNT:
        raise ValueError(
            f'{name} returned more targets than are accepted, at most {_MAXIMUM_COUNT}'
        )
    return [
        checked_target(target, f'{name}: target {number}') for number, target in enumerate(items)
    ]


def checked_target(target: Any, name: str) -> Target:
    """Return a target whose fields are Python numbers in the ranges of `CodedTarget.msg`.

    Accepted are an `id` from -1 to 2^31 - 1, a `code` from 0 to 2^32 - 1, finite coordinates and
    semi-axes, an `angle` within a turn, a `confidence` from 0 to 1, a covariance that is symmetric
    and positive semidefinite, a `family` that is a printable text, an `edge_shift` that is None or
    a number of px, a `polarity` of -1, 0 or 1, and `followed`, true or false; numpy scalars and
    arrays are converted. A ValueError names the target as `name` does, the field, its value and
    what is accepted.
    """
    if not isinstance(target, Target):
        raise ValueError(f'{name} is {shown(target)}, accepted is a Target')
    values: dict[str, Any] = {}
    changed = not _only_adds_fields(type(target))
    for item, check in _OF_FIELDS:
        value = getattr(target, item, None)
        values[item] = checked = check(value, f'{name}: {item}')
        changed |= checked is not value
    if isinstance(target, SquareMarker) and not changed:
        _check_corners(target.corners, f'{name}: corners')
    return Target(**values) if changed else target


def _only_adds_fields(kind: type[Target]) -> bool:
    """Return whether the fields of a target of this class are read as of any other."""
    own = kind.__mro__[: kind.__mro__.index(Target)]
    same = all(item.name not in vars(base) for base in own for item in fields(Target))
    return same and kind.__getattribute__ is Target.__getattribute__


def checked_integer(value: Any, name: str, minimum: int, maximum: int) -> int:
    """Return a value as an int, or raise a ValueError that calls it `name`."""
    integer = _integer(value)
    if integer is None or not minimum <= integer <= maximum:
        raise ValueError(
            f'{name} is {shown(value)}, accepted is an integer from {minimum} to {maximum}'
        )
    return integer


def checked_text(value: Any, name: str) -> str:
    """Return a value as a printable text, or raise a ValueError that calls it `name`."""
    if isinstance(value, str) and len(value) <= _MAXIMUM_TEXT and value.isprintable():
        return value if type(value) is str else str(value)
    raise ValueError(
        f'{name} is {shown(value)}, accepted is a printable text of at most {_MAXIMUM_TEXT} '
        'characters'
    )


def checked_number(value: Any, name: str, minimum: float, maximum: float) -> float:
    """Return a value as a finite float, or raise a ValueError that calls it `name`."""
    number = _number(value)
    if number is None or not minimum <= number <= maximum:
        raise ValueError(
            f'{name} is {shown(value)}, accepted is a number from {minimum:g} to {maximum:g}'
        )
    return number


def _flag(value: Any, name: str) -> bool:
    if isinstance(value, (bool, np.bool_)):
        return value if type(value) is bool else bool(value)
    raise ValueError(f'{name} is {shown(value)}, accepted is True or False')


def _integer(value: Any) -> int | None:
    if type(value) is int or isinstance(value, np.integer):
        return value if type(value) is int else int(value)
    number = _number(value)
    return int(number) if number is not None and number.is_integer() else None


def _number(value: Any) -> float | None:
    """Return a finite number as float, None for anything else."""
    if type(value) is float:
        return value if math.isfinite(value) else None
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real):
        return None
    try:
        number = float(value)
    except (OverflowError, ValueError, TypeError):
        return None
    return number if math.isfinite(number) else None


def _covariance(value: Any, name: str) -> tuple[float, ...]:
    elements: Any = value if type(value) is tuple else _listed(value)
    numbers = [_number(it) for it in elements] if len(elements) == 4 else []
    known = [it for it in numbers if it is not None and abs(it) <= MAXIMUM_LENGTH_PX**2]
    if len(known) == 4 and _is_covariance(*known):
        same = all(new is old for new, old in zip(known, elements, strict=True))
        return elements if same and elements is value else tuple(known)
    raise ValueError(
        f'{name} is {shown(value)}, accepted are four finite numbers, row-major, of a symmetric '
        'positive semidefinite matrix'
    )


def _check_corners(value: Any, name: str) -> None:
    with suppress(TypeError, ValueError):
        corners = np.array(value, np.float64)
        if corners.shape == (4, 2) and np.abs(corners).max() <= MAXIMUM_LENGTH_PX:
            return
    raise ValueError(f'{name} is {shown(value)}, accepted are four pairs of numbers, px')


def _listed(value: Any) -> list[Any]:
    """Return the first elements of a list or an array; empty for anything else."""
    if isinstance(value, np.ndarray):
        return value.ravel().tolist() if value.size == 4 else []
    return list(islice(value, 5)) if isinstance(value, (list, tuple)) else []


def _is_covariance(xx: float, xy: float, yx: float, yy: float) -> bool:
    scale = max(abs(xx), abs(xy), abs(yx), abs(yy))
    if min(xx, yy) < 0 or abs(xy - yx) > _ASYMMETRY * scale:
        return False
    return xx * yy - xy * yx >= -_ASYMMETRY * scale**2


_PLACE = partial(checked_number, minimum=-MAXIMUM_LENGTH_PX, maximum=MAXIMUM_LENGTH_PX)
_AXIS = partial(checked_number, minimum=0, maximum=MAXIMUM_LENGTH_PX)
_CHECKS: dict[str, Callable[[Any, str], Any]] = {
    'id': partial(checked_integer, minimum=UNDECODED, maximum=MAXIMUM_ID),
    'code': partial(checked_integer, minimum=0, maximum=2**32 - 1),
    'x': _PLACE,
    'y': _PLACE,
    'semi_major': _AXIS,
    'semi_minor': _AXIS,
    'angle': partial(checked_number, minimum=-2 * math.pi, maximum=2 * math.pi),
    'confidence': partial(checked_number, minimum=0, maximum=1),
    'covariance': _covariance,
    'family': checked_text,
    'edge_shift': lambda value, name: None if value is None else _PLACE(value, name),
    'polarity': partial(checked_integer, minimum=-1, maximum=1),
    'followed': _flag,
}
_OF_FIELDS = [(it.name, _CHECKS[it.name]) for it in fields(Target)]
