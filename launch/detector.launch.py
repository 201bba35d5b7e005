"""One detector on one image topic; several cameras are several of these in namespaces.

ros2 launch ahf_ros detector.launch.py namespace:=left image:=/left/image_raw
"""

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node

CONFIG = PathJoinSubstitution([get_package_share_directory('ahf_ros'), 'config'])


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument('namespace', default_value='', description='Of the node.'),
            DeclareLaunchArgument('image', default_value='image', description='Topic of images.'),
            DeclareLaunchArgument(
                'points', default_value='points', description='Topic of clouds, with cloud.'
            ),
            DeclareLaunchArgument(
                'parameters',
                default_value=PathJoinSubstitution([CONFIG, 'detector.yaml']),
                description='File with the parameters.',
            ),
            Node(
                package='ahf_ros',
                executable='detector',
                namespace=LaunchConfiguration('namespace'),
                parameters=[LaunchConfiguration('parameters')],
                remappings=[
                    ('image', LaunchConfiguration('image')),
                    ('image/compressed', [LaunchConfiguration('image'), '/compressed']),
                    ('points', LaunchConfiguration('points')),
                ],
                output='screen',
            ),
        ]
    )
