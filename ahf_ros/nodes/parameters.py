"""ROS parameters from settings dataclasses."""

from __future__ import annotations

from collections.abc import Callable, Iterable
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

Settings = TypeVar('Settings')


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
    ValueError
        If an initial value is not accepted or does not fit the others.
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
        self._current = assemble(settings, self._values)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    @property
    def current(self) -> Settings:
        """The settings in force."""
        return self._current

    def _changes(self, parameters: Iterable[RosParameter]) -> dict[str, object]:
        """Return the new values of our parameters, without those that rclpy declares."""
        return {item.name: item.value for item in parameters if item.name in self._values}

    def _check(self, parameters: Iterable[RosParameter]) -> SetParametersResult:
        try:
            assemble(self._type, self._values | self._changes(parameters))
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
