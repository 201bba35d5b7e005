"""ROS parameters from settings dataclasses."""

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from difflib import get_close_matches
from typing import Generic, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from ahf_ros.base.settings.nested import assemble, flat_parameters
from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.base.text import printable

Settings = TypeVar('Settings')


class ParameterSettings(Generic[Settings]):
    """The settings of a node, declared as its parameters and always consistent.

    Each field of the settings dataclass and of those nested in it is a parameter. `changed` is
    called when new settings are in force.
    """

    def __init__(
        self, node: Node, settings: type[Settings], changed: Callable[[], None] | None = None
    ) -> None:
        self._type = settings
        self._changed = changed
        self._values = {
            item.name: node.declare_parameter(item.name, item.default, descriptor(item)).value
            for item in flat_parameters(settings)
        }
        self._current: Settings | ValueError
        try:
            self._current = self._assembled({})
        except ValueError as error:
            self._current = error
        self._items = {item.name: item for item in flat_parameters(settings)}
        node.add_pre_set_parameters_callback(self._read)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    @property
    def current(self) -> Settings:
        """The settings in force; raises a ValueError while the initial values do not fit."""
        if isinstance(self._current, ValueError):
            raise self._current
        return self._current

    def on(self, name: str) -> bool:
        """Return whether a parameter is true, also while others are not accepted."""
        return self._values[name] is True

    def _assembled(self, changes: dict[str, object]) -> Settings:
        """Return the settings with changes; raises a ValueError if they are not accepted."""
        values = self._values | changes
        for item in flat_parameters(self._type):
            value = values[item.name]
            if isinstance(item.default, str) and not isinstance(value, str):
                # A number or a list: say how YAML and the shell take it for a text.
                text = printable(str(value))
                quoted = f"""; as a text it is {item.name}:="'{text}'" on the command line"""
                raise ValueError(
                    f'{item.name} is {text}, accepted is {item.accepted}'
                    f'{"" if item.choices else quoted}'
                )
        return assemble(self._type, values)

    def _read(self, parameters: list[RosParameter]) -> list[RosParameter]:
        """Return parameters as they are meant where the tools of ROS read a text as YAML.

        `ros2 param load` turns 1e-06 into a text, and the text 5 into a number.
        """
        return [
            RosParameter(it.name, value=as_meant(self._items[it.name], it.value))
            if it.name in self._items
            else it
            for it in parameters
        ]

    def _changes(self, parameters: Iterable[RosParameter]) -> dict[str, object]:
        """Return the new values of our parameters, without those that rclpy declares."""
        return {item.name: item.value for item in parameters if item.name in self._values}

    def _check(self, parameters: Iterable[RosParameter]) -> SetParametersResult:
        try:
            if changes := self._changes(parameters):
                self._assembled(changes)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: Iterable[RosParameter]) -> None:
        changes = self._changes(parameters)
        if changes.items() - self._values.items():
            self._current = self._assembled(changes)
            self._values |= changes
            if self._changed is not None:
                self._changed()


def as_meant(item: Parameter, value: object) -> object:
    """Return a value as a number or a text where the parameter is one and YAML made it the other.

    Examples
    --------
    >>> as_meant(Parameter('tolerance', 0.0, 'Tolerance, s.'), '1e-06')
    1e-06
    """
    if isinstance(item.default, float) and isinstance(value, str):
        with suppress(ValueError):
            return float(value)
    if isinstance(item.default, str) and type(value) is int:
        return str(value)
    return value


def unknown_parameters(given: Iterable[str], known: Collection[str]) -> Iterator[str]:
    """Yield a message for each given parameter that the node does not have.

    Examples
    --------
    >>> list(unknown_parameters(['expected_target', 'queue'], ['expected_targets', 'queue']))
    ['no parameter is named expected_target; the nearest is expected_targets']
    """
    unlike = []
    for name in sorted(set(given) - set(known)):
        if nearest := get_close_matches(name, known, n=1):
            yield f'no parameter is named {printable(name)}; the nearest is {nearest[0]}'
        else:
            unlike.append(name)
    if unlike:
        names = printable(', '.join(unlike), 2000)
        yield f'no parameter is named {names}; is that a parameter of another node?'


def descriptor(item: Parameter) -> ParameterDescriptor:
    """Return the descriptor of a parameter, which ROS tools show.

    Its type is dynamic so that an integer is accepted for a number, and so that refusals come from
    the settings, which say what is accepted.
    """
    described = ParameterDescriptor(
        name=item.name,
        description=item.description,
        additional_constraints=item.accepted,
        dynamic_typing=True,
        read_only=item.read_only,
    )
    if item.minimum is not None and item.maximum is not None:
        # Tools draw sliders from a range, which needs both ends.
        low, high = item.minimum, item.maximum
        if isinstance(item.default, int):
            described.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
        else:
            bounds = FloatingPointRange(from_value=float(low), to_value=float(high))
            described.floating_point_range = [bounds]
    return described
