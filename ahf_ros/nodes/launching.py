"""What the launch files have in common: arguments with texts and choices, and the nodes."""

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

from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.nodes.drivers import Driver, beside
from ahf_ros.nodes.interfaces import NODES
from ahf_ros.nodes.settings import RegistrationNodeSettings
from ahf_ros.nodes.topics import LOSSLESS_SUBSCRIPTION, POINTS, SUBSCRIPTION

USUAL = NODES['detector'].usual
"""Parameters that are arguments of every launch file with a detector of the user's."""

OF_POSE = ('coordinates', 'unit', 'tf', 'camera_matrix')
"""Parameters of the node `pose` that are arguments of `rig.launch.py`."""

OF_REGISTRATION = ('frame', 'coordinates', 'unit', 'folder', 'cloud_tolerance', 'scanners')
"""Likewise of `registration`."""

_SIM_TIME = Parameter('use_sim_time', False, 'Whether to take the time from /clock.')


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
    namespace = DeclareLaunchArgument(
        'namespace',
        default_value='',
        description='Namespace of the nodes, and of the topics of a driver, such as left.',
    )
    items = [_item('detector', name) for name in (*names, _SIM_TIME.name)]
    return [namespace, parameter_file('detector'), *map(_argument, items)]


def arguments_of_poses() -> list[DeclareLaunchArgument]:
    """Return launch arguments for the nodes `pose` and `registration`.

    Both have the same coordinates in the same frame.
    """
    nodes = 'pose', 'registration'
    made = [
        DeclareLaunchArgument(
            node,
            default_value='false',
            choices=['true', 'false'],
            description=f'Whether to start the node {node}, too. {NODES[node].purpose}',
        )
        for node in nodes
    ]
    frame = _item('registration', 'frame')
    made.append(
        DeclareLaunchArgument(
            'frame',
            default_value=frame.default,
            description='Frame of the coordinates, and of scans: `targets_frame` of pose, `frame` '
            'of registration.',
        )
    )
    items = (_item('pose', name) for name in OF_POSE)
    made += map(_argument, items)
    made += [_argument(_item('registration', name)) for name in ('folder', 'scanners')]
    return [*made, *(parameter_file(node, f'{node}_parameters') for node in nodes)]


def parameter_file(node: str, name: str = 'parameters') -> DeclareLaunchArgument:
    """Return the launch argument for the parameter file of a node."""
    return DeclareLaunchArgument(
        name,
        default_value=config(f'{node}.yaml'),
        description=f'Parameter file of the node {node}; arguments take precedence over it.',
    )


def default_argument(node: str, name: str) -> DeclareLaunchArgument:
    """Return the launch argument for a parameter where no parameter file decides."""
    item = _item(node, name)
    return DeclareLaunchArgument(
        name, default_value=str(item.default), description=item.description
    )


def _argument(item: Parameter) -> DeclareLaunchArgument:
    accepted = '' if item.choices else f' Accepted is {item.accepted}.'
    return DeclareLaunchArgument(
        item.name,
        default_value='',
        choices=list(dict.fromkeys(('', *item.choices))) if item.choices else None,
        description=f'{item.description}{accepted} Default: the value in the parameter file.',
    )


def _item(node: str, name: str) -> Parameter:
    if name == _SIM_TIME.name:
        return _SIM_TIME
    return next(it for it in flat_parameters(NODES[node].settings) if it.name == name)


def _values(node: str, names: Iterable[str], given: Mapping[str, str]) -> dict[str, Any]:
    """Return the parameters in `names` that have an argument, by name."""
    return {
        name: _item(node, name).value_of(text)
        for name in (*names, _SIM_TIME.name)
        if (text := given.get(name))
    }


def detector(given: Mapping[str, str], names: Iterable[str], driver: Driver | None = None) -> Node:
    """Return the detector, whose end ends the launch.

    Of the values `given` to launch arguments, which may be those of a launch file that includes
    this one, those of the parameters in `names` are taken. The detector reads the topics of the
    driver where no argument names another. Raises a ValueError that names the argument, the value
    and what is accepted, if a value is not.
    """
    image, points = _topics(given, driver)
    values: dict[str, Any] = {}
    if driver:
        values = {'cloud': True, 'acquisition': driver.acquisition, **driver.settings}
    values |= _values('detector', names, given)
    whatever_queue = SUBSCRIPTION, LOSSLESS_SUBSCRIPTION
    values |= _best_effort(given, driver, (image, points), whatever_queue)
    return _node(
        'detector', given, given['parameters'], values, {'image': image, 'points': points}
    )


def pose(given: Mapping[str, str], driver: Driver) -> Node:
    """Return the node `pose` for the detector of a rig, whose end ends the launch.

    Raises a ValueError as `detector` does, or if the driver has no calibration.
    """
    camera_info = given['camera_info']
    if not camera_info and not driver.calibrated:
        raise ValueError(
            f'camera_info is empty, accepted with {driver.package} is a topic that somebody '
            'publishes: the driver has none'
        )
    image, _ = _topics(given, driver)
    values = {'targets_frame': given['frame'], **driver.pose, **_values('pose', OF_POSE, given)}
    if timeout := given['image_timeout']:
        values['targets_timeout'] = _item('pose', 'targets_timeout').value_of(timeout)
    topics = {'camera_info': camera_info or beside(image)}
    return _node('pose', given, given['pose_parameters'], values, topics)


def registration(given: Mapping[str, str], driver: Driver) -> Node:
    """Return the node `registration` for the detector of a rig, whose end ends the launch.

    Raises a ValueError as `detector` does.
    """
    tolerance = driver.settings.get('cloud_tolerance')
    values: dict[str, Any] = {'cloud': True}
    values |= {'cloud_tolerance': tolerance} if tolerance else {}
    if given['scanners']:
        names = RegistrationNodeSettings(scanners=given['scanners']).scanner_names
        given = {**given, 'namespace': ''}  # all of them are read from outside
        topics = clouds = {f'{it}/{POINTS}': driver.within(it).points for it in names}
    else:
        clouds = {POINTS: _topics(given, driver)[1]}
        topics = {'target_points': 'detector/target_points', **clouds}
        if space := given['namespace'].strip('/'):
            values['scan_frame'] = f'{space.replace("/", "_")}_scan_'
    values |= _values('registration', OF_REGISTRATION, given)
    values |= _best_effort(given, driver, clouds.values(), (LOSSLESS_SUBSCRIPTION,))
    return _node('registration', given, given['registration_parameters'], values, topics)


def without_effect(given: Mapping[str, str]) -> list[LogInfo]:
    """Return what says of arguments that no node is started that has them."""
    users: dict[str, tuple[str, ...]] = dict.fromkeys(('folder', 'scanners'), ('registration',))
    users |= dict.fromkeys((*OF_POSE, 'camera_info'), ('pose',))
    users |= dict.fromkeys(('coordinates', 'unit'), ('pose', 'registration'))
    return [
        LogInfo(msg=f'{name} has no effect: {" and ".join(f"{it} is false" for it in nodes)}')
        for name, nodes in users.items()
        if given[name] and not any(given[it] == 'true' for it in nodes)
    ]


def _topics(given: Mapping[str, str], driver: Driver | None) -> tuple[str, str]:
    image, points = given.get('image', ''), given.get('points', '')
    if driver:
        driver = driver.within(given['namespace'])
        return image or driver.image, points or driver.points
    return image, points


def _best_effort(
    given: Mapping[str, str], driver: Driver | None, topics: Iterable[str], ends: Sequence[str]
) -> dict[str, str]:
    """Return parameters that make subscriptions best effort, if the topics of a driver are."""
    values = {}
    if driver and not driver.reliable:
        space = given['namespace'].strip('/')
        for topic in topics:
            name = topic if topic.startswith('/') else f'/{space}/{topic}'.replace('//', '/')
            for end in ends:
                values[f'qos_overrides.{name}.{end}.reliability'] = 'best_effort'
    return values


def _node(
    name: str,
    given: Mapping[str, str],
    parameters: str,
    values: Mapping[str, Any],
    topics: Mapping[str, str],
) -> Node:
    return Node(
        package='ahf_ros',
        executable=name,
        namespace=given['namespace'],
        parameters=[parameters, dict(values)],
        remappings=list(topics.items()),
        output='screen',
        on_exit=Shutdown(reason=f'the node {name} has ended'),
    )


def driver_node(
    driver: Driver,
    namespace: str = '',
    package: str = '',
    executable: str = '',
    parameters: str = '',
) -> Node:
    """Return the node of a driver in a namespace, whose end ends the launch.

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
    driver = driver.within(namespace)
    space, _, name = driver.node.rpartition('/')
    return Node(
        package=package,
        executable=executable,
        namespace=space or None,
        name=name or None,
        parameters=[it for it in (dict(driver.parameters), parameters) if it],
        remappings=list(driver.remappings.items()),
        output='screen',
        on_exit=Shutdown(reason='the driver has ended'),
    )
