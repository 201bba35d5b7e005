"""Overrides of the quality of service."""

from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

import rclpy
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from ahf_ros.nodes.topics import (
    LOSSLESS_SUBSCRIPTION,
    PUBLISHER,
    SUBSCRIPTION,
    declare_qos,
    qos_profile,
)

RELIABLE, WEAK = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT
VOLATILE, KEPT = DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL


def declared(end: str, **given: Any) -> dict[str, Any]:
    """Return the values of a topic of a node with overrides."""
    overrides = [
        Parameter(f'qos_overrides./a.{end}.{it}', value=value) for it, value in given.items()
    ]
    node = rclpy.create_node('overridden', parameter_overrides=overrides)
    try:
        assert declare_qos(node, end, '/a') == declare_qos(node, end, '/a')
        return declare_qos(node, end, '/a')
    finally:
        node.destroy_node()


def offers(*pairs: tuple[ReliabilityPolicy, DurabilityPolicy]) -> list[QoSProfile]:
    return [QoSProfile(depth=1, reliability=one, durability=two) for one, two in pairs]


@pytest.mark.parametrize(
    ('offered', 'policies'),
    [
        ([], (RELIABLE, VOLATILE)),
        ([(WEAK, VOLATILE)], (WEAK, VOLATILE)),
        ([(WEAK, KEPT), (WEAK, VOLATILE)], (WEAK, VOLATILE)),
        ([(WEAK, KEPT), (RELIABLE, KEPT)], (RELIABLE, KEPT)),
    ],
)
def test_a_subscription_is_as_all_its_publishers(
    graph: Any, offered: list[Any], policies: tuple[Any, Any]
) -> None:
    profile = qos_profile(declared(SUBSCRIPTION), offers(*offered))
    assert (profile.reliability, profile.durability) == policies
    fixed = declared(SUBSCRIPTION, reliability='reliable', durability='transient_local')
    profile = qos_profile(fixed, offers(*offered))
    assert (profile.reliability, profile.durability) == (RELIABLE, KEPT)


def test_every_policy_is_overridden(graph: Any) -> None:
    profile = qos_profile(
        declared(
            PUBLISHER,
            history='keep_all',
            depth=7,
            reliability='best_effort',
            durability='volatile',
        )
    )
    assert (profile.history, profile.depth) == (HistoryPolicy.KEEP_ALL, 7)
    assert (profile.reliability, profile.durability) == (WEAK, VOLATILE)
    assert qos_profile(declared(LOSSLESS_SUBSCRIPTION)).history == HistoryPolicy.KEEP_ALL


@pytest.mark.parametrize(
    ('end', 'policy', 'value', 'accepted'),
    [
        (
            SUBSCRIPTION,
            'reliability',
            'foo',
            "is 'foo', accepted is one of reliable, best_effort, b",
        ),
        (
            PUBLISHER,
            'durability',
            'best_available',
            'accepted is one of volatile, transient_local',
        ),
        (PUBLISHER, 'depth', 0, 'Min: 1, Max: 100000, value: 0'),
        (SUBSCRIPTION, 'depth', 'many', "is 'many', accepted is an integer from 1 to"),
        (SUBSCRIPTION, 'history', 3, 'is 3, accepted is one of keep_last, keep_all'),
    ],
)
def test_what_is_not_accepted_is_named(
    graph: Any, end: str, policy: str, value: Any, accepted: str
) -> None:
    with pytest.raises(Exception, match=accepted) as error:
        declared(end, **{policy: value})
    assert f'qos_overrides./a.{end}.{policy}' in str(error.value)
