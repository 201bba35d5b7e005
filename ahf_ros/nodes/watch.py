"""Looks at whether images and clouds arrive, and reports why not, with what to do about it."""

import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial

from rclpy.qos import QoSCompatibility, QoSProfile, ReliabilityPolicy, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

from ahf_ros.clouds.cloud_settings import MAXIMUM_TOLERANCE
from ahf_ros.clouds.matching import ANSWER, CLOUD, Waiting
from ahf_ros.nodes.diagnostics import Tally
from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.patience import TRIGGERED, UNKNOWN, Patience
from ahf_ros.nodes.process import ProcessNode
from ahf_ros.nodes.topics import CODED_TARGETS, qos_words

AGAIN = 10.0
"""Time without a report after which it is logged again, s."""

_NUMBERS = re.compile(r'\d+(, \d+)*( and \d+ more)?')  # these alone make no other report


@dataclass(frozen=True, slots=True)
class Expected:
    """What is expected of the publishers of a topic."""

    timeout: float  # of silence that is a warning, s; 0: none is
    acquisition: str = TRIGGERED
    busy: bool = False  # whether the node is at work on what they sent


class Silence:
    """Says of a topic that nothing arrives, as long as this means something."""

    def __init__(self, node: ProcessNode, what: str) -> None:
        self._topics = partial(topics_of_others, node)
        self._what = what
        self._patience = Patience(time.monotonic())

    def look(
        self, source: Input, publishers: Sequence[TopicEndpointInfo], expected: Expected
    ) -> str:
        """Return for how long nothing has arrived, and why; empty if that is as expected."""
        ours = [it for it in publishers if it.topic_type == source.type_name]
        patience = self._patience
        identifiers = frozenset(tuple(it.endpoint_gid) for it in ours)
        patience.look(time.monotonic(), identifiers, source.arrived, expected.busy)
        fit = not unfit(source, ours)
        if not patience.ended(expected.timeout, expected.acquisition, fit):
            return ''
        why = silence(source, publishers, self._topics)
        if ours and fit and expected.acquisition == UNKNOWN:
            why += '; with acquisition triggered, that is no warning'
        return f'no {self._what} for {patience.waited:.0f} s: {why}'


class Watch:
    """Keeps the part of a tally that depends on publishers and on time.

    What it reports is logged when it begins, and is in the diagnostics as long as it lasts.
    """

    def __init__(self, node: ProcessNode, tally: Tally) -> None:
        self._node = node
        self._tally = tally
        self._silence = Silence(node, 'image')
        self._reported: dict[str, float] = {}  # when what was last to be said, s

    def look(
        self, images: Input, expected: Expected, clouds: tuple[Input, Waiting] | None
    ) -> None:
        """Bring the tally up to date.

        `clouds` are where clouds come from, and what waits for its match.
        """
        tally, publishers = self._tally, images.publishers()
        tally.mistaken = other_types(images, publishers)
        tally.several = several(images, publishers)
        tally.twins = self._twins()
        tally.lost += images.losses.newly_lost()
        tally.lost_unknown = images.losses.unknown
        tally.silent = self._silence.look(images, publishers, expected)
        waiting = ''
        if clouds and expected.timeout and clouds[1].seconds[ANSWER] > expected.timeout:
            waiting = self._unmatched(*clouds)
        if tally.clouds:
            tally.clouds.waiting = waiting
            tally.clouds.lost += clouds[0].losses.newly_lost() if clouds else 0
        said = tally.mistaken, tally.several, tally.twins, tally.slow, tally.advice
        self._log(*said, tally.silent.partition(': ')[2], waiting)

    def _unmatched(self, source: Input, waiting: Waiting) -> str:
        """Return why images wait for their clouds."""
        images, clouds = waiting.counts[ANSWER], waiting.counts[CLOUD]
        if not clouds:
            reason = silence(source, source.publishers(), partial(topics_of_others, self._node))
            return f'{images} images wait for a cloud: {reason}'
        text, apart = f'{images} images and {clouds} clouds wait for each other', waiting.nearest
        if apart > MAXIMUM_TOLERANCE * 1e9:
            return f'{text}: their stamps are of different clocks, {apart / 1e9:g} s apart'
        step = 10 ** max(0, len(str(apart)) - 2)  # of the last of two significant digits
        enough = -(-apart // step) * step
        return (
            f'{text}: the nearest stamps differ by {apart / 1e9:g} s, '
            f'set cloud_tolerance to at least {enough / 1e9:g}'
        )

    def _twins(self) -> str:
        """Return a message if another node has the same name, or publishes on the same topic."""
        node = self._node
        own = node.get_fully_qualified_name()
        every = node.get_publishers_info_by_topic('/parameter_events')  # each node has one
        names = list(map(_node, every))
        if (count := names.count(own)) > 1:
            return f'{count} nodes are named {own}: give one another name by -r __node:=OTHER'
        topic = node.resolve_topic_name(CODED_TARGETS)
        answering = sorted(map(_node, node.get_publishers_info_by_topic(topic)))
        if len(answering) < 2:
            return ''
        return (
            f'{len(answering)} nodes publish on {topic}, {", ".join(answering)}: give one another '
            f'topic by -r {CODED_TARGETS}:=OTHER, or a namespace by -r __ns:=/OTHER'
        )

    def _log(self, *reports: str) -> None:
        now = time.monotonic()
        for text in filter(None, reports):
            form = _NUMBERS.sub('', text)
            if form not in self._reported:
                self._node.get_logger().warning(text)
            self._reported[form] = now
        self._reported = {form: at for form, at in self._reported.items() if now - at < AGAIN}


def topics_of_others(node: ProcessNode) -> Mapping[str, Sequence[str]]:
    """Return the types of the topics that others publish."""
    own = node.get_fully_qualified_name()
    return {
        name: [it.topic_type for it in node.get_publishers_info_by_topic(name)]
        for name, _ in node.get_topic_names_and_types()
        if not name.startswith(f'{own}/')
    }


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
    """Return why nothing arrives from the publishers of a topic, and a remedy if there is one.

    `topics` returns the types of all topics that others publish.
    """
    ours = [it for it in publishers if it.topic_type == source.type_name]
    if not ours and publishers:
        return other_types(source, publishers)
    if not ours:
        return f'nobody publishes {source.type_name} on {source.name}{_nearby(source, topics())}'
    if offered := unfit(source, ours):
        return (
            f'{len(offered)} of {len(ours)} publishers on {source.name} '
            f'offer{"s" if len(offered) == 1 else ""} '
            f'{" and ".join(sorted(set(map(qos_words, offered))))}, which a subscription that is '
            f'{qos_words(source.profile)} does not receive: '
            f'set {source.overrides} to what all of them offer'
        )
    text = (
        f'{", ".join(sorted(map(_node, ours)))} publish{"es" if len(ours) == 1 else ""} '
        f'on {source.name}, but nothing arrives'
    )
    if source.profile.reliability == ReliabilityPolicy.BEST_EFFORT:
        text += (
            ': large messages that are best effort need config/fastdds_shm.xml on both sides or '
            'larger buffers of the network'
        )
    return text


def unfit(source: Input, publishers: Iterable[TopicEndpointInfo]) -> list[QoSProfile]:
    """Return the quality of service of publishers that a subscription does not receive from."""
    offered = (it.qos_profile for it in publishers)
    return [
        it
        for it in offered
        if qos_check_compatible(it, source.profile)[0] == QoSCompatibility.ERROR
    ]


def _nearby(source: Input, topics: Mapping[str, Sequence[str]]) -> str:
    """Return where the type, or the images in another form, are published instead."""

    def nearest(wanted: str) -> list[str]:
        names = [name for name, kinds in topics.items() if wanted in kinds]
        return get_close_matches(source.name, names, n=3, cutoff=0.0)

    if found := nearest(source.type_name):
        return f'; it is published on {", ".join(found)}: remap with -r {source.topic}:={found[0]}'
    if 'Image' in source.type_name:
        for transport, kind in (('raw', 'Image'), ('compressed', 'CompressedImage')):
            name = f'sensor_msgs/msg/{kind}'
            if found := nearest(name):
                return (
                    f'; {name} is published on {", ".join(found)}: '
                    f'set image_transport to {transport}'
                )
    return ''


def _node(of: TopicEndpointInfo) -> str:
    return f'{of.node_namespace.rstrip("/")}/{of.node_name}'
