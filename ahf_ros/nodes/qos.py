"""Quality of service of topics: what users override, and what publishers offer.

`BEST_AVAILABLE` of ROS 2 decides once, when a subscription is made. On Jazzy, one made before its
publisher received none of 10 best-effort messages, nor any after a replay had changed to best
effort. `QoSOverridingOptions` of rclpy accepts a depth of 0 and does not say what it accepts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from ahf_ros.nodes.parameters import descriptor
from ahf_ros.settings.parameter import Parameter

PUBLISHER, SUBSCRIPTION, LOSSLESS_SUBSCRIPTION = (
    'publisher',
    'subscription',
    'subscription_lossless',
)
"""Ends of a topic, as `qos_overrides` call them."""

BEST_AVAILABLE = 'best_available'
"""The policy that follows the publishers."""

MAXIMUM_DEPTH = 100_000
"""Maximum number of messages that a topic keeps."""


def declare_qos(node: Node, end: str, topic: str, depth: int = 1) -> dict[str, Any]:
    """Declare the overrides of a topic as parameters, unless they are, and return their values.

    A publisher is reliable and volatile by default, a subscription as its publishers are.

    Parameters
    ----------
    node : rclpy.node.Node
        Gets the parameters `qos_overrides.<topic>.<end>.<policy>`.
    end : str
        One of `PUBLISHER`, `SUBSCRIPTION` and `LOSSLESS_SUBSCRIPTION`.
    topic : str
        Name of the topic, before remapping.
    depth : int
        Default of the number of messages that are kept, except by a lossless subscription.

    Raises
    ------
    ValueError
        If an override is not accepted.
    """
    prefix = f'qos_overrides.{node.resolve_topic_name(topic)}.{end}.'
    values = {}
    for item in _policies(end, depth):
        name = prefix + item.name
        named = Parameter(name, item.default, item.description, **_accepted(item), read_only=True)
        if not node.has_parameter(name):
            node.declare_parameter(name, item.default, descriptor(named))
        values[item.name] = node.get_parameter(name).value
        named.check(values[item.name])
    return values


def qos_profile(values: dict[str, Any], offered: Sequence[QoSProfile] = ()) -> QoSProfile:
    """Return the profile of declared values.

    Parameters
    ----------
    values : dict of str to value
        As `declare_qos` returns them.
    offered : sequence of QoSProfile
        Profiles of the publishers, which `BEST_AVAILABLE` follows: best effort where all of them
        are, transient local where all of them are.
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


def _policies(end: str, depth: int) -> tuple[Parameter, ...]:
    history = 'keep_all' if end == LOSSLESS_SUBSCRIPTION else 'keep_last'
    available: tuple[str, ...] = ()
    of_publishers = ''
    reliability, durability = 'reliable', 'volatile'
    if end != PUBLISHER:
        reliability = durability = BEST_AVAILABLE
        available, of_publishers = (BEST_AVAILABLE,), f'; {BEST_AVAILABLE}: as its publishers are'
    return (
        Parameter(
            'history', history, 'Which messages are kept.', choices=('keep_last', 'keep_all')
        ),
        Parameter(
            'depth',
            depth,
            'Number of messages that keep_last keeps.',
            minimum=1,
            maximum=MAXIMUM_DEPTH,
        ),
        Parameter(
            'reliability',
            reliability,
            f'Whether lost messages are resent{of_publishers}.',
            choices=('reliable', 'best_effort', *available),
        ),
        Parameter(
            'durability',
            durability,
            f'Whether those who come later get earlier messages{of_publishers}.',
            choices=('volatile', 'transient_local', *available),
        ),
    )


def _accepted(item: Parameter) -> dict[str, Any]:
    return {'minimum': item.minimum, 'maximum': item.maximum, 'choices': item.choices}
