"""A detector beside the driver of a scanner: IDs of targets and their positions in space.

ros2 launch ahf_ros rig.launch.py driver:=zivid
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction

from ahf_ros.nodes.drivers import DRIVERS
from ahf_ros.nodes.launching import USUAL, arguments, detector

PARAMETERS = (*USUAL, 'cloud_tolerance', 'cloud_offset_x', 'cloud_offset_y', 'cloud_step')


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'driver',
                choices=list(DRIVERS),
                description='Driver of the scanner, for its topics, stamps and quality of '
                'service; the driver itself is not started.',
            ),
            *(
                DeclareLaunchArgument(
                    topic,
                    default_value='',
                    description=f'Topic of the {what}, where it is not that of the driver.',
                )
                for topic, what in {'image': 'images', 'points': 'point clouds'}.items()
            ),
            *arguments(PARAMETERS),
            OpaqueFunction(function=nodes),
        ]
    )


def nodes(context):
    given = context.launch_configurations
    return [detector(given, PARAMETERS, DRIVERS[given['driver']])]
