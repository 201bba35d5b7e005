"""Why nothing arrives on a topic, in words, with what to do about it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import SequenceMatcher

from rclpy.qos import QoSCompatibility, ReliabilityPolicy, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.qos import qos_words

NEARBY = 3
"""Maximum number of other topics that are named."""


def other_types(source: Input, publishers: Iterable[TopicEndpointInfo]) -> str:
    """Return a message if publishers send another type than the one that is subscribed to."""
    found = {it.topic_type for it in publishers} - {source.type_name}
    if not found:
        return ''
    return f'{source.name} is of type {", ".join(sorted(found))}, accepted is {source.type_name}'


def several(source: Input, publishers: Iterable[TopicEndpointInfo]) -> str:
    """Return a message if there is more than one publisher of the type."""
    names = [_node(it) for it in publishers if it.topic_type == source.type_name]
    if len(names) < 2:
        return ''
    return (
        f'{len(names)} publishers on {source.name}, {", ".join(sorted(names))}: '
        'what they send is taken in the order of arrival'
    )


def silence(
    source: Input,
    publishers: Sequence[TopicEndpointInfo],
    topics: Callable[[], Mapping[str, Sequence[str]]],
) -> str:
    """Return why nothing arrives, and a remedy if there is one.

    Parameters
    ----------
    source : Input
        What nothing arrives on.
    publishers : sequence of TopicEndpointInfo
        Its publishers.
    topics : callable
        Returns the types of all topics that others publish.
    """
    ours = [it for it in publishers if it.topic_type == source.type_name]
    if not ours:
        return f'nobody publishes {source.type_name} on {source.name}{_nearby(source, topics())}'
    unfit = [it for it in ours if _incompatible(it, source)]
    if unfit:
        offered = ' and '.join(sorted({qos_words(it.qos_profile) for it in unfit}))
        return (
            f'{len(unfit)} of {len(ours)} publishers on {source.name} '
            f'{_have("offer", len(unfit))} {offered}, which a subscription that is '
            f'{qos_words(source.profile)} does not receive: '
            f'set {source.overrides} to what all of them offer'
        )
    names = ', '.join(sorted(map(_node, ours)))
    text = f'{names} {_have("publish", len(ours))} on {source.name}, but nothing arrives'
    if source.profile.reliability == ReliabilityPolicy.BEST_EFFORT:
        text += (
            ': large messages that are best effort need config/fastdds_shm.xml on both sides or '
            'larger buffers of the network'
        )
    return text


def nearest(name: str, others: Iterable[str]) -> list[str]:
    """Return the names of topics that are most like a name, the nearest first."""

    def likeness(other: str) -> tuple[float, str]:
        return -SequenceMatcher(None, name, other).ratio(), other

    return sorted(others, key=likeness)[:NEARBY]


def _nearby(source: Input, topics: Mapping[str, Sequence[str]]) -> str:
    """Return where the type, or the images in another form, are published instead."""
    found = nearest(source.name, (it for it, kinds in topics.items() if source.type_name in kinds))
    if found:
        return f'; it is published on {", ".join(found)}: remap with -r {source.topic}:={found[0]}'
    for transport, kind in (('raw', 'Image'), ('compressed', 'CompressedImage')):
        name = f'sensor_msgs/msg/{kind}'
        found = nearest(source.name, (it for it, kinds in topics.items() if name in kinds))
        if found and 'Image' in source.type_name:
            return (
                f'; {name} is published on {", ".join(found)}: set image_transport to {transport}'
            )
    return ''


def _incompatible(publisher: TopicEndpointInfo, source: Input) -> bool:
    fit, _ = qos_check_compatible(publisher.qos_profile, source.profile)
    return bool(fit == QoSCompatibility.ERROR)


def _node(of: TopicEndpointInfo) -> str:
    return f'{of.node_namespace.rstrip("/")}/{of.node_name}'


def _have(verb: str, count: int) -> str:
    if count > 1:
        return verb
    return f'{verb}es' if verb.endswith('sh') else f'{verb}s'
