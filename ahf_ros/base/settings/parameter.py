"""Parameters with description, default and accepted values, each declared once.

Settings are frozen dataclasses whose fields are made by `parameter`. ROS parameters, command line
options and tables of the documentation are derived from them.
"""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from functools import cache
from numbers import Integral, Real
from typing import Any

from ahf_ros.base.text import shown

MAXIMUM_NUMBERS = 100_000
"""Maximum count of numbers in a list."""

_KEY = 'ahf_ros.base.settings.parameter'


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a settings dataclass; it has the type of its default.

    The description is one sentence, with the unit if there is one. Bounds are closed. No `choices`
    means that any text is accepted. A node takes a `read_only` one at its start only. `form`
    describes accepted texts that the settings check, where `choices` and type do not say it.
    `files` says that a text names files to read, separated by commas.
    """

    name: str
    default: Any
    description: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = False
    form: str = ''
    files: bool = False

    @property
    def accepted(self) -> str:
        """Description of the accepted values."""
        if self.form:
            return self.form
        if self.choices:
            return f'one of {", ".join(self.choices)}'
        kind = {bool: 'true or false', int: 'an integer', float: 'a number', str: 'a text'}
        form = 'd' if isinstance(self.default, int) else 'g'
        bounds = ''
        if self.minimum is not None and self.maximum is not None:
            bounds = f' from {self.minimum:{form}} to {self.maximum:{form}}'
        elif self.minimum is not None:
            bounds = f' of at least {self.minimum:{form}}'
        elif self.maximum is not None:
            bounds = f' of at most {self.maximum:{form}}'
        return kind[type(self.default)] + bounds

    def accepts(self, value: object) -> bool:
        """Return whether `value` has the right type and lies in range."""
        if isinstance(self.default, bool):
            return isinstance(value, bool)
        if isinstance(self.default, str):
            return isinstance(value, str) and (not self.choices or value in self.choices)
        if isinstance(value, bool) or not isinstance(value, Real):
            return False
        if isinstance(self.default, int) and not isinstance(value, Integral):
            return False
        try:
            number = float(value)
        except OverflowError:  # an integer of hundreds of digits
            return False
        above = self.minimum is None or number >= self.minimum
        return math.isfinite(number) and above and (self.maximum is None or number <= self.maximum)

    def check(self, value: object) -> None:
        """Raise a ValueError with the parameter, `value` and what is accepted, unless it is."""
        if not self.accepts(value):
            raise ValueError(f'{self.name} is {shown(value)}, accepted is {self.accepted}')

    def value_of(self, text: str) -> Any:
        """Return the value that a text stands for; a ValueError as of `check` if there is none.

        Examples
        --------
        >>> Parameter('stack', 1, 'Number of images.', minimum=1).value_of('4')
        4
        """
        try:
            if isinstance(self.default, bool):
                value = {'true': True, 'false': False}.get(text.lower(), text)
            else:
                value = type(self.default)(text)
            self.check(value)
        except ValueError as error:
            message = f'{self.name} is {shown(text)}, accepted is {self.accepted}'
            raise ValueError(message) from error
        return value


def parameter(
    default: Any,
    description: str,
    *,
    minimum: float | None = None,
    maximum: float | None = None,
    choices: Iterable[str] = (),
    read_only: bool = False,
    form: str = '',
    files: bool = False,
) -> Any:
    """Return a dataclass field that carries a `Parameter`."""
    item = Parameter(
        name='',
        default=default,
        description=description,
        minimum=minimum,
        maximum=maximum,
        choices=tuple(choices),
        read_only=read_only,
        form=form,
        files=files,
    )
    return field(default=default, metadata={_KEY: item})


def parameters(settings: Any) -> tuple[Parameter, ...]:
    """Return the parameters of a settings dataclass or of an instance, in order."""
    return _of_type(settings if isinstance(settings, type) else type(settings))


@cache
def _of_type(settings: Any) -> tuple[Parameter, ...]:
    return tuple(
        replace(item.metadata[_KEY], name=item.name)
        for item in fields(settings)
        if _KEY in item.metadata
    )


def check_parameters(settings: Any) -> None:
    """Check all parameters of a settings instance; call it in `__post_init__`."""
    for item in parameters(settings):
        item.check(getattr(settings, item.name))


def numbers_in(name: str, text: str) -> frozenset[int]:
    """Return the numbers in a list of integers and ranges, such as '1-54, 60'.

    A ValueError names a text that is no such list or has more than `MAXIMUM_NUMBERS` numbers.
    """
    numbers: set[int] = set()
    for part in filter(None, re.split(r'[,\s]+', text)):
        found = re.fullmatch(r'(\d{1,9})(?:-(\d{1,9}))?', part)
        first, last = (int(found[1]), int(found[2] or found[1])) if found else (1, 0)
        if first > last:
            raise ValueError(
                f'{name} has {shown(part)}, accepted are integers and ranges such as 1-54, 60'
            )
        if len(numbers) + last - first >= MAXIMUM_NUMBERS:
            raise ValueError(
                f'{name} is {shown(text)}, accepted are at most {MAXIMUM_NUMBERS} numbers'
            )
        numbers.update(range(first, last + 1))
    return frozenset(numbers)
