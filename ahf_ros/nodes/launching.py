"""What the launch files have in common: arguments with texts and choices, and the detector."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, Shutdown
from launch_ros.actions import Node

from ahf_ros.nodes.drivers import Driver
from ahf_ros.nodes.interfaces import NODES
from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.nodes.topics import LOSSLESS_SUBSCRIPTION, SUBSCRIPTION
from ahf_ros.settings.nested import flat_parameters
from ahf_ros.settings.parameter import Parameter

USUAL = NODES['detector'].usual
"""Parameters that are arguments of every launch file with a detector of the user's."""

CLOUD = ('cloud_tolerance', 'cloud_offset_x', 'cloud_offset_y', 'cloud_step')
"""Parameters of clouds that are arguments of `rig.launch.py`."""

_PARAMETERS = {item.name: item for item in flat_parameters(DetectorNodeSettings)}
_SIMULATED = Parameter('use_sim_time', False, 'Whether to take the time from /clock.')
_UNLESS_GIVEN = 'Default: the value in the parameter file.'


def config(name: str) -> str:
    """Return the path of a file of the folder `config`."""
    return str(Path(get_package_share_directory('ahf_ros')) / 'config' / name)


def arguments(names: Iterable[str]) -> list[DeclareLaunchArgument]:
    """Return launch arguments for parameters of the detector, for its namespace and its file.

    An argument that is not given is empty, and the parameter file decides.

    Parameters
    ----------
    names : iterable of str
        Names of parameters of the node `detector`.
    """
    declared = [
        DeclareLaunchArgument(
            'namespace', default_value='', description='Namespace of the node, such as left.'
        ),
        DeclareLaunchArgument(
            'parameters',
            default_value=config('detector.yaml'),
            description='Parameter file of the node; arguments take precedence over it.',
        ),
    ]
    return declared + [
        _argument(item) for item in (*(_PARAMETERS[name] for name in names), _SIMULATED)
    ]


def _argument(item: Parameter) -> DeclareLaunchArgument:
    accepted = '' if item.choices else f' Accepted is {item.accepted}.'
    return DeclareLaunchArgument(
        item.name,
        default_value='',
        choices=['', *item.choices] if item.choices else None,
        description=f'{item.description}{accepted} {_UNLESS_GIVEN}',
    )


def detector(given: Mapping[str, str], names: Iterable[str], driver: Driver | None = None) -> Node:
    """Return the detector, whose end ends the launch.

    Parameters
    ----------
    given : mapping of str to str
        Values of the launch arguments by their names, also of launch files that include
        this one.
    names : iterable of str
        Parameters that are arguments, as for `arguments`; others are left alone.
    driver : Driver, optional
        The driver whose topics the detector reads where no argument names another.

    Raises
    ------
    ValueError
        If a value is not accepted; the message names the argument, the value and what is accepted.
    """
    image, points = given.get('image', ''), given.get('points', '')
    values: dict[str, Any] = {}
    if driver:
        image, points = image or driver.image, points or driver.points
        values = {'cloud': True, **driver.settings}
    for item in (*(_PARAMETERS[name] for name in names), _SIMULATED):
        if text := given.get(item.name):
            values[item.name] = item.value_of(text)
    if driver and not driver.reliable:
        values |= _best_effort(given, image, points)
    return Node(
        package='ahf_ros',
        executable='detector',
        namespace=given['namespace'],
        parameters=[given['parameters'], values],
        remappings=[('image', image), ('points', points)],
        output='screen',
        on_exit=Shutdown(reason='the detector has ended'),
    )


def _best_effort(given: Mapping[str, str], *topics: str) -> dict[str, str]:
    """Return the parameters that subscribe to topics as best effort, whatever the queue."""
    space = given['namespace'].strip('/')
    absolute = [it if it.startswith('/') else f'/{space}/{it}' for it in topics]
    return {
        f'qos_overrides.{topic.replace("//", "/")}.{end}.reliability': 'best_effort'
        for topic in absolute
        for end in (SUBSCRIPTION, LOSSLESS_SUBSCRIPTION)
    }
