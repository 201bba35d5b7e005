"""Targets from what programs print as JSON: `ahf identify`, and any detector of others."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from ahf_ros.target import Target

_NUMBERS = ('semi_major', 'semi_minor', 'angle')


def targets_of(record: Any, where: str) -> list[Target]:
    """Return the targets of a record.

    Parameters
    ----------
    record : dict
        With the list 'targets', each of which has 'id', 'x' and 'y', and what else `Target` has
        where it is known.
    where : str
        What the record is, for messages.

    Raises
    ------
    ValueError
        If the record is not like that, or a number is not finite; the message names the field.
    """
    if not isinstance(record, dict) or not isinstance(record.get('targets'), list):
        raise ValueError(f'{where} is not an object with a list of targets')
    return list(_targets(record['targets'], where))


def _targets(records: list[Any], where: str) -> Iterator[Target]:
    for record in records:
        if not isinstance(record, dict):
            raise ValueError(f'{where}: target is {record!r}, accepted is an object')
        known = {
            name: checked_number(record.get(name, 0), f'{where}: {name}') for name in _NUMBERS
        }
        yield Target(
            id=checked_integer(record.get('id'), f'{where}: id'),
            code=checked_integer(record.get('code', 0), f'{where}: code'),
            x=checked_number(record.get('x'), f'{where}: x'),
            y=checked_number(record.get('y'), f'{where}: y'),
            confidence=checked_number(record.get('confidence', 1), f'{where}: confidence'),
            covariance=_covariance(record.get('covariance', [0] * 4), f'{where}: covariance'),
            **known,
        )


def _covariance(value: Any, name: str) -> tuple[float, float, float, float]:
    if not isinstance(value, list) or len(value) != 4:
        raise ValueError(f'{name} is {value!r}, accepted is a list of four numbers')
    first, second, third, fourth = (checked_number(element, name) for element in value)
    return first, second, third, fourth


def checked_integer(value: Any, name: str) -> int:
    """Return a value as an integer, or raise a ValueError that calls it `name`."""
    try:
        number = int(value)
    except (OverflowError, TypeError, ValueError) as error:
        raise ValueError(f'{name} is {value!r}, accepted is an integer') from error
    if isinstance(value, float) and number != value:
        raise ValueError(f'{name} is {value!r}, accepted is an integer')
    return number


def checked_number(value: Any, name: str) -> float:
    """Return a value as a finite number, or raise a ValueError that calls it `name`."""
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise ValueError(f'{name} is {value!r}, accepted is a number') from error
    if not math.isfinite(number):
        raise ValueError(f'{name} is {value!r}, accepted is a finite number')
    return number
