"""Synthetic images under projected light, their identification, and how good it is.

ros2 launch ahf_ros demo.launch.py light:=lattice
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from ahf_ros.nodes.launching import config, declared, default_argument
from ahf_ros.scenes.patterns import LIGHT_NAMES

PARAMETERS = {
    'illumination': [
        config('illumination.yaml'),
        {'light': LaunchConfiguration('light'), 'rate': 0.2},
    ],
    'detector': [
        config('detector.yaml'),
        {
            'expected_targets': 54,
            'max_duration': 20.0,
            'image_timeout': LaunchConfiguration('image_timeout'),
        },
    ],
    'scoreboard': [],
}


def generate_launch_description():
    # Room for whole images in the memory that processes share; Jazzy, and Kilted.
    variables = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
    profiles = config('fastdds_shm.xml')
    return LaunchDescription(
        [
            *declared(
                DeclareLaunchArgument(
                    'light',
                    default_value='stripe',
                    choices=list(LIGHT_NAMES),
                    description='Light that is projected onto the targets.',
                ),
                default_argument('detector', 'image_timeout'),
            ),
            *(SetEnvironmentVariable(name, profiles) for name in variables),
            *(
                Node(
                    package='ahf_ros',
                    executable=name,
                    parameters=parameters,
                    output='screen',
                    on_exit=Shutdown(reason=f'the {name} has ended'),
                )
                for name, parameters in PARAMETERS.items()
            ),
        ]
    )
