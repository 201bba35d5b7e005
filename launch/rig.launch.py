"""Driver of a scanner and detector: IDs of targets and their positions in space.

ros2 launch ahf_ros rig.launch.py driver:=zivid start_driver:=true
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction

from ahf_ros.nodes.drivers import DRIVERS
from ahf_ros.nodes.launching import USUAL, arguments, declared, detector, driver_node

PARAMETERS = (*USUAL, 'cloud_tolerance', 'cloud_offset_x', 'cloud_offset_y', 'cloud_step')
TOPICS = {'image': 'images', 'points': 'point clouds'}
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
            ),
            OpaqueFunction(function=nodes),
        ]
    )


def nodes(context):
    given = context.launch_configurations
    driver = DRIVERS[given['driver']]
    started = [detector(given, PARAMETERS, driver)]
    if given['start_driver'] == 'true':
        chosen = {name: given[f'driver_{name}'] for name in OF_DRIVER}
        started.append(driver_node(driver, **chosen))
    return started
