"""ROS parameters from settings dataclasses."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
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

from ahf_ros.settings.nested import assemble, flat_parameters
from ahf_ros.settings.parameter import Parameter
from ahf_ros.text import printable

Settings = TypeVar('Settings')

MAXIMUM_LENGTH = 2000
"""Maximum length of a list of unknown parameters."""


class ParameterSettings(Generic[Settings]):
    """The settings of a node, declared as its parameters and always consistent.

    Parameters
    ----------
    node : rclpy.node.Node
        Node that gets one parameter for each field of the settings.
    settings : type
        Settings dataclass; nested settings are flattened.
    changed : callable, optional
        Called when new settings are in force.

    Raises
    ------
    ParameterException
        If an initial value is of a type or in a form that ROS does not accept.
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
        self._current: Settings | ValueError = self._initial()
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

    def _initial(self) -> Settings | ValueError:
        try:
            for item in flat_parameters(self._type):
                _check_quotes(item, self._values[item.name])
            return assemble(self._type, self._values)
        except ValueError as error:
            return error

    def _changes(self, parameters: Iterable[RosParameter]) -> dict[str, object]:
        """Return the new values of our parameters, without those that rclpy declares."""
        return {item.name: item.value for item in parameters if item.name in self._values}

    def _check(self, parameters: Iterable[RosParameter]) -> SetParametersResult:
        changes = self._changes(parameters)
        if not changes:
            return SetParametersResult(successful=True)
        try:
            for item in flat_parameters(self._type):
                _check_quotes(item, changes.get(item.name, item.default))
            assemble(self._type, self._values | changes)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: Iterable[RosParameter]) -> None:
        changes = self._changes(parameters)
        if not changes:
            return
        self._values |= changes
        self._current = assemble(self._type, self._values)
        if self._changed is not None:
            self._changed()


def unknown_parameters(given: Iterable[str], known: Collection[str]) -> Iterator[str]:
    """Yield a message for each given parameter that the node does not have.

    Parameters
    ----------
    given : iterable of str
        Names from the command line and from parameter files.
    known : collection of str
        Parameters of the node.

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
        names = printable(', '.join(unlike), MAXIMUM_LENGTH)
        yield f'no parameter is named {names}; is that a parameter of another node?'


def _check_quotes(item: Parameter, value: object) -> None:
    """Refuse a number or a list for a text, and say how YAML and the shell take it for a text."""
    if isinstance(item.default, str) and not isinstance(value, str):
        text = printable(str(value))
        quoted = f"""; as a text it is {item.name}:="'{text}'" on the command line"""
        raise ValueError(
            f'{item.name} is {text}, accepted is {item.accepted}{"" if item.choices else quoted}'
        )


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
        if isinstance(item.default, int):
            bounds = IntegerRange(from_value=int(item.minimum), to_value=int(item.maximum))
            described.integer_range = [bounds]
        else:
            bounds = FloatingPointRange(
                from_value=float(item.minimum), to_value=float(item.maximum)
            )
            described.floating_point_range = [bounds]
    return described
