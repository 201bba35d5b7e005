"""Topics of the node: depth of answers, and names that image_transport derives from `image`."""

from __future__ import annotations

from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, Image

from ahf_ros.nodes.qos import LOSSLESS_SUBSCRIPTION, PUBLISHER, SUBSCRIPTION, declare_qos

IMAGE = 'image'
"""Base topic of the images; remapping it moves the topics of this module as well."""

IMAGE_TYPES = {'raw': Image, 'compressed': CompressedImage}
"""Type of the images by image transport."""

POINTS, TARGET_POINTS, TARGET_LABELS = 'points', '~/target_points', '~/target_labels'
"""Clouds, and what their positions of targets are published on."""

DETECTIONS, UNDISTORTED = '~/detections', '~/undistorted_targets'
"""Answers in other forms."""

ANSWERS_KEPT = 1000
"""Depth of the publishers of answers, so that lost messages can be resent.

With a small depth, the next answer replaces one that a subscriber has not received yet.
"""


def image_topic(node: Node, transport: str) -> str:
    """Return the topic of the images of a transport: the base topic, or one below it.

    Parameters
    ----------
    node : rclpy.node.Node
        Its remappings apply.
    transport : str
        One of `IMAGE_TYPES`.
    """
    if transport == 'raw':
        return IMAGE
    derived = f'{node.resolve_topic_name(IMAGE)}/{transport}'
    return _remapped(node, f'{IMAGE}/{transport}') or derived


def camera_info_topic(node: Node) -> str:
    """Return the topic of the calibration of the camera: beside the base topic of the images."""
    beside = node.resolve_topic_name(IMAGE).rpartition('/')[0]
    return _remapped(node, 'camera_info') or f'{beside}/camera_info'


def declare_topics(node: Node) -> None:
    """Declare the overrides of the topics that come and go with the parameters of the detector."""
    images = [image_topic(node, transport) for transport in IMAGE_TYPES]
    for topic in (*images, camera_info_topic(node), POINTS):
        for end in (SUBSCRIPTION, LOSSLESS_SUBSCRIPTION):
            declare_qos(node, end, topic)
    for topic in (TARGET_POINTS, DETECTIONS, UNDISTORTED):
        declare_qos(node, PUBLISHER, topic, ANSWERS_KEPT)
    declare_qos(node, PUBLISHER, TARGET_LABELS)


def _remapped(node: Node, name: str) -> str:
    """Return the name if it is itself remapped, an empty one otherwise."""
    plain = node.resolve_topic_name(name, only_expand=True)
    return name if node.resolve_topic_name(name) != plain else ''
