"""What a launch file starts, without launch, which is on no package index.

A stand-in for launch lists the processes that a launch file describes, with their arguments. It
does not know whether launch accepts the file: a test asks launch itself where it is installed.
"""

import re
import runpy
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest import mock

from support import ROOT

MODULES = {
    'launch': ('LaunchDescription',),
    'launch.actions': (
        'DeclareLaunchArgument',
        'LogInfo',
        'OpaqueFunction',
        'SetEnvironmentVariable',
        'Shutdown',
    ),
    'launch.substitutions': ('LaunchConfiguration',),
    'launch_ros': (),
    'launch_ros.actions': ('Node',),
}
"""What the launch files take from launch, by module."""

USERS = 'ahf_ros.nodes.launching'
"""The module that imports launch, apart from the launch files."""

PROGRAMS = re.findall(r'_program (.*)\)', (ROOT / 'CMakeLists.txt').read_text())[0].split()
"""What is installed for `ros2 run` and for launch."""


class Entity:
    """Something of launch: what it was made with."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given = given
        self.named = named

    @property
    def name(self) -> str:
        """The name of an argument."""
        (name,) = self.given
        return name


@dataclass(frozen=True)
class Started:
    """A process that launch starts."""

    node: str
    arguments: list[str]
    package: str = 'ahf_ros'


@dataclass(frozen=True)
class Launched:
    """What a launch file does: its arguments, the processes it starts, and their environment."""

    declared: dict[str, Entity]
    nodes: list[Started]
    environment: dict[str, str]
    said: list[str] = field(default_factory=list)


def launched(name: str, **given: str) -> Launched:
    """Return what a launch file of this package does with the given arguments.

    Raises
    ------
    ValueError
        If a value is none of the choices of its argument.
    KeyError
        If an argument that has no default is missing.
    """
    with stand_in():
        file = str(ROOT / 'launch' / f'{name}.launch.py')
        (entities,) = runpy.run_path(file)['generate_launch_description']().given
        return _done(entities, dict(given))


@contextmanager
def stand_in() -> Iterator[None]:
    """Put the stand-in in the place of launch, and the sources in that of the share folder."""
    from ament_index_python import packages

    modules = {name: ModuleType(name) for name in MODULES}
    for name, kinds in MODULES.items():
        vars(modules[name]).update({kind: type(kind, (Entity,), {}) for kind in kinds})
    with (
        mock.patch.object(packages, 'get_package_share_directory', lambda _: str(ROOT)),
        mock.patch.dict(sys.modules, modules),
    ):
        sys.modules.pop(USERS, None)
        yield


def _done(entities: list[Entity], given: dict[str, str]) -> Launched:
    result = Launched({}, [], {})
    for entity in entities:
        kind = type(entity).__name__
        if kind == 'DeclareLaunchArgument':
            result.declared[entity.name] = entity
            _set(entity.name, entity.named, given)
        elif kind == 'SetEnvironmentVariable':
            variable, value = entity.given
            result.environment[variable] = _text(value, given)
        elif kind == 'OpaqueFunction':
            context = SimpleNamespace(launch_configurations=given)
            for it in entity.named['function'](context):
                if type(it).__name__ == 'LogInfo':
                    result.said.append(it.named['msg'])
                else:
                    result.nodes.append(_process(it, given))
        else:
            result.nodes.append(_process(entity, given))
    return result


def _set(name: str, declared: dict[str, Any], given: dict[str, str]) -> None:
    if name not in given:
        given[name] = declared['default_value']
    choices = declared.get('choices')
    if choices and given[name] not in choices:
        raise ValueError(f'{name} is {given[name]!r}, accepted is one of {choices}')


def _process(entity: Entity, given: dict[str, str]) -> Started:
    """Return what launch_ros makes of a node: arguments for its command line."""
    node = entity.named
    assert type(entity).__name__ == 'Node'
    assert node['output'] == 'screen'
    assert type(node['on_exit']).__name__ == 'Shutdown'
    assert node['package'] != 'ahf_ros' or node['executable'] in PROGRAMS
    arguments = []
    if space := node.get('namespace', ''):
        arguments += ['-r', f'__ns:=/{space.lstrip("/")}']
    if name := node.get('name', ''):
        arguments += ['-r', f'__node:={name}']
    for item in node.get('parameters', []):
        if isinstance(item, dict):
            for name, value in item.items():
                arguments += ['-p', f'{name}:={_yaml(value, given)}']
        else:
            assert Path(item).is_file()
            arguments += ['--params-file', item]
    for source, target in node.get('remappings', []):
        arguments += ['-r', f'{source}:={target}']
    return Started(node['executable'], arguments, node['package'])


def _yaml(value: Any, given: dict[str, str]) -> str:
    """Return a value as launch_ros writes it: a text of Python is one of YAML, too."""
    if isinstance(value, str):
        return f"'{value}'"
    return _text(value, given)


def _text(value: Any, given: dict[str, str]) -> str:
    """Return what a substitution stands for."""
    if type(value).__name__ == 'LaunchConfiguration':
        return given[value.given[0]]
    return str(value).lower() if isinstance(value, bool) else str(value)
