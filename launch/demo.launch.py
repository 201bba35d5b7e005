"""Synthetic images under projected light, their identification, and how good it is.

ros2 launch ahf_ros demo.launch.py light:=lattice
"""

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node

CONFIG = PathJoinSubstitution([get_package_share_directory('ahf_ros'), 'config'])
PROFILES = PathJoinSubstitution([CONFIG, 'fastdds_shm.xml'])


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument('light', default_value='stripe', description='Projected light.'),
            # Room for whole images in the memory that processes share; Jazzy, and Kilted.
            SetEnvironmentVariable('FASTRTPS_DEFAULT_PROFILES_FILE', PROFILES),
            SetEnvironmentVariable('FASTDDS_DEFAULT_PROFILES_FILE', PROFILES),
            Node(
                package='ahf_ros',
                executable='illumination',
                parameters=[
                    PathJoinSubstitution([CONFIG, 'illumination.yaml']),
                    {'light': LaunchConfiguration('light'), 'rate': 0.2},
                ],
                output='screen',
            ),
            Node(
                package='ahf_ros',
                executable='detector',
                parameters=[
                    PathJoinSubstitution([CONFIG, 'detector.yaml']),
                    {'expected_targets': 54, 'max_duration': 20.0},
                ],
                output='screen',
            ),
            Node(package='ahf_ros', executable='scoreboard', output='screen'),
        ]
    )
