"""One detector on one image topic; several cameras are several of these in namespaces.

ros2 launch ahf_ros detector.launch.py namespace:=left image:=/left/image_raw
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction

from ahf_ros.nodes.launching import USUAL, arguments, declared, detector

PARAMETERS = (*USUAL, 'cloud')


def generate_launch_description():
    return LaunchDescription(
        [
            *declared(
                DeclareLaunchArgument(
                    'image',
                    default_value='image',
                    description='Topic of the images; with image_transport compressed, '
                    '/compressed is appended.',
                ),
                DeclareLaunchArgument(
                    'points',
                    default_value='points',
                    description='Topic of the clouds, with cloud.',
                ),
                *arguments(PARAMETERS),
            ),
            OpaqueFunction(function=nodes),
        ]
    )


def nodes(context):
    return [detector(context.launch_configurations, PARAMETERS)]
