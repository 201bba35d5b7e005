"""What the launch files have in common: arguments with texts and choices, detector and driver."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any

from ament_index_python.packages import (
    PackageNotFoundError,
    get_package_prefix,
    get_package_share_directory,
)
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch_ros.actions import Node

from ahf_ros.nodes.drivers import Driver
from ahf_ros.nodes.interfaces import NODES
from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.nodes.topics import LOSSLESS_SUBSCRIPTION, SUBSCRIPTION
from ahf_ros.settings.nested import flat_parameters
from ahf_ros.settings.parameter import Parameter

USUAL = NODES['detector'].usual
"""Parameters that are arguments of every launch file with a detector of the user's."""

_PARAMETERS = {
    **{item.name: item for item in flat_parameters(DetectorNodeSettings)},
    'use_sim_time': Parameter('use_sim_time', False, 'Whether to take the time from /clock.'),
}


def config(name: str) -> str:
    """Return the path of a file of the folder `config`."""
    return str(Path(get_package_share_directory('ahf_ros')) / 'config' / name)


def declared(*given: DeclareLaunchArgument) -> list[DeclareLaunchArgument | OpaqueFunction]:
    """Return the arguments of a launch file, and what says of others that they may be misspelt.

    launch itself takes any argument without a word.
    """
    return [*given, OpaqueFunction(function=partial(_misspelt, [it.name for it in given]))]


def _misspelt(names: Sequence[str], context: Any) -> list[LogInfo]:
    # A launch file that includes this one may have others, as launch_ros has for itself.
    others = [
        it for it in context.launch_configurations if it not in names and not it.startswith('ros_')
    ]
    messages = []
    for other in others:
        longer = [name for name in names if name.startswith(other)]
        if nearest := longer or get_close_matches(other, names, n=1, cutoff=0.75):
            messages.append(f'no argument is named {other}; the nearest is {nearest[0]}')
    return [LogInfo(msg=text) for text in messages]


def arguments(names: Iterable[str]) -> list[DeclareLaunchArgument]:
    """Return launch arguments for parameters of the detector, for its namespace and its file.

    An argument that is not given is empty, and the parameter file decides.
    """
    made = [
        DeclareLaunchArgument(
            'namespace', default_value='', description='Namespace of the node, such as left.'
        ),
        DeclareLaunchArgument(
            'parameters',
            default_value=config('detector.yaml'),
            description='Parameter file of the node; arguments take precedence over it.',
        ),
    ]
    for item in _items(names):
        accepted = '' if item.choices else f' Accepted is {item.accepted}.'
        argument = DeclareLaunchArgument(
            item.name,
            default_value='',
            choices=['', *item.choices] if item.choices else None,
            description=(
                f'{item.description}{accepted} Default: the value in the parameter file.'
            ),
        )
        made.append(argument)
    return made


def _items(names: Iterable[str]) -> list[Parameter]:
    return [_PARAMETERS[name] for name in (*names, 'use_sim_time')]


def detector(given: Mapping[str, str], names: Iterable[str], driver: Driver | None = None) -> Node:
    """Return the detector, whose end ends the launch.

    Of the values `given` to launch arguments, which may be those of a launch file that includes
    this one, those of the parameters in `names` are taken. The detector reads the topics of the
    driver where no argument names another. Raises a ValueError that names the argument, the value
    and what is accepted, if a value is not.
    """
    image, points = given.get('image', ''), given.get('points', '')
    values: dict[str, Any] = {}
    if driver:
        image, points = image or driver.image, points or driver.points
        values = {'cloud': True, **driver.settings}
    for item in _items(names):
        if text := given.get(item.name):
            values[item.name] = item.value_of(text)
    if driver and not driver.reliable:
        # Best effort, whatever the queue.
        space = given['namespace'].strip('/')
        for topic in (image, points):
            name = topic if topic.startswith('/') else f'/{space}/{topic}'.replace('//', '/')
            for end in (SUBSCRIPTION, LOSSLESS_SUBSCRIPTION):
                values[f'qos_overrides.{name}.{end}.reliability'] = 'best_effort'
    return Node(
        package='ahf_ros',
        executable='detector',
        namespace=given['namespace'],
        parameters=[given['parameters'], values],
        remappings=[('image', image), ('points', points)],
        output='screen',
        on_exit=Shutdown(reason='the detector has ended'),
    )


def driver_node(
    driver: Driver, package: str = '', executable: str = '', parameters: str = ''
) -> Node:
    """Return the node of a driver, whose end ends the launch.

    Package and executable are those of the driver where they are empty; `parameters` is a file
    that takes precedence over what the driver needs here. Raises a ValueError if the driver is not
    installed, or is started by a launch file of its own.
    """
    package, executable = package or driver.package, executable or driver.executable
    without = 'start_driver:=false starts the rest without it'
    if not executable:
        raise ValueError(
            f'driver_executable is empty, accepted with {package} is a name: {driver.setup}; '
            f'{without}'
        )
    try:
        get_package_prefix(package)
    except (PackageNotFoundError, OSError) as error:  # OSError: nothing is sourced
        raise ValueError(
            f'driver_package is {package}, which is not installed or not sourced, accepted is an '
            f'installed package; {without}'
        ) from error
    space, _, name = driver.node.rpartition('/')
    return Node(
        package=package,
        executable=executable,
        namespace=space or None,
        name=name or None,
        parameters=[it for it in (dict(driver.parameters), parameters) if it],
        output='screen',
        on_exit=Shutdown(reason='the driver has ended'),
    )
