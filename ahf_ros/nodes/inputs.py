"""Topics that a node subscribes to, as their publishers offer them, and what gets lost on the way.

The event `message_lost` of ROS 2 is not enough to count losses. Under Fast DDS on Jazzy, it was
silent when newer messages replaced 188 of 200 in the queue of a reliable subscription; the numbers
that publishers give their messages showed them all.
"""

import threading
import time
from collections.abc import Callable, Hashable, Mapping
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from ahf_ros.nodes.topics import (
    LOSSLESS_SUBSCRIPTION,
    SUBSCRIPTION,
    declare_qos,
    qos_profile,
    qos_words,
)

SENDERS = 100
"""Maximum number of publishers that are remembered, the latest ones."""


class Losses:
    """Counts gaps in the numbers of the messages of each publisher.

    Up to Jazzy, rclpy does not say which publisher a message is from. The gaps are then counted
    while there is one publisher on the topic, and the same one before and after the gap.
    """

    def __init__(self, publishers: Callable[[], frozenset[Hashable]]) -> None:
        self._publishers = publishers
        self._last: dict[str, tuple[int, int]] = {}
        self._before_pause: set[str] = set()
        self._known: frozenset[Hashable] = frozenset()
        self._told = 0
        self.lost = 0  # also those that a newer one replaced in a full queue of the middleware
        self.unknown = ''  # why losses cannot be counted at present; empty if they can

    def pause(self) -> None:
        """Do not count what is missed from now on until the next message of each publisher."""
        self._before_pause = set(self._last)
        self._known = frozenset()

    def add(self, information: Mapping[str, Any]) -> bool:
        """Count what was lost before a message; return whether the message is a new one.

        A subscription that takes the place of another one may get the last message again. What
        rclpy knows about the message is the `information`.
        """
        number = information.get('publication_sequence_number') or 0
        sent = information.get('source_timestamp') or 0
        if not number:
            self.unknown = 'the middleware does not number messages'
            return True
        told = information.get('publisher_gid')
        sender = str(told)
        before = self._last.pop(sender, None)
        self._last[sender] = number, sent
        if sent and before == (number, sent):
            return False
        if len(self._last) > SENDERS:
            del self._last[next(iter(self._last))]
        gap = number - before[0] - 1 if before and sender not in self._before_pause else -1
        self._before_pause.discard(sender)
        if told is not None:
            self.unknown = ''
            self.lost += max(gap, 0)
        elif (gap or self.unknown) and self._from_one():
            self.lost += max(gap, 0)
        return True

    def newly_lost(self) -> int:
        """Return how many messages were lost since the last call."""
        new = self.lost - self._told
        self._told += new
        return new

    def _from_one(self) -> bool:
        """Return whether all messages since the last look come from the same publisher."""
        before, self._known = self._known, self._publishers()
        several = len(self._known) > 1
        self.unknown = f'messages come from {len(self._known)} publishers' if several else ''
        return not several and before == self._known


class Input:
    """A subscription whose quality of service follows the publishers.

    Where it is lossless, every message is kept until the callback takes it, which must be at once.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        callback: Callable[[Any], None],
        group: CallbackGroup | None,
        lossless: bool,
    ) -> None:
        self._node = node
        self._kind = kind
        self.type_name = f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}'
        self.topic = topic  # before remapping
        self.name: str = node.resolve_topic_name(topic)
        self._callback = callback
        self._group = group
        end = LOSSLESS_SUBSCRIPTION if lossless else SUBSCRIPTION
        self.overrides = f'qos_overrides.{self.name}.{end}'  # how the names of all begin
        self._values = declare_qos(node, end, topic)
        self._lock = threading.Lock()
        self.losses = Losses(self._identifiers)
        self.arrived = time.monotonic()  # the last message, or the beginning
        self.profile = qos_profile(self._values)
        self._subscription: Subscription | None = None

    def open(self) -> None:
        """Subscribe."""
        with self._lock:
            if self._subscription:
                return
            self.arrived = time.monotonic()
            self._subscribe(qos_profile(self._values, self._offered()))
        if self.profile != qos_profile(self._values):
            self._report()

    def close(self) -> None:
        """End the subscription."""
        with self._lock:
            if self._subscription:
                self._node.destroy_subscription(self._subscription)
                self.losses.pause()
            self._subscription = None

    def publishers(self) -> list[TopicEndpointInfo]:
        """Return who publishes on the topic, of whatever type."""
        return self._node.get_publishers_info_by_topic(self.name)

    def follow(self) -> None:
        """Subscribe anew if the publishers now offer another quality of service."""
        offered = self._offered()
        with self._lock:
            profile = qos_profile(self._values, offered)
            if not offered or not self._subscription or profile == self.profile:
                return
            self._node.destroy_subscription(self._subscription)
            self._subscribe(profile)
        self._report()

    def _offered(self) -> list[QoSProfile]:
        return [it.qos_profile for it in self.publishers() if it.topic_type == self.type_name]

    def _identifiers(self) -> frozenset[Hashable]:
        return frozenset(tuple(it.endpoint_gid) for it in self.publishers())

    def _subscribe(self, profile: QoSProfile) -> None:
        self.profile = profile
        take: Any = self._take
        self._subscription = self._node.create_subscription(
            self._kind,
            self.topic,
            take,
            profile,
            callback_group=self._group,
            # Without a callback of its own, rclpy warns that nothing will be received.
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=lambda _: self.follow()),
        )

    def _take(self, message: Any, information: Mapping[str, Any]) -> None:
        self.arrived = time.monotonic()
        if self.losses.add(information):
            self._callback(message)

    def _report(self) -> None:
        text = f'{self.name} is subscribed to as it is published, {qos_words(self.profile)}'
        logger = self._node.get_logger()
        if self.profile.reliability == ReliabilityPolicy.BEST_EFFORT:
            logger.warning(f'{text}; messages that get lost are not resent')
        else:
            logger.info(text)
