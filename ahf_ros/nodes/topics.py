"""Topics of the nodes: their names, and their quality of service, which users override.

`BEST_AVAILABLE` of ROS 2 decides once, when a subscription is made. On Jazzy, one made before its
publisher received none of 10 best-effort messages, nor any after a replay had changed to best
effort. `QoSOverridingOptions` of rclpy accepts a depth of 0 and does not say what it accepts.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CompressedImage, Image

from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.nodes.drivers import beside
from ahf_ros.nodes.parameters import descriptor
from ahf_ros.nodes.settings import FFMPEG, IMAGE_TRANSPORTS, PACKAGES, RAW

IMAGE = 'image'
"""Base topic of the images; remapping it moves the topics of this module as well."""


def image_type(transport: str) -> type:
    """Return the type of the images of one of `IMAGE_TRANSPORTS`."""
    if transport == FFMPEG:
        return import_module(f'{PACKAGES[FFMPEG]}.msg').FFMPEGPacket
    return Image if transport == RAW else CompressedImage


CODED_TARGETS = 'coded_targets'
"""What is identified."""

POINTS, TARGET_POINTS, TARGET_LABELS = 'points', '~/target_points', '~/target_labels'
"""Clouds, and what their positions of targets are published on."""

DETECTIONS, APRILTAG_DETECTIONS = '~/detections', '~/apriltag_detections'
UNDISTORTED = '~/undistorted_targets'
"""Answers in other forms."""

ANSWERS_KEPT = 1000
"""Depth of the publishers of answers, so that lost messages can be resent.

With a small depth, the next answer replaces one that a subscriber has not received yet.
"""

IMAGES_KEPT = 30
"""Depth of the subscription to images, so that each of them is answered, be it as dropped.

While an image is identified, the node takes others late: with a depth of 1, 45 of 100 images of
2.8 MP at 30 Hz were gone before the node knew of them; with one of 10, none.
"""

PUBLISHER, SUBSCRIPTION = 'publisher', 'subscription'
LOSSLESS_SUBSCRIPTION = 'subscription_lossless'
"""Ends of a topic, as `qos_overrides` call them."""

BEST_AVAILABLE = 'best_available'
"""The policy that follows the publishers."""


def image_topic(node: Node, transport: str) -> str:
    """Return the topic of one of `IMAGE_TRANSPORTS`: the base topic, or one below it."""
    if transport == RAW:
        return IMAGE
    derived = f'{node.resolve_topic_name(IMAGE)}/{transport}'
    return _remapped(node, f'{IMAGE}/{transport}') or derived


def camera_info_topic(node: Node) -> str:
    """Return the topic of the calibration of the camera: beside the base topic of the images."""
    return _remapped(node, 'camera_info') or beside(node.resolve_topic_name(IMAGE))


def _remapped(node: Node, name: str) -> str:
    """Return the name if it is itself remapped, an empty one otherwise."""
    plain = node.resolve_topic_name(name, only_expand=True)
    return name if node.resolve_topic_name(name) != plain else ''


def declare_topics(node: Node) -> None:
    """Declare the overrides of the topics that come and go with the parameters of the detector."""
    images = [image_topic(node, transport) for transport in IMAGE_TRANSPORTS]
    for topic in (*images, camera_info_topic(node), POINTS):
        for end in (SUBSCRIPTION, LOSSLESS_SUBSCRIPTION):
            declare_qos(node, end, topic, IMAGES_KEPT if topic in images else 1)
    for topic in (TARGET_POINTS, DETECTIONS, APRILTAG_DETECTIONS, UNDISTORTED):
        declare_qos(node, PUBLISHER, topic, ANSWERS_KEPT)
    declare_qos(node, PUBLISHER, TARGET_LABELS)


def declare_qos(node: Node, end: str, topic: str, depth: int = 1) -> dict[str, Any]:
    """Declare the overrides of a topic as parameters, unless they are, and return their values.

    The parameters are `qos_overrides.<topic>.<end>.<policy>`, with the topic after remapping. A
    publisher is reliable and volatile by default, a subscription as its publishers are. The depth
    is the default of the number of messages kept, except by a lossless subscription. Raises a
    ValueError if an override is not accepted.
    """
    reliability, durability = 'reliable', 'volatile'
    available: tuple[str, ...] = ()
    of_publishers = ''
    if end != PUBLISHER:
        reliability = durability = BEST_AVAILABLE
        available, of_publishers = (BEST_AVAILABLE,), f'; {BEST_AVAILABLE}: as its publishers are'
    history = 'keep_all' if end == LOSSLESS_SUBSCRIPTION else 'keep_last'
    begin = f'qos_overrides.{node.resolve_topic_name(topic)}.{end}.'
    policies = (
        Parameter(
            f'{begin}history',
            history,
            'Which messages are kept.',
            choices=('keep_last', 'keep_all'),
            read_only=True,
        ),
        Parameter(
            f'{begin}depth',
            depth,
            'Number of messages that keep_last keeps.',
            minimum=1,
            maximum=100_000,
            read_only=True,
        ),
        Parameter(
            f'{begin}reliability',
            reliability,
            f'Whether lost messages are resent{of_publishers}.',
            choices=('reliable', 'best_effort', *available),
            read_only=True,
        ),
        Parameter(
            f'{begin}durability',
            durability,
            f'Whether those who come later get earlier messages{of_publishers}.',
            choices=('volatile', 'transient_local', *available),
            read_only=True,
        ),
    )
    values = {}
    for item in policies:
        if not node.has_parameter(item.name):
            node.declare_parameter(item.name, item.default, descriptor(item))
        value = values[item.name.removeprefix(begin)] = node.get_parameter(item.name).value
        item.check(value)
    return values


def qos_profile(values: dict[str, Any], offered: Sequence[QoSProfile] = ()) -> QoSProfile:
    """Return the profile of values as `declare_qos` returns them.

    `BEST_AVAILABLE` follows the profiles that publishers offer: best effort where all of them are,
    transient local where all of them are.
    """
    reliability, durability = values['reliability'], values['durability']
    if reliability == BEST_AVAILABLE:
        weak = offered and all(it.reliability == ReliabilityPolicy.BEST_EFFORT for it in offered)
        reliability = 'best_effort' if weak else 'reliable'
    if durability == BEST_AVAILABLE:
        kept = offered and all(it.durability == DurabilityPolicy.TRANSIENT_LOCAL for it in offered)
        durability = 'transient_local' if kept else 'volatile'
    return QoSProfile(
        history=HistoryPolicy[values['history'].upper()],
        depth=values['depth'],
        reliability=ReliabilityPolicy[reliability.upper()],
        durability=DurabilityPolicy[durability.upper()],
    )


def qos_words(profile: QoSProfile) -> str:
    """Return reliability and durability in words."""
    return f'{profile.reliability.name}, {profile.durability.name}'.lower().replace('_', ' ')
