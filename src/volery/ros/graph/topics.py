"""Topics of the embedded graph: publishers, subscriptions, and the messages between them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.graph.callbacks import CallbackGroup
from volery.ros.graph.graph_context import GraphContext, NodeContext, SubscriptionEnd, Topic
from volery.ros.graph.interface import (
    BEST_AVAILABLE,
    BEST_EFFORT,
    RELIABLE,
    TRANSIENT_LOCAL,
    VOLATILE,
    Callback,
    QoS,
    Route,
    Work,
)
from volery.ros.messages import cdr_size, message_class
from volery.ros.messages.cdr import copied_to_cdr
from volery.trace.events import NONE, Message, Published, Text

WARNING = 4
"""Severity, as in syslog."""


def topic_named(graph: GraphContext, name: str, message_type: str, node: NodeContext) -> Topic:
    """Return the topic `name`, created if necessary.

    Raises:
        UsageError: the topic carries another type.
    """
    full = message_class(message_type).__msgtype__
    found = graph.topics.get(name)
    if found is None:
        found = graph.topics[name] = Topic(name, full)
    elif found.type != full:
        users = [publisher.node.name for publisher in found.publishers]
        users += [subscription.node.name for subscription in found.subscriptions]
        raise UsageError(
            f"node {node.name}: topic {name} carries {found.type} (of {', '.join(users)}), not {full}"
        )
    return found


def incompatible(offered: QoS, requested: QoS) -> str:
    """Return why a publisher's QoS does not match a subscription's, by the rules of DDS; empty if it does."""
    if requested.reliability == RELIABLE and offered.reliability == BEST_EFFORT:
        return "reliable is wanted, best effort offered"
    if requested.durability == TRANSIENT_LOCAL and offered.durability == VOLATILE:
        return "transient local is wanted, volatile offered"
    return ""


class Connection(NamedTuple):
    """A publisher's connection to a subscription; ``deliver(message, sent, publisher, size)``."""

    to: SubscriptionEnd
    deliver: Callable[[Any, Ns, str, int], None]


def _over(route: Route, reliable: bool, to: SubscriptionEnd) -> Callable[[Any, Ns, str, int], None]:
    """Return what delivers messages over a network; a loss is repeated if the connection is `reliable`."""

    def deliver(content: Any, sent: Ns, publisher: str, size: int) -> None:
        arrive, lose = (
            partial(to.arrive, content, sent, publisher, size),
            partial(to.lose, sent, publisher, size),
        )
        route(size, reliable, arrive, lose)

    return deliver


class EmbeddedPublisher:
    """See ``volery.ros.graph.interface.Publisher``."""

    def __init__(self, node: NodeContext, topic: Topic, qos: QoS) -> None:
        self.node, self.qos = node, qos
        self.topic, self.type = topic.name, topic.type
        self._topic = topic
        self._class = message_class(topic.type)
        self._connections: list[Connection] = []
        self._latches = qos.durability == TRANSIENT_LOCAL
        self._latched: deque[tuple[Any, Ns, int]] = deque(maxlen=qos.depth)
        self._recorded = node.graph.records(topic.name)
        self._sized = not node.graph.unrecorded  # whether the size of a message matters
        self._open = True
        topic.publishers.append(self)
        for subscription in topic.subscriptions:
            self.connect(subscription)

    def connect(self, subscription: SubscriptionEnd) -> None:
        """Connect a subscription and deliver latched (transient-local) messages."""
        graph, node, other = self.node.graph, self.node, subscription.node
        why = incompatible(self.qos, subscription.qos)
        if why:
            text = f"{self.topic}: {other.name} does not hear {node.name}: {why}"
            graph.record(Text(node.kernel.now(), node.name, WARNING, text))
            return
        route = graph.route(node.id, other.id)
        if route is None:
            connection = Connection(subscription, subscription.arrive)
        else:
            reliable = BEST_EFFORT not in (self.qos.reliability, subscription.qos.reliability)
            connection = Connection(subscription, _over(route, reliable, subscription))
            self._sized = True
        self._connections.append(connection)
        if other is not node:
            node.charge_background("accept")
            other.charge_background("connect")
        if self._latches and subscription.qos.durability in (TRANSIENT_LOCAL, BEST_AVAILABLE):
            for content, sent, size in self._latched:
                connection.deliver(content.copy(), sent, node.name, size)

    def disconnect(self, subscription: SubscriptionEnd) -> None:
        """Stop sending to a subscription."""
        self._connections = [one for one in self._connections if one.to is not subscription]

    def publish(self, message: Any) -> None:
        """Send a copy of `message` as it is when the call has been served."""
        node = self.node
        with node.kernel as kernel:
            if not self._open:
                raise UsageError(f"node {node.name}: its publisher of {self.topic} is closed")
            if not isinstance(message, self._class):
                kind = getattr(message, "__msgtype__", "") or f"a {type(message).__name__}"
                raise UsageError(f"topic {self.topic} carries {self.type}, not {kind}")
            node.consume("publish", float(len(self._connections)))
            connections = self._connections
            if not (connections or self._recorded or self._latches):
                return
            content = node.graph.copy(message) if node.graph.as_bytes else message.copy()
            sent, size = kernel.now(), 0
            if self._recorded:
                data = copied_to_cdr(content)
                size = len(data)
                kernel.record(Published(sent, self.topic, self.type, node.name, data))
            elif self._sized:
                size = cdr_size(content)
            if self._latches:
                self._latched.append((content.copy(), sent, size))
            single = len(connections) == 1
            for connection in connections:
                connection.deliver(content if single else content.copy(), sent, node.name, size)

    def subscribers(self) -> int:
        """Return the number of subscriptions it is connected to."""
        with self.node.kernel:
            return len(self._connections)

    def close(self) -> None:
        """Stop publishing."""
        with self.node.kernel.guard:
            if self._open:
                self._open = False
                self._connections = []
                self._topic.publishers.remove(self)
                self.node.graph.changed.notify()


class EmbeddedSubscription:
    """See ``interface.Subscription``. ``dropped`` counts messages that a full queue dropped."""

    def __init__(
        self, node: NodeContext, topic: Topic, callback: Callback, qos: QoS, group: CallbackGroup
    ) -> None:
        self.node, self.qos = node, qos
        self.topic, self.type = topic.name, topic.type
        self.dropped = 0
        self._topic = topic
        self._callback = callback
        self._group = group
        self._queue: deque[Any] = deque()
        self._run = self.run
        self._open = True
        topic.subscriptions.append(self)
        for publisher in topic.publishers:
            publisher.connect(self)

    def arrive(self, message: Any, sent: Ns, publisher: str, size: int) -> None:
        """Queue a message that has arrived. A framework callback."""
        if not self._open:
            return
        node, kernel = self.node, self.node.kernel
        now = kernel.now()
        if not node.graph.unrecorded:
            kernel.record(Message(sent, now, self.topic, publisher, node.name, size))
        if node.processor is not None:
            node.charge_reception(now)
        queue = self._queue
        if len(queue) == self.qos.depth:
            queue.popleft()  # its turn in the group goes to the next oldest
            self.dropped += 1
            queue.append(message)
        else:
            queue.append(message)
            self._group.add(Work(now, self._run))

    def lose(self, sent: Ns, publisher: str, size: int) -> None:
        """Record that a message was lost. A framework callback."""
        self.node.graph.record(Message(sent, NONE, self.topic, publisher, self.node.name, size))

    def run(self) -> None:
        """Call back with the oldest message."""
        if self._queue:
            self._callback(self._queue.popleft())

    def publishers(self) -> int:
        """Return the number of publishers it is connected to."""
        with self.node.kernel:
            return sum(1 for publisher in self._topic.publishers if not incompatible(publisher.qos, self.qos))

    def close(self) -> None:
        """Stop receiving and drop the waiting messages."""
        with self.node.kernel.guard:
            if self._open:
                self._open = False
                self._queue.clear()
                self._topic.subscriptions.remove(self)
                for publisher in self._topic.publishers:
                    publisher.disconnect(self)
                self.node.graph.changed.notify()
