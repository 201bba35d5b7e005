"""Looks at whether images and clouds arrive, and reports why not, with what to do about it."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import SequenceMatcher

from rclpy.qos import QoSCompatibility, ReliabilityPolicy, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

from ahf_ros.nodes.cloud import ANSWER, CLOUD
from ahf_ros.nodes.diagnostics import Tally
from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.matching import Waiting
from ahf_ros.nodes.process import ProcessNode
from ahf_ros.nodes.qos import qos_words
from ahf_ros.nodes.settings import MAXIMUM_TOLERANCE

NEARBY = 3
"""Maximum number of other topics that are named."""

_DIGITS = re.compile(r'\d+')  # a report whose numbers alone have changed is not logged again


class Watch:
    """Keeps the part of a tally that depends on publishers and on time.

    What it reports is logged when it begins, and is in the diagnostics as long as it lasts.

    Parameters
    ----------
    node : ProcessNode
        Subscribes, and logs.
    tally : Tally
        Gets the reports.
    """

    def __init__(self, node: ProcessNode, tally: Tally) -> None:
        self._node = node
        self._tally = tally
        self._reported: frozenset[str] = frozenset()

    def look(self, images: Input, timeout: float, clouds: tuple[Input, Waiting] | None) -> None:
        """Bring the tally up to date.

        Parameters
        ----------
        images : Input
            Where images come from.
        timeout : float
            Time of waiting after which that is reported, s; 0: never.
        clouds : tuple of Input and Waiting, optional
            Where clouds come from, and what waits for its match.
        """
        tally, publishers = self._tally, images.publishers()
        reports = {
            'mistaken': other_types(images, publishers),
            'several': several(images, publishers),
            'silent': '',
            'unmatched': '',
        }
        silent = time.monotonic() - images.arrived
        if timeout and silent > timeout:
            reports['silent'] = silence(images, publishers, self._topics)
            tally.silent = f'no image for {silent:.0f} s: {reports["silent"]}'
        else:
            tally.silent = ''
        if clouds and timeout:
            reports['unmatched'] = self._unmatched(*clouds, timeout)
        tally.mistaken, tally.several = reports['mistaken'], reports['several']
        tally.lost += images.losses.newly_lost()
        tally.lost_unknown = images.losses.unknown
        if tally.clouds:
            tally.clouds.waiting = reports['unmatched']
            if clouds:
                tally.clouds.lost += clouds[0].losses.newly_lost()
        self._log(reports)

    def _unmatched(self, source: Input, waiting: Waiting, timeout: float) -> str:
        if waiting.seconds[ANSWER] <= timeout:
            return ''
        images, clouds = waiting.counts[ANSWER], waiting.counts[CLOUD]
        if not clouds:
            reason = silence(source, source.publishers(), self._topics)
            return f'{images} images wait for a cloud: {reason}'
        text = f'{images} images and {clouds} clouds wait for each other'
        if waiting.nearest > MAXIMUM_TOLERANCE * 1e9:
            return (
                f'{text}: their stamps are of different clocks, {waiting.nearest / 1e9:g} s apart'
            )
        return (
            f'{text}: the nearest stamps differ by {waiting.nearest / 1e9:g} s, '
            f'set cloud_tolerance to at least {_rounded_up(waiting.nearest) / 1e9:g}'
        )

    def _topics(self) -> Mapping[str, Sequence[str]]:
        """Return the types of the topics that others publish."""
        own = self._node.get_fully_qualified_name()
        return {
            name: kinds
            for name, kinds in self._node.get_topic_names_and_types()
            if not name.startswith(f'{own}/') and self._node.count_publishers(name)
        }

    def _log(self, reports: Mapping[str, str]) -> None:
        now = {_DIGITS.sub('', text): text for text in reports.values() if text}
        for form in sorted(now.keys() - self._reported):
            self._node.get_logger().warning(now[form])
        self._reported = frozenset(now)


def _rounded_up(nanoseconds: int) -> int:
    """Return a number of two significant digits that is not less."""
    step = 10 ** max(0, len(str(nanoseconds)) - 2)
    return -(-nanoseconds // step) * step


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
