"""Topics and services of the embedded graph: publishers, subscriptions, clients and servers.

A client blocks while the server's own task answers.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from volery.base.errors import UsageError, VoleryError, choices, did_you_mean
from volery.base.time import Ns, to_seconds
from volery.kernel.waiting import Signal
from volery.ros.graph.callbacks import CallbackGroup
from volery.ros.graph.graph_context import (
    GraphContext,
    NodeContext,
    PublisherEnd,
    Recorded,
    ServiceEnd,
    SubscriptionEnd,
    Topic,
)
from volery.ros.graph.interface import (
    BEST_AVAILABLE,
    BEST_EFFORT,
    RELIABLE,
    TRANSIENT_LOCAL,
    VOLATILE,
    Callback,
    Handler,
    QoS,
    Route,
)
from volery.ros.graph.unserved import PUBLISHED, SERVICE, SUBSCRIBED
from volery.ros.graph.work import Work
from volery.ros.messages import cdr_size, message_class, service
from volery.ros.messages.encodings import abridged_cdr, copied_to_cdr, encoded_size
from volery.trace.events import NONE, WARNING, Call, Message, Omitted, Published, Text


def topic_named(graph: GraphContext, name: str, message_type: str, node: NodeContext) -> Topic:
    """Return the topic `name` of a type, created if necessary.

    As on real ROS, nodes of different types share a name and do not hear each other; a warning says so once.
    """
    full = message_class(message_type).__msgtype__
    found = graph.topics.get(name)
    if found is None:
        found = graph.topics[name] = Topic(name, full)
    elif found.type != full:
        other = found.others.get(full)
        if other is None:
            other = found.others[full] = Topic(name, full)
            users = [publisher.node.name for publisher in found.publishers] + [
                subscription.node.name for subscription in found.subscriptions
            ]
            of = ", ".join(dict.fromkeys(users)) or "no node any more"
            text = f"{name} carries {found.type} (of {of}), not {full}: these nodes do not hear each other"
            graph.record(Text(node.kernel.now(), node.name, WARNING, text))
        return other
    return found


_POLICIES = {
    "reliable": "RELIABILITY",
    "transient": "DURABILITY",
    "deadline": "DEADLINE",
    "liveliness": "LIVELINESS",
}
"""Words of ``incompatible`` and the name of the policy."""
_NO_SUBSCRIPTION = (
    "New subscription discovered on topic '{topic}', requesting incompatible QoS. No messages will be sent "
    "to it. Last incompatible policy: {policy}"
)
_NO_PUBLISHER = (
    "New publisher discovered on topic '{topic}', offering incompatible QoS. No messages will be received "
    "from it. Last incompatible policy: {policy}"
)
"""What rclpy logs."""


def incompatible(offered: QoS, requested: QoS) -> str:
    """Return why a publisher's QoS does not match a subscription's, by the rules of DDS; empty if it does."""
    if requested.reliability == RELIABLE and offered.reliability == BEST_EFFORT:
        return "reliable is wanted, best effort offered"
    if requested.durability == TRANSIENT_LOCAL and offered.durability == VOLATILE:
        return "transient local is wanted, volatile offered"
    if requested.deadline and not 0 < offered.deadline <= requested.deadline:
        return "a shorter deadline is wanted than offered"
    if requested.manual and not offered.manual:
        return "liveliness by topic is wanted, automatic offered"
    if requested.lease and not 0 < offered.lease <= requested.lease:
        return "a shorter lease of liveliness is wanted than offered"
    return ""


_LARGEST = {"nav_msgs/msg/OccupancyGrid": 1 << 20}
"""Bytes up to which long messages of a type are recorded with their content all the same.

A map is what a run was about; it is published seldom, and its cells pack well: to a sixteenth in
examples/mapping.
"""


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
        self._most = _LARGEST.get(topic.type, 0)
        self._checked = not node.graph.unrecorded  # whether messages are encoded, as real ROS does
        self._sized = False  # whether the size of a message matters otherwise
        self._spacing: Ns = 0  # shortest of the subscriptions', on a graph that takes the place of a link
        self._due: Ns = 0  # when the next message will be used
        self._open = True
        self._want = node.want(PUBLISHED, topic.name, topic.type)
        self.latest: Ns | None = None  # when the last message was sent
        self._on_change: Callable[[Connection, bool], None] | None = None
        topic.publishers.append(self)
        for subscription in topic.subscriptions:
            self.connect(subscription)

    def connect(self, subscription: SubscriptionEnd) -> None:
        """Connect a subscription and deliver latched (transient-local) messages."""
        graph, node, other = self.node.graph, self.node, subscription.node
        why = incompatible(self.qos, subscription.qos)
        if why:
            policy = next(name for word, name in _POLICIES.items() if word in why)
            for side, words in ((node, _NO_SUBSCRIPTION), (other, _NO_PUBLISHER)):
                text = f"{side.name}: {words.format(topic=self.topic, policy=policy)} ({why})"
                graph.record(Text(node.kernel.now(), side.context.component, WARNING, text))
            self._want.reason = f"{other.name} does not receive it: {why}"
            subscription.want.reason = f"nothing comes from {node.name}: {why}"
            return
        self._want.met = subscription.want.met = True
        route = graph.route(node.id, other.id)
        if route is None:
            connection = Connection(subscription, subscription.arrive)
        else:
            reliable = BEST_EFFORT not in (self.qos.reliability, subscription.qos.reliability)
            connection = Connection(subscription, _over(route, reliable, subscription))
            self._sized = True
        self._connections.append(connection)
        self._set_spacing()
        if other is not node:
            node.charge_background("accept")
            other.charge_background("connect")
        if self._latches and subscription.qos.durability in (TRANSIENT_LOCAL, BEST_AVAILABLE):
            for content, sent, size in self._latched:
                if self.qos.lifespan and node.kernel.now() > sent + self.qos.lifespan:
                    continue
                connection.deliver(content.copy(), sent, node.name, size)
        if self._on_change is not None:
            self._on_change(connection, True)

    def disconnect(self, subscription: SubscriptionEnd) -> None:
        """Stop sending to a subscription."""
        ended = [connection for connection in self._connections if connection.to is subscription]
        self._connections = [
            connection for connection in self._connections if connection.to is not subscription
        ]
        self._set_spacing()
        if self._on_change is not None:
            for connection in ended:
                self._on_change(connection, False)

    def watch(self, on_change: Callable[[Connection, bool], None]) -> None:
        """Call *on_change* with each connection, also those there are, and whether it begins or ends."""
        self._on_change = on_change
        for connection in self._connections:
            on_change(connection, True)

    def _set_spacing(self) -> None:
        graph, self._due = self.node.graph, 0
        if graph.unrecorded and not graph.as_bytes:
            self._spacing = min((connection.to.qos.spacing for connection in self._connections), default=0)

    def publish(self, message: Any) -> None:
        """Send a copy of `message` as it is when the call has been served."""
        node = self.node
        with node.kernel.interact():
            if not self._open:
                raise UsageError(f"node {node.name}: its publisher of {self.topic} is closed")
            if not isinstance(message, self._class):
                kind = getattr(message, "__msgtype__", "") or f"a {type(message).__name__}"
                raise UsageError(f"topic {self.topic} carries {self.type}, not {kind}")
            self.send(message, node.consume("publish", float(len(self._connections))))

    def publish_to(self, connection: Connection, message: Any) -> None:
        """Send a message over one connection only."""
        node = self.node
        with node.kernel.interact():
            sent = node.consume("publish", 1.0)
            content = message.copy()
            size = self._record(content, sent) if self._recorded else encoded_size(content)
            connection.deliver(content, sent, node.name, size)

    def _record(self, content: Any, sent: Ns) -> int:
        """Record a message and return its size, bytes."""
        node = self.node
        data, missing = abridged_cdr(content)
        size = len(data) + missing
        if missing and size > self._most and self._recorded < Recorded.ALL:
            node.kernel.record(Omitted(sent, self.topic, self.type, node.name, size))
        else:
            whole = copied_to_cdr(content) if missing else bytes(data)
            node.kernel.record(Published(sent, self.topic, self.type, node.name, whole))
        return size

    @property
    def connected(self) -> int:
        """Number of connections, without being an interaction point."""
        return len(self._connections)

    def send(self, message: Any, sent: Ns, *, fresh: bool = False) -> None:
        """Send a message whose call has been executed; a `fresh` one was made for this call by the framework.

        A message of others is encoded even if nothing needs its bytes: real ROS finds values that do not fit.
        """
        node, connections = self.node, self._connections
        if not connections:
            self._want.count += 1
        if not (connections or self._latches or self._recorded or (self._checked and not fresh)):
            return
        if node.graph.as_bytes:
            content = node.graph.copy(message)
        else:
            content = message.converted() if fresh else message.copy()
        size = 0
        if self._recorded:
            size = self._record(content, sent)
        elif self._checked and not fresh:
            size = encoded_size(content)
        elif self._checked or self._sized:
            size = node.graph.size_of(content)
        self._due = sent + self._spacing
        self.latest = sent
        if self._latches:
            self._latched.append((content.copy(), sent, size))
        single = len(connections) == 1
        for connection in connections:
            connection.deliver(content if single else content.copy(), sent, node.name, size)

    def subscribers(self) -> int:
        """Return the number of subscriptions it is connected to."""
        with self.node.kernel.interact():
            return len(self._connections)

    def counterparts(self) -> list[SubscriptionEnd]:
        """Return the subscriptions to the topic, whether they match or not."""
        return list(self._topic.subscriptions) if self._open else []

    def awaited_from(self) -> Ns:
        """Return the time from which a message will be used; see ``QoS.spacing``."""
        return self._due

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
        self._queue: deque[tuple[Any, str]] = deque()
        self.sender = ""  # node that sent the message whose callback runs
        self._run = self.run
        self._open = True
        self.want = node.want(SUBSCRIBED, topic.name, topic.type)
        self.latest: Ns | None = None  # when the last message arrived
        self.lost = 0
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
        node.charge_background("receive")
        self.latest = now
        queue = self._queue
        if len(queue) == self.qos.depth:
            queue.popleft()  # its turn in the group goes to the next oldest
            self.dropped += 1
            queue.append((message, publisher))
        else:
            queue.append((message, publisher))
            self._group.add(Work(now, self._run))

    def lose(self, sent: Ns, publisher: str, size: int) -> None:
        """Record that a message was lost. A framework callback."""
        self.lost += 1
        self.node.graph.record(Message(sent, NONE, self.topic, publisher, self.node.name, size))

    def run(self) -> None:
        """Call back with the oldest message."""
        if self._queue:
            message, self.sender = self._queue.popleft()
            self._callback(message)

    def latest_sender(self) -> tuple[str, bool]:
        """Return nothing: what publishers offer is known of the topic."""
        return "", False

    def publishers(self) -> int:
        """Return the number of publishers it is connected to."""
        with self.node.kernel.interact():
            return sum(1 for publisher in self._topic.publishers if not incompatible(publisher.qos, self.qos))

    def counterparts(self) -> list[PublisherEnd]:
        """Return the publishers of the topic, whether they match or not."""
        return list(self._topic.publishers) if self._open else []

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


HANDLER_FAILED = "its handler "
NO_SERVER = "no node serves it"
"""Beginning of the problem of a call that the server has failed."""
ROSPY_FAILED = "responded with an error"
"""Part of the same problem in the words of rospy's client."""


class CallFailedError(Exception):
    """Raised by a handler to fail the call, as a handler of roscpp that returns false; nothing else fails."""


class ServiceError(VoleryError):
    """A service call failed: there is no server, its handler raised, or no answer came in time.

    Attributes:
        service: Name of the service.
        what: What happened.
        by_server: Whether the server itself has ended the call with an error.
        no_server: Whether no node served it.
    """

    def __init__(self, name: str, what: str) -> None:
        self.service, self.what = name, what
        self.by_server = what.startswith(HANDLER_FAILED) or ROSPY_FAILED in what
        self.no_server = what.startswith(NO_SERVER)
        super().__init__(f"service {name}: {what}")


def failure_text(error: Exception) -> str:
    """Return the problem of a call whose handler has raised *error*."""
    if isinstance(error, CallFailedError):
        return f"{HANDLER_FAILED}failed the call: {error}"
    return f"{HANDLER_FAILED}raised {type(error).__name__}: {error}"


class ServiceExchange:
    """A request and its answer, in transit."""

    __slots__ = ("answer", "answered", "caller", "problem", "request")

    def __init__(self, caller: NodeContext, request: Any, name: str) -> None:
        self.caller, self.request = caller, request
        self.answer: Any = None
        self.problem = ""
        self.answered = Signal(caller.kernel, f"service {name} (answer)")

    def done(self) -> bool:
        """Return whether the call has ended, with an answer or a problem."""
        return self.answer is not None or bool(self.problem)

    def succeed(self, answer: Any) -> None:
        """End the call with an answer. A framework callback."""
        self.answer = answer
        self.answered.notify()

    def fail(self, problem: str) -> None:
        """End the call without an answer. A framework callback."""
        self.problem = self.problem or problem
        self.answered.notify()


class EmbeddedService:
    """See ``volery.ros.graph.interface.Service``."""

    def __init__(
        self, node: NodeContext, name: str, service_type: str, handler: Handler, group: CallbackGroup
    ) -> None:
        kind = service(service_type)
        other = node.graph.services.get(name)
        if other is not None:
            raise UsageError(f"node {node.name}: service {name} is served by {other.node.name} already")
        self.node = node
        self.name, self.type = name, kind.name
        self._kind = kind
        self._handler, self._group = handler, group
        self._pending: list[ServiceExchange] = []
        self.caller = ""  # node that sent the request whose handler begins
        node.graph.services[name] = self
        node.graph.wants.served[name] = self.type

    def arrive(self, exchange: ServiceExchange) -> None:
        """Queue a request that has arrived. A framework callback."""
        if self.node.graph.services.get(self.name) is not self:
            self._send_back(exchange, exchange.fail, "its server has gone", 0)
            return
        self._pending.append(exchange)
        self._group.add(Work(self.node.kernel.now(), partial(self.answer, exchange)))

    def answer(self, exchange: ServiceExchange) -> None:
        """Run the handler and send the answer; an exception is reported to the caller and raised again."""
        if exchange not in self._pending:
            return
        with self.node.kernel.interact():
            self.node.consume_if_priced("serve")
        self.caller = exchange.caller.name
        try:
            answer = self._handler(exchange.request)
            if not isinstance(answer, self._kind.response):
                raise UsageError(
                    f"the handler of {self.name} returned {answer!r}, not a {self.type} response"
                )
            with self.node.kernel.interact():
                content = self.node.graph.copy(answer)
                size = cdr_size(content)
        except Exception as error:
            with self.node.kernel.interact():
                self._pending.remove(exchange)
                self._send_back(exchange, exchange.fail, failure_text(error), 0)
            if not isinstance(error, CallFailedError):
                raise
            return
        with self.node.kernel.interact():
            self._pending.remove(exchange)
            self._send_back(exchange, exchange.succeed, content, size)

    def _send_back(
        self, exchange: ServiceExchange, end: Callable[[Any], None], content: Any, size: int
    ) -> None:
        lost = partial(exchange.fail, "the answer was lost on the way")
        self.node.graph.carry(self.node, exchange.caller, size, partial(end, content), lost)

    def close(self) -> None:
        """Stop serving; pending calls fail."""
        graph = self.node.graph
        with graph.kernel.guard:
            if graph.services.get(self.name) is self:
                del graph.services[self.name]
                for exchange in self._pending:
                    exchange.fail("its server has gone")
                self._pending.clear()
                graph.changed.notify()


class EmbeddedClient:
    """See ``interface.Client``. The wait for the answer belongs to the caller's activation."""

    def __init__(self, node: NodeContext, name: str, service_type: str) -> None:
        self.name = name
        self._kind = service(service_type)
        self.type = self._kind.name
        self._node = node

    def call(self, request: Any, within: Ns | None = None) -> Any:
        """Block until the answer has arrived; raise ``ServiceError`` if there is none."""
        node = self._node
        kernel = node.kernel
        with kernel.interact():
            start = kernel.now()
            server = self._server(request)
            node.consume_if_priced("call_service")
            exchange = ServiceExchange(node, node.graph.copy(request), self.name)
            node.graph.carry(
                node,
                server.node,
                cdr_size(exchange.request),
                partial(server.arrive, exchange),
                partial(exchange.fail, "the request was lost on the way"),
            )
            if not exchange.answered.wait_for(exchange.done, within):
                exchange.fail(f"no answer within {to_seconds(within or 0):g} s")
            callee, caller = server.node.id.component, node.id.component
            outcome = "ServiceError" if exchange.problem else "ok"
            kernel.record(Call(start, kernel.now(), caller, callee, self.name, outcome))
        if exchange.problem:
            raise ServiceError(self.name, exchange.problem)
        return exchange.answer

    def _server(self, request: Any) -> ServiceEnd:
        if not isinstance(request, self._kind.request):
            raise UsageError(f"service {self.name} takes a {self._kind.request.__msgtype__}, not {request!r}")
        services = self._node.graph.services
        server = services.get(self.name)
        if server is None:
            self._node.want(SERVICE, self.name, self.type).count += 1
            hint = did_you_mean(self.name, services)
            raise ServiceError(self.name, f"{NO_SERVER}{hint}; there is {choices(services)}")
        if server.type != self.type:
            raise ServiceError(self.name, f"{server.node.name} serves it as {server.type}, not {self.type}")
        return server

    def wait(self, within: Ns | None = None) -> bool:
        """Block until a node serves it; return False if `within` ns have passed first."""
        return self._node.graph.changed.wait_for(self.ready_now, within)

    def ready(self) -> bool:
        """Return whether a node serves it now."""
        with self._node.kernel.interact():
            return self.ready_now()

    def ready_now(self) -> bool:
        """Return whether a node serves it now, without being an interaction point."""
        if self.name in self._node.graph.services:
            return True
        self._node.want(SERVICE, self.name, self.type)
        return False
