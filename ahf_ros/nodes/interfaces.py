"""Topics, services and usual parameters of the nodes, in words; importable without ROS.

`--help` of the nodes, the table of docs/ros.md, the launch files and tests read them here.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from ahf_ros.nodes.settings import (
    DetectorNodeSettings,
    IlluminationNodeSettings,
    ScoreboardSettings,
)
from ahf_ros.settings.nested import flat_parameters

SUBSCRIBED, PUBLISHED, SERVED = 'in', 'out', 'service'
"""What a node does with a topic or service."""

_WIDTH = 99
_REST = """\
all parameters, while the node runs:
  ros2 param list /{node}
  ros2 param describe /{node} NAME
or docs/parameters.md, and the files in config/.
"""


@dataclass(frozen=True, slots=True)
class Interface:
    """One topic or service of a node.

    Attributes
    ----------
    use : str
        `SUBSCRIBED`, `PUBLISHED` or `SERVED`.
    name : str
        Name before remapping.
    kind : str
        Type of the messages.
    text : str
        What it is for, to follow the type.
    """

    use: str
    name: str
    kind: str
    text: str


@dataclass(frozen=True, slots=True)
class NodeInterface:
    """What a user of a node needs to know before starting it.

    Attributes
    ----------
    purpose : str
        What the node does, one sentence.
    interfaces : tuple of Interface
        Its topics and services.
    settings : type
        Settings dataclass with its parameters.
    usual : tuple of str
        Names of the parameters that are changed most.
    """

    purpose: str
    interfaces: tuple[Interface, ...]
    settings: type
    usual: tuple[str, ...]


NODES: Mapping[str, NodeInterface] = MappingProxyType(
    {
        'detector': NodeInterface(
            'Identifies the coded targets in images, also under difficult light.',
            (
                Interface(
                    SUBSCRIBED,
                    'image',
                    'sensor_msgs/Image',
                    'mono, colour, Bayer, YUV422; 8 and 16 bits and floats; any step and byte '
                    'order',
                ),
                Interface(
                    SUBSCRIBED,
                    'image/compressed',
                    'sensor_msgs/CompressedImage',
                    'with `image_transport` compressed: JPEG, PNG of 8 and 16 bits',
                ),
                Interface(SUBSCRIBED, 'camera_info', 'sensor_msgs/CameraInfo', 'with `undistort`'),
                Interface(
                    SUBSCRIBED,
                    'points',
                    'sensor_msgs/PointCloud2',
                    'with `cloud`: organised, one point per pixel',
                ),
                Interface(
                    PUBLISHED,
                    'coded_targets',
                    'ahf_ros/CodedTargetArray',
                    'one for every image, even if it is empty',
                ),
                Interface(
                    PUBLISHED,
                    '~/detections',
                    'vision_msgs/Detection2DArray',
                    'with `detections`',
                ),
                Interface(
                    PUBLISHED,
                    '~/undistorted_targets',
                    'ahf_ros/CodedTargetArray',
                    'with `undistort`: in the rectified image',
                ),
                Interface(
                    PUBLISHED,
                    '~/target_points',
                    'sensor_msgs/PointCloud2',
                    'with `cloud`: position and ID of every target',
                ),
                Interface(
                    PUBLISHED,
                    '~/target_labels',
                    'visualization_msgs/MarkerArray',
                    'with `cloud`: IDs at the target points; only while somebody subscribes',
                ),
                Interface(
                    PUBLISHED,
                    '~/debug_image',
                    'sensor_msgs/Image',
                    'outlines and IDs drawn into the image; only while somebody subscribes',
                ),
                Interface(
                    PUBLISHED,
                    '~/filtered_image',
                    'sensor_msgs/Image',
                    'the image as the filter leaves it; only while somebody subscribes',
                ),
                Interface(
                    PUBLISHED,
                    '~/annotations',
                    'visualization_msgs/ImageMarker',
                    'outlines to lay over the image; only while somebody subscribes',
                ),
                Interface(
                    PUBLISHED,
                    '/diagnostics',
                    'diagnostic_msgs/DiagnosticArray',
                    'once per second',
                ),
                Interface(
                    SERVED,
                    '~/identify',
                    'ahf_ros/srv/Identify',
                    'one image, one answer, never dropped',
                ),
                Interface(
                    SERVED, '~/reset', 'std_srvs/Trigger', 'forget the filter of earlier images'
                ),
                Interface(
                    SERVED,
                    '~/change_state',
                    'lifecycle_msgs/ChangeState',
                    'with `managed`, as the other services of the lifecycle',
                ),
            ),
            DetectorNodeSettings,
            (
                'expected_targets',
                'expected_ids',
                'detector',
                'family',
                'polarity',
                'ahf',
                'max_duration',
                'stack',
                'queue',
                'image_transport',
            ),
        ),
        'illumination': NodeInterface(
            'Publishes synthetic images of coded targets under projected light, with their truth.',
            (
                Interface(PUBLISHED, 'image', 'sensor_msgs/Image', 'rendered, mono8'),
                Interface(
                    PUBLISHED,
                    'camera_info',
                    'sensor_msgs/CameraInfo',
                    'the calibration of the camera that is rendered',
                ),
                Interface(
                    PUBLISHED, 'ground_truth', 'ahf_ros/CodedTargetArray', 'the exact truth'
                ),
            ),
            IlluminationNodeSettings,
            ('light', 'ambient', 'targets', 'width', 'height', 'dot_radius', 'rate', 'seed'),
        ),
        'scoreboard': NodeInterface(
            'Compares answers with the truth and prints one line per image.',
            (
                Interface(SUBSCRIBED, 'coded_targets', 'ahf_ros/CodedTargetArray', 'answers'),
                Interface(SUBSCRIBED, 'ground_truth', 'ahf_ros/CodedTargetArray', 'the truth'),
            ),
            ScoreboardSettings,
            ('images',),
        ),
    }
)
"""Nodes by name."""


def help_text(node: str) -> str:
    """Return what a node does, its topics, services and most used parameters.

    Parameters
    ----------
    node : str
        One of `NODES`.
    """
    about = NODES[node]
    rows = [
        (f'{it.use:7} {it.name}', f'{it.kind}, {it.text.replace("`", "")}')
        for it in about.interfaces
    ]
    parameters = {item.name: item for item in flat_parameters(about.settings)}
    settings = [
        (item.name, f'{item.description} Default: {json.dumps(item.default)}.')
        for item in map(parameters.__getitem__, about.usual)
    ]
    return '\n'.join(
        [
            f'usage: ros2 run ahf_ros {node} --ros-args -p PARAMETER:=VALUE -r TOPIC:=OTHER ...',
            '',
            about.purpose,
            '',
            'topics and services:',
            *_columns(rows),
            '',
            'parameters that are changed most:',
            *_columns(settings),
            '',
            _REST.format(node=node),
        ]
    )


def _columns(rows: Iterable[tuple[str, str]]) -> list[str]:
    """Return the lines of a table of two columns; the second one is wrapped."""
    rows = list(rows)
    width = max(len(first) for first, _ in rows) + 4
    lines = []
    for first, second in rows:
        indent = ' ' * width
        wrapped = textwrap.wrap(
            second, _WIDTH, initial_indent=f'  {first}'.ljust(width), subsequent_indent=indent
        )
        lines.extend(wrapped)
    return lines
