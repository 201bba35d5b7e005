"""Nested settings: flattened by name, and assembled again."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar, get_type_hints

from ahf_ros.base.settings.parameter import Parameter, parameters

Settings = TypeVar('Settings')


def flat_parameters(settings: type) -> tuple[Parameter, ...]:
    """Return the parameters of a settings dataclass and of the settings nested in it.

    A ValueError says so if one name stands for two different parameters.
    """
    found: dict[str, Parameter] = {}
    parts = (parameters(settings), *map(flat_parameters, _parts(settings).values()))
    for item in (item for part in parts for item in part):
        if found.setdefault(item.name, item) != item:
            raise ValueError(f'{item.name} is the name of two different parameters')
    return tuple(found.values())


def assemble(settings: type[Settings], values: Mapping[str, Any]) -> Settings:
    """Return settings with values by the name of their parameter, and defaults for the others.

    An integer is accepted for a number. A ValueError names an unknown name, and a value that is
    not accepted or does not fit the others.
    """
    names = [item.name for item in flat_parameters(settings)]
    for name in values:
        if name not in names:
            raise ValueError(f'{name} is not a parameter, accepted is one of {", ".join(names)}')
    return _assembled(settings, values)


def flat_values(settings: Any) -> dict[str, Any]:
    """Return the values of all parameters of a settings instance, by name."""
    values = {item.name: getattr(settings, item.name) for item in parameters(settings)}
    for name in _parts(type(settings)):
        values |= flat_values(getattr(settings, name))
    return values


def updated(settings: Settings, values: Mapping[str, Any]) -> Settings:
    """Return settings with other values for some of their parameters, as `assemble` does."""
    return assemble(type(settings), {**flat_values(settings), **values}) if values else settings


def _assembled(settings: type[Settings], values: Mapping[str, Any]) -> Settings:
    given: dict[str, Any] = {
        name: _assembled(part, values) for name, part in _parts(settings).items()
    }
    for item in parameters(settings):
        if item.name in values:
            value = values[item.name]
            is_number = isinstance(item.default, float) and item.accepts(value)
            given[item.name] = float(value) if is_number else value
    return settings(**given)


def _parts(settings: type) -> dict[str, type]:
    """Return the types of the nested settings, by the name of their field."""
    hints = get_type_hints(settings)
    given = [item.name for item in fields(settings) if item.init]
    return {name: hints[name] for name in given if is_dataclass(hints[name])}
