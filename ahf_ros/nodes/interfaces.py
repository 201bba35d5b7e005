"""Topics, services and usual parameters of the nodes, in words; importable without ROS.

`--help` of the nodes, the table of docs/ros.md, the launch files and tests read them here.
"""

import json
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.nodes.settings import (
    DetectorNodeSettings,
    IlluminationNodeSettings,
    PoseNodeSettings,
    RegistrationNodeSettings,
    ScoreboardSettings,
)

_HELP = """\
usage: ros2 run ahf_ros {node} --ros-args -p PARAMETER:=VALUE -r TOPIC:=OTHER ...

{purpose}

topics and services:
{interfaces}

parameters that are changed most:
{parameters}

all parameters, while the node runs:
  ros2 param list /{node}
  ros2 param describe /{node} NAME
{more}
"""


@dataclass(frozen=True, slots=True)
class Interface:
    """One topic or service of a node, by its name before remapping."""

    use: str  # in, out or service
    name: str
    kind: str  # of the messages
    text: str  # what it is for, to follow the type


@dataclass(frozen=True, slots=True)
class NodeInterface:
    """What a user of a node needs to know before starting it."""

    purpose: str  # one sentence
    interfaces: tuple[Interface, ...]
    settings: type
    usual: tuple[str, ...]  # names of the parameters that are changed most
    more: str  # where all of them are described


def _interfaces(table: str) -> tuple[Interface, ...]:
    """Return the interfaces in a table with a line for each."""
    rows = (line.split(maxsplit=3) for line in table.strip().splitlines())
    return tuple(Interface(use, name, kind, text) for use, name, kind, text in rows)


_DETECTOR = _interfaces("""
in image sensor_msgs/Image \
    mono, colour, Bayer, YUV422; 8 and 16 bits and floats; any step and byte order
in image/compressed sensor_msgs/CompressedImage \
    with `image_transport` compressed: JPEG, WebP, PNG of 8 and 16 bits, TIFF
in image/zstd sensor_msgs/CompressedImage with `image_transport` zstd
in image/ffmpeg ffmpeg_image_transport_msgs/FFMPEGPacket \
    with `image_transport` ffmpeg: H.264, HEVC, AV1 and other video
in camera_info sensor_msgs/CameraInfo with `undistort`
in points sensor_msgs/PointCloud2 with `cloud`: organised, one point per pixel
out coded_targets ahf_ros/CodedTargetArray \
    one for every image, even if it is empty, refused or dropped
out ~/detections vision_msgs/Detection2DArray with `detections`
out ~/apriltag_detections apriltag_msgs/AprilTagDetectionArray \
    with `apriltag_detections`: square markers, as apriltag_ros publishes them
out ~/undistorted_targets ahf_ros/CodedTargetArray with `undistort`: in the rectified image
out ~/target_points sensor_msgs/PointCloud2 with `cloud`: position and ID of every target
out ~/target_labels visualization_msgs/MarkerArray \
    with `cloud`: IDs at the target points; only while somebody subscribes
out ~/debug_image sensor_msgs/Image \
    outlines and IDs drawn into the image; only while somebody subscribes
out ~/filtered_image sensor_msgs/Image \
    the image as the filter leaves it; only while somebody subscribes
out ~/annotations visualization_msgs/ImageMarker \
    outlines to lay over the image; only while somebody subscribes
out /diagnostics diagnostic_msgs/DiagnosticArray once per second
service ~/identify ahf_ros/srv/Identify \
    one image, one answer, never dropped; positions of its targets where a cloud is given
service ~/reset std_srvs/Trigger \
    forget what earlier images showed: filter, N that was estimated, families that were settled
service ~/change_state lifecycle_msgs/ChangeState \
    with `managed`, as the other services of the lifecycle
""")

_ILLUMINATION = _interfaces("""
out image sensor_msgs/Image rendered, mono8
out camera_info sensor_msgs/CameraInfo the calibration of the camera that is rendered
out ground_truth ahf_ros/CodedTargetArray the exact truth
""")

_POSE = _interfaces("""
in coded_targets ahf_ros/CodedTargetArray every one is answered, in order
in camera_info sensor_msgs/CameraInfo calibration of the camera
out ~/pose geometry_msgs/PoseWithCovarianceStamped \
    of the camera in the frame of the targets, where the image determines it
out ~/detections vision_msgs/Detection3DArray \
    with `detections`: poses of targets in the frame of the camera
out /tf tf2_msgs/TFMessage with `tf` and `target_frames`
in /tf tf2_msgs/TFMessage with `tf` and `target_frames`: parents that others publish
in /tf_static tf2_msgs/TFMessage likewise
out /diagnostics diagnostic_msgs/DiagnosticArray once per second
""")

_REGISTRATION = _interfaces("""
in target_points sensor_msgs/PointCloud2 \
    the targets of each scan, `~/target_points` of a detector
in points sensor_msgs/PointCloud2 with `cloud`: the cloud of each scan
in /tf tf2_msgs/TFMessage with `tf`: whether a frame has another parent
out ~/transform geometry_msgs/PoseWithCovarianceStamped the scanner in the frame, for every scan
out ~/residuals sensor_msgs/PointCloud2 \
    of the last scan, by target: place, ID, field minus scan, length
out ~/targets sensor_msgs/PointCloud2 all targets in the frame, with their covariances
out ~/cloud sensor_msgs/PointCloud2 with `cloud`: every cloud in the frame
out /tf_static tf2_msgs/TFMessage with `tf`: the frames of all scans
out /diagnostics diagnostic_msgs/DiagnosticArray once per second
service ~/save std_srvs/Trigger write clouds, transforms and targets to `folder`
service ~/undo std_srvs/Trigger take back the last scan or adjustment
service ~/reset std_srvs/Trigger forget all scans and their clouds; known coordinates stay
service ~/adjust std_srvs/Trigger adjust all scans and targets jointly
""")

_SCOREBOARD = _interfaces("""
in coded_targets ahf_ros/CodedTargetArray answers
in ground_truth ahf_ros/CodedTargetArray the truth
""")

NODES = {
    'detector': NodeInterface(
        purpose='Identifies the coded targets in images, also under difficult light.',
        interfaces=_DETECTOR,
        settings=DetectorNodeSettings,
        usual=(
            *('expected_targets', 'expected_ids', 'detector', 'family', 'polarity', 'ahf'),
            *('max_duration', 'stack', 'queue', 'image_transport'),
            *('image_timeout', 'acquisition', 'always'),
        ),
        more='docs/parameters.md and config/detector.yaml',
    ),
    'illumination': NodeInterface(
        purpose=(
            'Publishes synthetic images of coded targets under projected light, with their truth.'
        ),
        interfaces=_ILLUMINATION,
        settings=IlluminationNodeSettings,
        usual=('light', 'ambient', 'targets', 'width', 'height', 'dot_radius', 'rate', 'seed'),
        more='config/illumination.yaml',
    ),
    'pose': NodeInterface(
        purpose='Computes the pose of the camera from identified targets of known coordinates.',
        interfaces=_POSE,
        settings=PoseNodeSettings,
        usual=('coordinates', 'unit', 'tf', 'targets_frame', 'camera_matrix', 'target_frames'),
        more='docs/pose.md and config/pose.yaml',
    ),
    'registration': NodeInterface(
        purpose='Registers scans in one frame by the targets that they have in common.',
        interfaces=_REGISTRATION,
        settings=RegistrationNodeSettings,
        usual=('frame', 'coordinates', 'unit', 'cloud', 'cloud_tolerance', 'folder'),
        more='docs/registration.md and config/registration.yaml',
    ),
    'scoreboard': NodeInterface(
        purpose='Compares answers with the truth and prints one line per image.',
        interfaces=_SCOREBOARD,
        settings=ScoreboardSettings,
        usual=('images',),
        more='the line above: there are no others',
    ),
}


def help_text(node: str) -> str:
    """Return what one of `NODES` does, its topics, services and most used parameters."""
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
    return _HELP.format(
        node=node,
        purpose=about.purpose,
        interfaces=_columns(rows),
        parameters=_columns(settings),
        more=f'or {about.more}',
    )


def _columns(rows: Sequence[tuple[str, str]]) -> str:
    """Return a table of two columns; the second one is wrapped."""
    width = max(len(first) for first, _ in rows) + 4
    return '\n'.join(
        textwrap.fill(
            second, 99, initial_indent=f'  {first}'.ljust(width), subsequent_indent=' ' * width
        )
        for first, second in rows
    )
