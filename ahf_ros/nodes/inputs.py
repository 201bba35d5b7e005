"""Topics that a node subscribes to, as their publishers offer them."""

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

from ahf_ros.nodes.losses import Losses
from ahf_ros.nodes.qos import (
    LOSSLESS_SUBSCRIPTION,
    SUBSCRIPTION,
    declare_qos,
    qos_profile,
    qos_words,
)


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
