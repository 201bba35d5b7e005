"""Topics that a node subscribes to, as their publishers offer them, and what gets lost on the way.

The event `message_lost` of ROS 2 is not enough to count losses. Under Fast DDS on Jazzy, it was
silent when newer messages replaced 188 of 200 in the queue of a reliable subscription; the numbers
that publishers give their messages showed them all.
"""

from __future__ import annotations

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

from ahf_ros.nodes.qos import (
    LOSSLESS_SUBSCRIPTION,
    SUBSCRIPTION,
    declare_qos,
    qos_profile,
    qos_words,
)

NUMBER, SENDER, SENT = 'publication_sequence_number', 'publisher_gid', 'source_timestamp'
"""Entries of the information that rclpy gives with a message."""

SENDERS = 100
"""Maximum number of publishers that are remembered, the latest ones."""


class Losses:
    """Counts gaps in the numbers of the messages of each publisher.

    Up to Jazzy, rclpy does not say which publisher a message is from. The gaps are then counted
    while there is one publisher, and the same one before and after the gap.

    Parameters
    ----------
    publishers : callable
        Returns the identifiers of the publishers on the topic.

    Attributes
    ----------
    lost : int
        Messages lost so far, including those that a newer one replaced in a full queue of the
        middleware.
    unknown : str
        Why losses cannot be counted at present; empty if they can.
    """

    def __init__(self, publishers: Callable[[], frozenset[Hashable]]) -> None:
        self._publishers = publishers
        self._last: dict[str, tuple[int, int]] = {}
        self._before_pause: set[str] = set()
        self._known: frozenset[Hashable] = frozenset()
        self._told = 0
        self.lost = 0
        self.unknown = ''

    def pause(self) -> None:
        """Do not count what is missed from now on until the next message of each publisher."""
        self._before_pause = set(self._last)
        self._known = frozenset()

    def add(self, information: Mapping[str, Any]) -> bool:
        """Count what was lost before a message; return whether the message is a new one.

        A subscription that takes the place of another one may get the last message again.

        Parameters
        ----------
        information : mapping of str to value
            What rclpy knows about the message.
        """
        number, sent = information.get(NUMBER) or 0, information.get(SENT) or 0
        if not number:
            self.unknown = 'the middleware does not number messages'
            return True
        sender = information.get(SENDER)
        before = self._last.pop(str(sender), None)
        self._last[str(sender)] = number, sent
        if sent and before == (number, sent):
            return False
        if len(self._last) > SENDERS:
            del self._last[next(iter(self._last))]
        paused = str(sender) in self._before_pause
        self._before_pause.discard(str(sender))
        gap = number - before[0] - 1 if before and not paused else -1
        if sender is not None:
            self.unknown = ''
            self.lost += max(gap, 0)
        elif gap or self.unknown:
            self.lost += max(gap, 0) if self._from_one() else 0
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

    Parameters
    ----------
    node : rclpy.node.Node
        Subscribes.
    kind : type
        Type of the messages.
    topic : str
        Name of the topic, before remapping.
    callback : callable
        Called with every message.
    group : CallbackGroup, optional
        Group of the callback.
    lossless : bool
        Whether every message is kept until it is taken. The callback must take each at once.
    opened : bool
        Whether to subscribe now.

    Attributes
    ----------
    topic, name : str
        Name of the topic, before and after remapping.
    overrides : str
        Where the names of its overrides begin.
    profile : QoSProfile
        Quality of service of the subscription.
    losses : Losses
        Messages lost in transport.
    arrived : float
        When the last message arrived, or the subscription began, s of the monotonic clock.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        callback: Callable[[Any], None],
        group: CallbackGroup | None = None,
        lossless: bool = False,
        opened: bool = True,
    ) -> None:
        self._node = node
        self.kind = kind
        self.name: str = node.resolve_topic_name(topic)
        self.topic = topic
        self._callback = callback
        self._group = group
        self._lossless = lossless
        end = LOSSLESS_SUBSCRIPTION if lossless else SUBSCRIPTION
        self.overrides = f'qos_overrides.{self.name}.{end}'
        self._values = declare_qos(node, end, topic)
        self._lock = threading.Lock()
        self.losses = Losses(self._identifiers)
        self.arrived = time.monotonic()
        self.profile = qos_profile(self._values)
        self._subscription: Subscription | None = None
        if opened:
            self.open()

    @property
    def type_name(self) -> str:
        """Name of the type of the messages."""
        return f'{self.kind.__module__.split(".")[0]}/msg/{self.kind.__name__}'

    def open(self) -> None:
        """Subscribe."""
        with self._lock:
            if self._subscription:
                return
            self.arrived = time.monotonic()
            self.profile = qos_profile(self._values, self._offered())
            self._subscription = self._subscribe()
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
        found: list[TopicEndpointInfo] = self._node.get_publishers_info_by_topic(self.name)
        return found

    def follow(self) -> None:
        """Subscribe anew if the publishers now offer another quality of service."""
        offered = self._offered()
        with self._lock:
            profile = qos_profile(self._values, offered)
            if not offered or not self._subscription or profile == self.profile:
                return
            self._node.destroy_subscription(self._subscription)
            self.profile = profile
            self._subscription = self._subscribe()
        self._report()

    def _offered(self) -> list[QoSProfile]:
        return [it.qos_profile for it in self.publishers() if it.topic_type == self.type_name]

    def _identifiers(self) -> frozenset[Hashable]:
        return frozenset(tuple(it.endpoint_gid) for it in self.publishers())

    def _subscribe(self) -> Subscription:
        # Without a callback of its own, rclpy warns that nothing will be received.
        events = SubscriptionEventCallbacks(incompatible_qos=lambda _: self.follow())
        take: Any = self._take
        return self._node.create_subscription(
            self.kind,
            self.topic,
            take,
            self.profile,
            callback_group=self._group,
            event_callbacks=events,
        )

    def _take(self, message: Any, information: Mapping[str, Any]) -> None:
        self.arrived = time.monotonic()
        if self.losses.add(information):
            self._callback(message)

    def _report(self) -> None:
        text = f'{self.name} is subscribed to as it is published, {qos_words(self.profile)}'
        if self.profile.reliability == ReliabilityPolicy.BEST_EFFORT:
            text += '; messages that get lost are not resent'
        self._node.get_logger().warning(text)
