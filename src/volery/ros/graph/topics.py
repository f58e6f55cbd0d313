"""Topics: publishers, subscriptions, who is connected to whom, and what travels."""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.graph.callbacks import CallbackGroup, Work
from volery.ros.graph.graph_context import GraphContext, NodeContext
from volery.ros.graph.interface import (
    BEST_AVAILABLE,
    BEST_EFFORT,
    RELIABLE,
    TRANSIENT_LOCAL,
    VOLATILE,
    Callback,
    QoS,
    Route,
)
from volery.ros.messages import Message as Value
from volery.ros.messages import cdr_size, message_class
from volery.ros.messages.cdr import copied_to_cdr
from volery.trace.events import NONE, Message, Published, Text

WARNING = 4
"""Severity, as in syslog."""


class Topic:
    """A name that publishers and subscriptions meet at."""

    __slots__ = ("name", "publishers", "subscriptions", "type")

    def __init__(self, name: str, message_type: str) -> None:
        self.name, self.type = name, message_type
        self.publishers: list[EmbeddedPublisher] = []
        self.subscriptions: list[EmbeddedSubscription] = []


def topic(context: GraphContext, name: str, message_type: str, member: NodeContext) -> Topic:
    """The topic of that name, made if need be; ``UsageError`` if it carries another type."""
    full = message_class(message_type).__msgtype__
    found = context.topics.get(name)
    if found is None:
        found = context.topics[name] = Topic(name, full)
    elif found.type != full:
        users = [one.member.name for one in found.publishers]
        users += [one.member.name for one in found.subscriptions]
        raise UsageError(
            f"node {member.name}: topic {name} carries {found.type} (of {', '.join(users)}), not {full}"
        )
    return found


def incompatible(offered: QoS, wanted: QoS) -> str:
    """Why a publisher cannot serve a subscription, by the rules of DDS; empty if it can."""
    if wanted.reliability == RELIABLE and offered.reliability == BEST_EFFORT:
        return "reliable is wanted, best effort offered"
    if wanted.durability == TRANSIENT_LOCAL and offered.durability == VOLATILE:
        return "transient local is wanted, volatile offered"
    return ""


class Connection(NamedTuple):
    """A publisher's connection to a subscription: the way there (``None``: they are in one place), and
    whether what is lost on it is sent again.
    """

    to: EmbeddedSubscription
    way: Route | None
    reliable: bool


class EmbeddedPublisher:
    """See ``volery.ros.graph.interface.Publisher``."""

    def __init__(self, member: NodeContext, at: Topic, qos: QoS) -> None:
        self.member, self.qos = member, qos
        self.topic, self.type = at.name, at.type
        self._context = member.context
        self._at = at
        self._class = message_class(at.type)
        self._targets: list[Connection] = []
        self._kept: deque[tuple[Any, Ns, int]] = deque(maxlen=qos.depth)
        self._keeps = qos.durability == TRANSIENT_LOCAL
        self._recorded = member.context.records(at.name)
        self._weighed = not member.context.unrecorded  # whether somebody asks for the size of what is sent
        self._open = True
        at.publishers.append(self)
        for subscription in at.subscriptions:
            self.connect(subscription)

    def connect(self, subscription: EmbeddedSubscription) -> None:
        """Serve a subscription from now on, with what is kept for those who come late."""
        why = incompatible(self.qos, subscription.qos)
        if why:
            text = f"{self.topic}: {subscription.member.name} does not hear {self.member.name}: {why}"
            self._context.record(Text(self._context.kernel.now(), self.member.name, WARNING, text))
            return
        way = self._context.between(self.member.id, subscription.member.id)
        reliable = BEST_EFFORT not in (self.qos.reliability, subscription.qos.reliability)
        connection = Connection(subscription, way, reliable)
        self._targets.append(connection)
        self._weighed = self._weighed or way is not None
        if subscription.member is not self.member:
            self.member.bear("accept")
            subscription.member.bear("connect")
        if self._keeps and subscription.qos.durability in (TRANSIENT_LOCAL, BEST_AVAILABLE):
            for content, sent, size in self._kept:
                self._send(connection, content.copy(), sent, size)

    def disconnect(self, subscription: EmbeddedSubscription) -> None:
        """Serve it no longer."""
        self._targets = [one for one in self._targets if one.to is not subscription]

    def publish(self, message: Any) -> None:
        """Send a copy of *message* as it is when the call has been paid."""
        context = self._context
        with context.kernel as kernel:
            if not self._open:
                raise UsageError(f"node {self.member.name}: its publisher of {self.topic} is closed")
            if not isinstance(message, self._class):
                raise UsageError(f"topic {self.topic} carries {self.type}, not {_type_of(message)}")
            self.member.pay("publish", float(len(self._targets)))
            if not (self._targets or self._recorded or self._keeps):
                return
            content = context.sent(message)
            sent = kernel.now()
            size = self._record(content, sent)
            if self._keeps:
                self._kept.append((content.copy(), sent, size))
            targets = self._targets
            if len(targets) == 1:
                self._send(targets[0], content, sent, size)
            else:
                for target in targets:
                    self._send(target, content.copy(), sent, size)

    def _record(self, content: Value, sent: Ns) -> int:
        """Record what is sent, where that is wanted; returns its size in bytes."""
        if not self._recorded:
            return cdr_size(content) if self._weighed else 0
        data = copied_to_cdr(content)
        self._context.record(Published(sent, self.topic, self.type, self.member.name, data))
        return len(data)

    def _send(self, target: Connection, content: Any, sent: Ns, size: int) -> None:
        subscription, way, reliable = target
        name = self.member.name
        if way is None:
            subscription.arrive(content, sent, name, size)
            return
        way(
            size,
            reliable,
            partial(subscription.arrive, content, sent, name, size),
            partial(subscription.lose, sent, name, size),
        )

    def subscribers(self) -> int:
        """How many subscriptions it is connected to."""
        with self._context.kernel:
            return len(self._targets)

    def close(self) -> None:
        """Advertise no longer."""
        with self._context.kernel.guard:
            if self._open:
                self._open = False
                self._targets = []
                self._at.publishers.remove(self)
                self._context.changed.notify()


def _type_of(message: object) -> str:
    return getattr(message, "__msgtype__", "") or f"a {type(message).__name__}"


class EmbeddedSubscription:
    """See ``volery.ros.graph.interface.Subscription``. ``dropped`` counts messages that its full queue gave up."""

    def __init__(
        self, member: NodeContext, at: Topic, callback: Callback, qos: QoS, group: CallbackGroup
    ) -> None:
        self.member, self.qos = member, qos
        self.topic, self.type = at.name, at.type
        self.dropped = 0
        self._context = member.context
        self._at = at
        self._callback = callback
        self._group = group
        self._queue: deque[Any] = deque()
        self._run = self.run
        self._open = True
        at.subscriptions.append(self)
        for publisher in at.publishers:
            publisher.connect(self)

    def arrive(self, message: Any, sent: Ns, publisher: str, size: int) -> None:
        """A message is there. House code."""
        if not self._open:
            return
        now = self._context.kernel.now()
        if not self._context.unrecorded:
            self._context.record(Message(sent, now, self.topic, publisher, self.member.name, size))
        self.member.bear("receive")
        queue = self._queue
        if len(queue) == self.qos.depth:
            queue.popleft()  # its place in the group goes to the next oldest
            self.dropped += 1
            queue.append(message)
        else:
            queue.append(message)
            self._group.add(Work(now, self._run))

    def lose(self, sent: Ns, publisher: str, size: int) -> None:
        """A message was lost on the way. House code."""
        self._context.record(Message(sent, NONE, self.topic, publisher, self.member.name, size))

    def run(self) -> None:
        """Call back with the oldest message."""
        if self._queue:
            self._callback(self._queue.popleft())

    def publishers(self) -> int:
        """How many publishers it is connected to."""
        with self._context.kernel:
            return sum(1 for publisher in self._at.publishers if not incompatible(publisher.qos, self.qos))

    def close(self) -> None:
        """Receive no longer; what still waits is forgotten."""
        with self._context.kernel.guard:
            if self._open:
                self._open = False
                self._queue.clear()
                self._at.subscriptions.remove(self)
                for publisher in self._at.publishers:
                    publisher.disconnect(self)
                self._context.changed.notify()
