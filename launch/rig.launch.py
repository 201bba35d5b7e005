"""A scanner that knows where it is: driver, detector, pose and registration.

ros2 launch ahf_ros rig.launch.py driver:=zivid start_driver:=true registration:=true \\
    pose:=true coordinates:=targets.csv unit:=mm

Two scanners are two of these in namespaces, one of them with registration:=true and
scanners:=left,right.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction

from ahf_ros.nodes.drivers import DRIVERS
from ahf_ros.nodes.launching import (
    USUAL,
    arguments,
    arguments_of_poses,
    declared,
    detector,
    driver_node,
    pose,
    registration,
    without_effect,
)

PARAMETERS = (*USUAL, 'cloud_tolerance', 'cloud_offset_x', 'cloud_offset_y', 'cloud_step')
TOPICS = {'image': 'images', 'points': 'point clouds', 'camera_info': 'calibration'}
OF_DRIVER = {
    'package': 'Package of the driver that is started, where it is not the usual one.',
    'executable': 'Executable in this package, where it is not the usual one.',
    'parameters': 'Parameter file of the driver that is started.',
}


def generate_launch_description():
    return LaunchDescription(
        [
            *declared(
                DeclareLaunchArgument(
                    'driver',
                    choices=list(DRIVERS),
                    description='Driver of the scanner, for its topics, stamps and quality of '
                    'service.',
                ),
                DeclareLaunchArgument(
                    'start_driver',
                    default_value='false',
                    choices=['true', 'false'],
                    description='Whether to start the driver, too, as it has to be set here.',
                ),
                *(
                    DeclareLaunchArgument(f'driver_{name}', default_value='', description=text)
                    for name, text in OF_DRIVER.items()
                ),
                *(
                    DeclareLaunchArgument(
                        topic,
                        default_value='',
                        description=f'Topic of the {what}, where it is not that of the driver.',
                    )
                    for topic, what in TOPICS.items()
                ),
                *arguments(PARAMETERS),
                *arguments_of_poses(),
            ),
            OpaqueFunction(function=nodes),
        ]
    )


def nodes(context):
    given = context.launch_configurations
    driver = DRIVERS[given['driver']]
    started = [detector(given, PARAMETERS, driver)]
    more = {'pose': pose, 'registration': registration}
    started += [made(given, driver) for node, made in more.items() if given[node] == 'true']
    if given['start_driver'] == 'true':
        chosen = {name: given[f'driver_{name}'] for name in OF_DRIVER}
        started.append(driver_node(driver, given['namespace'], **chosen))
    return [*without_effect(given), *started]
