"""Nodes of the transports, with their publishers, subscriptions, services and clients.

Names, groups, timers and time are those of the embedded graph's nodes; everything that concerns other nodes
goes to the client library. Calls take the time that they take: they are interaction points but are not
priced.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from volery.base.errors import UsageError
from volery.base.time import Ns, to_seconds
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import Signal
from volery.ros.graph.callbacks import CallbackGroup
from volery.ros.graph.embedded_graph import LocalNode
from volery.ros.graph.endpoints import CallFailedError, ServiceError, failure_text
from volery.ros.graph.graph_context import GraphContext, NodeContext
from volery.ros.graph.interface import (
    AS_OFFERED,
    DEFAULT,
    Callback,
    Handler,
    Node,
    QoS,
    ReadyCallbacks,
    full_node_name,
)
from volery.ros.graph.unserved import PUBLISHED, SERVICE, SUBSCRIBED
from volery.ros.graph.work import Work
from volery.ros.messages import RosMessage, ServiceType, message_class, service
from volery.ros.messages.encodings import copied_to_cdr
from volery.ros.transports.client_library import (
    LibraryClient,
    LibraryNode,
    LibraryPublisher,
    LibraryService,
    LibrarySubscription,
    OnResponse,
    ReceivedMessage,
    poll_in_thread,
    run_in_thread,
)
from volery.trace.events import WARNING, Call, Published, Text
from volery.trace.events import Message as MessageEvent

if TYPE_CHECKING:

    def _is_a(node: TransportNode) -> Node:
        """Let the type checker verify that the class implements the protocol."""
        return node


T = TypeVar("T")


class TransportPublisher:
    """See ``volery.ros.graph.interface.Publisher``."""

    def __init__(self, node: NodeContext, topic: str, message_type: str, publisher: LibraryPublisher) -> None:
        self.node = node
        self._class = message_class(message_type)
        self.topic, self.type = topic, self._class.__msgtype__
        self._publisher = publisher
        self._recorded = node.graph.records(topic)
        self._open = True
        self._want = node.want(PUBLISHED, self.topic, self.type)

    def notice(self) -> None:
        """Note whether a node takes the topic."""
        if not self._want.met and self._open:
            self._want.met = self._publisher.connected() > 0

    def publish(self, message: Any) -> None:
        """Send a copy of `message` as it is now."""
        node = self.node
        kernel = node.kernel
        with kernel.interact():
            if not self._open:
                node.check_open()
                raise UsageError(f"node {node.name}: its publisher of {self.topic} is closed")
            if not isinstance(message, self._class):
                kind = getattr(message, "__msgtype__", "") or f"a {type(message).__name__}"
                raise UsageError(f"topic {self.topic} carries {self.type}, not {kind}")
            data = copied_to_cdr(message.copy())
            if self._recorded:
                kernel.record(Published(kernel.now(), self.topic, self.type, node.name, data))
            self._publisher.send(data)
            if not self._want.met:
                self._want.count += 1

    def subscribers(self) -> int:
        """Return the number of subscriptions it is connected to."""
        with self.node.kernel.interact():
            return self._publisher.connected() if self._open else 0

    def awaited_from(self) -> Ns:
        """Return 0: each message is used."""
        return 0

    def close(self) -> None:
        """Stop publishing."""
        if self._open:
            self._open = False
            self._publisher.close()


class TransportSubscription:
    """See ``volery.ros.graph.interface.Subscription``.

    Messages wait as bytes, at most as many as the depth of the QoS, and are decoded when the callback runs.
    ``dropped`` counts messages that a full queue dropped, ``garbled`` those that could not be decoded.
    """

    subscription: LibrarySubscription

    def __init__(
        self, node: NodeContext, topic: str, message_type: str, callback: Callback, group: CallbackGroup
    ) -> None:
        self.node = node
        self.topic, self.type = topic, message_class(message_type).__msgtype__
        self.dropped = self.garbled = 0
        self._callback, self._group = callback, group
        self._queue: deque[ReceivedMessage] = deque()
        self._depth: int | None = None
        self._guard = threading.Lock()
        self._announced = False  # `_admit` has been posted to the kernel
        self._sender = "", False
        self._works = 0  # callbacks in the group, one for each queued message that `_admit` has seen
        self._open = True
        self._want = node.want(SUBSCRIBED, self.topic, self.type)

    def notice(self) -> None:
        """Note whether a node gives the topic."""
        if not self._want.met and self._open:
            self._want.met = self.subscription.connected() > 0

    def connect(self, subscription: LibrarySubscription, qos: QoS) -> None:
        """Set the client library's subscription and the depth of the queue."""
        self.subscription, self._depth = subscription, qos.depth

    def arrive(self, received: ReceivedMessage) -> None:
        """Queue a message that has arrived. Called by a thread of the client library."""
        with self._guard:
            if not self._open:
                return
            if self._depth is not None and len(self._queue) >= self._depth:
                self._queue.popleft()
                self.dropped += 1
            self._queue.append(received)
            if self._announced:
                return
            self._announced = True
        self.node.kernel.post(self._admit)

    def _admit(self) -> None:
        node = self.node
        now = node.kernel.now()
        with self._guard:
            self._announced = False
            self._want.met = True
            fresh = list(self._queue)[self._works :]
            self._works += len(fresh)
        for received in fresh:
            size = len(received.data)
            node.kernel.record(MessageEvent(now, now, self.topic, received.publisher, node.name, size))
            self._group.add(Work(now, self.run))

    def run(self) -> None:
        """Call back with the oldest message."""
        with self._guard:
            self._works = max(0, self._works - 1)
            if not self._queue:
                return
            received = self._queue.popleft()
        self._sender = received.publisher, received.latched
        try:
            message = received.read(received.data)
        except UsageError as error:
            self.garbled += 1
            sender = received.publisher or "an unknown node"
            kernel = self.node.kernel
            with kernel.interact():
                text = f"{self.topic}: a message of {sender} dropped: {error}"
                kernel.record(Text(kernel.now(), self.node.name, WARNING, text))
            return
        self._callback(message)

    def latest_sender(self) -> tuple[str, bool]:
        """Return who sent the message whose callback runs, and whether it latches."""
        return self._sender

    def publishers(self) -> int:
        """Return the number of publishers it is connected to."""
        with self.node.kernel.interact():
            return self.subscription.connected() if self._open else 0

    def close(self) -> None:
        """Stop receiving and drop the waiting messages."""
        with self._guard:
            if not self._open:
                return
            self._open = False
            self._queue.clear()
        self.subscription.close()


class TransportService:
    """See ``volery.ros.graph.interface.Service``."""

    served: LibraryService

    def __init__(
        self, node: NodeContext, name: str, kind: ServiceType, handler: Handler, group: CallbackGroup
    ) -> None:
        self.node = node
        self.name, self.type = name, kind.name
        self._kind = kind
        self._handler, self._group = handler, group
        self._pending: list[OnResponse] = []
        self._open = True

    def request(self, request: RosMessage, respond: OnResponse) -> None:
        """Queue a request that has arrived. Called by a thread of the client library."""
        self.node.kernel.post(partial(self._queue, request, respond))

    def _queue(self, request: RosMessage, respond: OnResponse) -> None:
        if not self._open:
            respond(None, "its server has gone")
            return
        self._pending.append(respond)
        self._group.add(Work(self.node.kernel.now(), partial(self._answer, request, respond)))

    def _answer(self, request: RosMessage, respond: OnResponse) -> None:
        if respond not in self._pending:
            return
        try:
            answer = self._handler(request)
            if not isinstance(answer, self._kind.response):
                raise UsageError(
                    f"the handler of {self.name} returned {answer!r}, not a {self.type} response"
                )
            content = answer.copy()
        except Exception as error:
            self._end(respond, None, failure_text(error))
            if not isinstance(error, CallFailedError):
                raise
            return
        self._end(respond, content, "")

    def _end(self, respond: OnResponse, answer: RosMessage | None, problem: str) -> None:
        with self.node.kernel.guard:
            if respond in self._pending:
                self._pending.remove(respond)
                respond(answer, problem)

    def close(self) -> None:
        """Stop serving; pending calls fail."""
        if self._open:
            self._open = False
            self.served.close()
            for respond in list(self._pending):
                self._end(respond, None, "its server has gone")


class TransportClient:
    """See ``volery.ros.graph.interface.Client``."""

    def __init__(self, node: NodeContext, name: str, kind: ServiceType, client: LibraryClient) -> None:
        self.name, self.type = name, kind.name
        self._kind = kind
        self._node = node
        self._client = client

    def call(self, request: Any, within: Ns | None = None) -> Any:
        """Block until the answer has arrived; raise ``ServiceError`` if there is none."""
        self._node.check_open()
        if not isinstance(request, self._kind.request):
            raise UsageError(f"service {self.name} takes a {self._kind.request.__msgtype__}, not {request!r}")
        outcome: list[tuple[RosMessage | None, str]] = []
        answered = Signal(self._node.kernel, f"service {self.name} (answer)")

        def arrive(answer: RosMessage | None, problem: str) -> None:
            outcome.append((answer, problem))
            answered.notify()

        kernel = self._node.kernel
        with kernel.interact():
            start = kernel.now()
            give_up = self._client.call(request.copy(), lambda *end: kernel.post(partial(arrive, *end)))
            if not answered.wait_for(lambda: outcome, within):
                give_up()
                arrive(None, f"no answer within {to_seconds(within or 0):g} s")
            answer, problem = outcome[0]
            component, end = self._node.id.component, "ServiceError" if problem else "ok"
            kernel.record(Call(start, kernel.now(), component, "", self.name, end))
            want = self._node.want(SERVICE, self.name, self.type)
            want.met = want.met or not problem
        if problem:
            if not want.met and not self.ready():
                want.count += 1
            raise ServiceError(self.name, problem)
        return answer

    def wait(self, within: Ns | None = None) -> bool:
        """Block until a node serves it; return False if `within` ns have passed first."""
        want = self._node.want(SERVICE, self.name, self.type)
        return want.note(
            poll_in_thread(self._node.kernel, f"service {self.name}", self._client.ready, within)
        )

    def ready(self) -> bool:
        """Return whether a node serves it now."""
        want = self._node.want(SERVICE, self.name, self.type)
        return want.note(run_in_thread(self._node.kernel, f"service {self.name}", self._client.ready))

    def close(self) -> None:
        """Close the client library's client."""
        self._client.close()


class TransportNodeContext(NodeContext):
    """A `NodeContext` without prices; ``why`` is the reason for which the node was removed from the graph."""

    __slots__ = ("why",)

    def __init__(self, graph: GraphContext, name: str, context: ExecutionContext) -> None:
        super().__init__(graph, name, context)
        self.why = ""

    def consume(self, call: str, x: float = 0.0) -> Ns:
        """Be an interaction point; return the time."""
        self.kernel.consume(0)
        return self.kernel.now()

    def check_open(self) -> None:
        """Raise ``UsageError`` if the node has left the graph, with the reason if it was removed."""
        if self.closed:
            raise UsageError(f"node {self.name} has left the graph{f': {self.why}' if self.why else ''}")


class _ClosedWithNode(NamedTuple):
    close: Callable[[], None]


class TransportNode(LocalNode):
    """See ``volery.ros.graph.interface.Node``. Made by a transport's graph."""

    library: LibraryNode
    """The node of the client library."""

    def __init__(
        self,
        graph: GraphContext,
        name: str,
        namespace: str,
        remaps: Mapping[str, str],
        context: ExecutionContext,
    ) -> None:
        self._transport = TransportNodeContext(graph, full_node_name(name, namespace), context)
        super().__init__(self._transport, namespace, remaps)

    def join(self, library: LibraryNode) -> None:
        """Set the node of the client library, which has joined the graph."""
        self.library = library
        self._graph.changed.notify()

    def notice(self) -> None:
        """Note which of its topics have another side now."""
        for part in self._parts:
            if isinstance(part, (TransportPublisher, TransportSubscription)):
                part.notice()

    def close_with_node(self, close: Callable[[], None]) -> None:
        """Call `close` when the node is closed."""
        self._keep(_ClosedWithNode(close))

    def removed(self, why: str) -> None:
        """Close the node, which the graph has removed for the reason `why`. A framework callback."""
        self._transport.why = why
        self.close()

    def close(self) -> None:
        """Leave the graph."""
        if not self.closed:
            self.library.prepare_close()
        super().close()

    def _call(self, what: str, work: Callable[[], T]) -> T:
        """Execute a call of the client library that may block."""
        self._node.check_open()
        return run_in_thread(self._graph.kernel, f"{self.name}: {what}", work)

    def advertise(self, topic: str, message_type: str, qos: QoS = DEFAULT) -> TransportPublisher:
        """Publish to a topic."""
        full, kind = self.resolve(topic), message_class(message_type).__msgtype__
        publisher = self._call(f"advertise {full}", partial(self.library.advertise, full, kind, qos))
        return self._keep(TransportPublisher(self._node, full, kind, publisher))

    def subscribe(
        self,
        topic: str,
        message_type: str,
        callback: Callback,
        qos: QoS = AS_OFFERED,
        group: ReadyCallbacks | None = None,
    ) -> TransportSubscription:
        """Call `callback` with each message of a topic."""
        full, kind = self.resolve(topic), message_class(message_type).__msgtype__
        subscription = TransportSubscription(self._node, full, kind, callback, self._group_of(group))
        subscribe = partial(self.library.subscribe, full, kind, qos, subscription.arrive)
        subscription.connect(self._call(f"subscribe {full}", subscribe), qos)
        return self._keep(subscription)

    def serve(
        self, name: str, service_type: str, handler: Handler, group: ReadyCallbacks | None = None
    ) -> TransportService:
        """Answer requests."""
        full, kind = self.resolve(name), service(service_type)
        made = TransportService(self._node, full, kind, handler, self._group_of(group))
        made.served = self._call(f"serve {full}", partial(self.library.serve, full, kind, made.request))
        return self._keep(made)

    def client(self, name: str, service_type: str) -> TransportClient:
        """Return a client of a service."""
        full, kind = self.resolve(name), service(service_type)
        client = self._call(f"client of {full}", partial(self.library.client, full, kind))
        return self._keep(TransportClient(self._node, full, kind, client))

    def wait_for_service(self, name: str, within: Ns | None = None) -> bool:
        """Block until a node serves `name`; return False if `within` ns have passed first."""
        full = self.resolve(name)
        want = self._node.want(SERVICE, full, "")
        ready = partial(self.library.has_service, full)
        return want.note(poll_in_thread(self._graph.kernel, f"service {full}", ready, within))

    def get_parameter(self, name: str, default: Any = ...) -> Any:
        """Return a parameter's value."""
        full = self.resolve(name)
        try:
            return self._call(f"parameter {full}", partial(self.library.get_parameter, full))
        except KeyError:
            if default is not ...:
                return default
            raise UsageError(f"no parameter {full!r}") from None

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter."""
        full = self.resolve(name)
        self._call(f"parameter {full}", partial(self.library.set_parameter, full, value))

    def has_parameter(self, name: str) -> bool:
        """Return whether there is such a parameter."""
        return self.get_parameter(name, None) is not None

    def delete_parameter(self, name: str) -> None:
        """Remove a parameter."""
        full = self.resolve(name)
        try:
            self._call(f"parameter {full}", partial(self.library.delete_parameter, full))
        except KeyError:
            raise UsageError(f"no parameter {full!r}") from None
