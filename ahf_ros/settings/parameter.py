"""Settings that describe themselves: text, default and accepted values, stated once.

A room that can be set has a frozen dataclass whose fields are made by `parameter`. The node
declares its ROS parameters, the command line its options and the README its table from
`parameters`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from numbers import Integral, Real
from typing import Any

MOST_NUMBERS = 100_000
"""Numbers that a text may list."""

_KEY = 'ahf_ros.settings.parameter'


@dataclass(frozen=True, slots=True)
class Parameter:
    """One setting of a settings dataclass.

    Attributes
    ----------
    name : str
        Name of the field, and of the ROS parameter.
    default : bool, int, float or str
        Its type is the type of the parameter.
    description : str
        One sentence, with the unit where there is one.
    minimum, maximum : float or None
        Closed bounds of a number.
    choices : tuple of str
        The accepted texts; empty where any is accepted.
    """

    name: str
    default: Any
    description: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()

    @property
    def accepted(self) -> str:
        """The accepted values in words."""
        if self.choices:
            return f'one of {", ".join(self.choices)}'
        kind = {bool: 'true or false', int: 'an integer', float: 'a number', str: 'a text'}
        words = kind[type(self.default)]
        form = 'd' if isinstance(self.default, int) else 'g'
        if self.minimum is not None and self.maximum is not None:
            return f'{words} from {self.minimum:{form}} to {self.maximum:{form}}'
        if self.minimum is not None:
            return f'{words} of at least {self.minimum:{form}}'
        if self.maximum is not None:
            return f'{words} of at most {self.maximum:{form}}'
        return words

    def accepts(self, value: object) -> bool:
        """Return whether `value` has the right type and lies in range."""
        if isinstance(self.default, bool):
            return isinstance(value, bool)
        if isinstance(self.default, str):
            return isinstance(value, str) and (not self.choices or value in self.choices)
        if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
            return False
        if isinstance(self.default, int) and not isinstance(value, Integral):
            return False
        above = self.minimum is None or float(value) >= self.minimum
        return above and (self.maximum is None or float(value) <= self.maximum)

    def check(self, value: object) -> None:
        """Raise a ValueError that names the parameter, `value` and what is accepted."""
        if not self.accepts(value):
            raise ValueError(f'{self.name} is {value!r}, accepted is {self.accepted}')


def parameter(
    default: Any,
    description: str,
    *,
    minimum: float | None = None,
    maximum: float | None = None,
    choices: Iterable[str] = (),
) -> Any:
    """Return a dataclass field that carries a `Parameter`."""
    told = Parameter('', default, description, minimum, maximum, tuple(choices))
    return field(default=default, metadata={_KEY: told})


def parameters(settings: Any) -> tuple[Parameter, ...]:
    """Return the parameters of a settings dataclass (or of an instance), in their order."""
    return tuple(
        replace(item.metadata[_KEY], name=item.name)
        for item in fields(settings)
        if _KEY in item.metadata
    )


def check_parameters(settings: Any) -> None:
    """Check every parameter of a settings instance; call it in `__post_init__`.

    Raises
    ------
    ValueError
        For the first value that is not accepted, naming the parameter, the value and what is.
    """
    for item in parameters(settings):
        item.check(getattr(settings, item.name))


def numbers_in(name: str, text: str) -> frozenset[int]:
    """Return the numbers that a text lists, such as '1-54, 60'; none where it is empty.

    Raises
    ------
    ValueError
        If it is no list of integers and ranges, or holds more than `MOST_NUMBERS`.
    """
    numbers: set[int] = set()
    for part in filter(None, re.split(r'[,\s]+', text)):
        found = re.fullmatch(r'(\d{1,9})(?:-(\d{1,9}))?', part)
        first, last = (int(found[1]), int(found[2] or found[1])) if found else (1, 0)
        if first > last:
            raise ValueError(
                f'{name} has {part!r}, accepted are integers and ranges such as 1-54, 60'
            )
        if len(numbers) + last - first >= MOST_NUMBERS:
            raise ValueError(f'{name} is {text!r}, accepted are at most {MOST_NUMBERS} numbers')
        numbers.update(range(first, last + 1))
    return frozenset(numbers)
