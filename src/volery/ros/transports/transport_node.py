"""Publishers and subscriptions of a transport.

Services and clients of a transport.

A node of a transport: what it does by itself is the embedded graph's, the rest goes over the wire.
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
from volery.ros.graph import names
from volery.ros.graph.callbacks import CallbackGroup, Work
from volery.ros.graph.embedded_node import LocalNode
from volery.ros.graph.graph_context import GraphContext, NodeContext
from volery.ros.graph.interface import AS_OFFERED, DEFAULT, Callback, Group, Handler, Node, QoS
from volery.ros.graph.services import ServiceError
from volery.ros.messages import Message, ServiceType, message_class, service
from volery.ros.messages.cdr import copied_to_cdr
from volery.ros.transports.blocking_calls import poll_in_thread, run_in_thread
from volery.ros.transports.client_library import (
    LibraryClient,
    LibraryNode,
    LibraryPublisher,
    LibraryService,
    LibrarySubscription,
    OnResponse,
    ReceivedMessage,
)
from volery.trace.events import Call, Published, Text
from volery.trace.events import Message as MessageEvent

if TYPE_CHECKING:

    def _is_a(node: TransportNode) -> Node:
        """Checked by the type checker: it has all that a node has."""
        return node


WARNING = 4
"""Severity, as in syslog."""


class TransportPublisher:
    """See ``volery.ros.graph.interface.Publisher``."""

    def __init__(self, member: NodeContext, topic: str, message_type: str, outlet: LibraryPublisher) -> None:
        self.member = member
        self._class = message_class(message_type)
        self.topic, self.type = topic, self._class.__msgtype__
        self._outlet = outlet
        self._recorded = member.context.records(topic)
        self._open = True

    def publish(self, message: Any) -> None:
        """Send a copy of *message* as it is now."""
        context = self.member.context
        with context.kernel as kernel:
            if not self._open:
                self.member.check_open()
                raise UsageError(f"node {self.member.name}: its publisher of {self.topic} is closed")
            if not isinstance(message, self._class):
                kind = getattr(message, "__msgtype__", "") or f"a {type(message).__name__}"
                raise UsageError(f"topic {self.topic} carries {self.type}, not {kind}")
            data = copied_to_cdr(message.copy())
            if self._recorded:
                context.record(Published(kernel.now(), self.topic, self.type, self.member.name, data))
            self._outlet.send(data)

    def subscribers(self) -> int:
        """How many subscriptions it is connected to."""
        with self.member.context.kernel:
            return self._outlet.connected() if self._open else 0

    def close(self) -> None:
        """Advertise no longer."""
        if self._open:
            self._open = False
            self._outlet.close()


class TransportSubscription:
    """See ``volery.ros.graph.interface.Subscription``.

    What arrives waits as bytes, at most as many as the depth of the QoS, and is decoded when its callback
    runs. ``dropped`` counts messages that the full queue gave up, ``garbled`` those that were none.
    """

    inlet: LibrarySubscription

    def __init__(
        self, member: NodeContext, topic: str, message_type: str, callback: Callback, group: CallbackGroup
    ) -> None:
        self.member = member
        self.topic, self.type = topic, message_class(message_type).__msgtype__
        self.dropped = self.garbled = 0
        self._callback, self._group = callback, group
        self._queue: deque[ReceivedMessage] = deque()
        self._depth: int | None = None
        self._guard = threading.Lock()
        self._announced = False  # the house will look into the queue
        self._works = 0  # pieces of work in the group, one for each parcel that the house has seen
        self._open = True

    def connect(self, inlet: LibrarySubscription, qos: QoS) -> None:
        """It hears *inlet* from now on."""
        self.inlet, self._depth = inlet, qos.depth

    def arrive(self, parcel: ReceivedMessage) -> None:
        """A message is there. Called by a thread of the client library."""
        with self._guard:
            if not self._open:
                return
            if self._depth is not None and len(self._queue) >= self._depth:
                self._queue.popleft()
                self.dropped += 1
            self._queue.append(parcel)
            if self._announced:
                return
            self._announced = True
        self.member.context.kernel.post(self._admit)

    def _admit(self) -> None:
        context = self.member.context
        now = context.kernel.now()
        with self._guard:
            self._announced = False
            fresh = list(self._queue)[self._works :]
            self._works += len(fresh)
        for parcel in fresh:
            size = len(parcel.data)
            context.record(MessageEvent(now, now, self.topic, parcel.publisher, self.member.name, size))
            self._group.add(Work(now, self.run))

    def run(self) -> None:
        """Call back with the oldest message."""
        with self._guard:
            self._works = max(0, self._works - 1)
            if not self._queue:
                return
            parcel = self._queue.popleft()
        try:
            message = parcel.read(parcel.data)
        except UsageError as error:
            self.garbled += 1
            self._warn(f"{self.topic}: a message of {parcel.publisher or 'an unknown node'} dropped: {error}")
            return
        self._callback(message)

    def _warn(self, text: str) -> None:
        with self.member.context.kernel as kernel:
            kernel.record(Text(kernel.now(), self.member.name, WARNING, text))

    def publishers(self) -> int:
        """How many publishers it is connected to."""
        with self.member.context.kernel:
            return self.inlet.connected() if self._open else 0

    def close(self) -> None:
        """Receive no longer; what still waits is forgotten."""
        with self._guard:
            if not self._open:
                return
            self._open = False
            self._queue.clear()
        self.inlet.close()


class TransportService:
    """See ``volery.ros.graph.interface.Service``."""

    served: LibraryService

    def __init__(
        self, member: NodeContext, name: str, kind: ServiceType, handler: Handler, group: CallbackGroup
    ) -> None:
        self.member = member
        self.name, self.type = name, kind.name
        self._kind = kind
        self._handler, self._group = handler, group
        self._pending: list[OnResponse] = []
        self._open = True

    def ask(self, request: Message, done: OnResponse) -> None:
        """A request is there. Called by a thread of the client library."""
        self.member.context.kernel.post(partial(self._queue, request, done))

    def _queue(self, request: Message, done: OnResponse) -> None:
        if not self._open:
            done(None, "its server has gone")
            return
        self._pending.append(done)
        self._group.add(Work(self.member.context.kernel.now(), partial(self._answer, request, done)))

    def _answer(self, request: Message, done: OnResponse) -> None:
        if done not in self._pending:
            return
        try:
            answer = self._handler(request)
            if not isinstance(answer, self._kind.response):
                raise UsageError(
                    f"the handler of {self.name} returned {answer!r}, not a {self.type} response"
                )
            content = answer.copy()
        except Exception as error:
            self._end(done, None, f"its handler raised {type(error).__name__}: {error}")
            raise
        self._end(done, content, "")

    def _end(self, done: OnResponse, answer: Message | None, problem: str) -> None:
        with self.member.context.kernel.guard:
            if done in self._pending:
                self._pending.remove(done)
                done(answer, problem)

    def close(self) -> None:
        """Answer no longer; who waits is told."""
        if self._open:
            self._open = False
            self.served.close()
            for done in list(self._pending):
                self._end(done, None, "its server has gone")


class TransportClient:
    """See ``volery.ros.graph.interface.Client``."""

    def __init__(self, member: NodeContext, name: str, kind: ServiceType, caller: LibraryClient) -> None:
        self.name, self.type = name, kind.name
        self._kind = kind
        self._member = member
        self._caller = caller

    def call(self, request: Any, within: Ns | None = None) -> Any:
        """Block until the answer is there; ``ServiceError`` if none comes."""
        kernel = self._member.context.kernel
        self._member.check_open()
        if not isinstance(request, self._kind.request):
            raise UsageError(f"service {self.name} takes a {self._kind.request.__msgtype__}, not {request!r}")
        outcome: list[tuple[Message | None, str]] = []
        answered = Signal(kernel, f"service {self.name} (answer)")

        def arrive(answer: Message | None, problem: str) -> None:
            outcome.append((answer, problem))
            answered.notify()

        with kernel:
            start = kernel.now()
            give_up = self._caller.call(request.copy(), lambda *end: kernel.post(partial(arrive, *end)))
            if not answered.wait_for(lambda: outcome, within):
                give_up()
                arrive(None, f"no answer within {to_seconds(within or 0):g} s")
            answer, problem = outcome[0]
            who, end = self._member.id.component, "ServiceError" if problem else "ok"
            kernel.record(Call(start, kernel.now(), who, "", self.name, end))
        if problem:
            raise ServiceError(self.name, problem)
        return answer

    def wait(self, within: Ns | None = None) -> bool:
        """Block until somebody serves it."""
        return poll_in_thread(self._member.context.kernel, f"service {self.name}", self._caller.ready, within)

    def ready(self) -> bool:
        """Whether somebody serves it now."""
        return run_in_thread(self._member.context.kernel, f"service {self.name}", self._caller.ready)

    def close(self) -> None:
        """Call no more."""
        self._caller.close()


T = TypeVar("T")


class TransportMember(NodeContext):
    """Who acts. The calls themselves take the time that they take; they are not priced."""

    __slots__ = ("why",)

    def __init__(self, context: GraphContext, name: str, place: ExecutionContext) -> None:
        super().__init__(context, name, place)
        self.why = ""

    def pay(self, call: str, x: float = 0.0) -> None:
        """Only an interaction point."""
        self.context.kernel.consume(0)

    def check_open(self) -> None:
        """``UsageError`` if the node has left the graph, with the reason if it was thrown out."""
        if self.closed:
            raise UsageError(f"node {self.name} has left the graph{f': {self.why}' if self.why else ''}")


class _Ends(NamedTuple):
    close: Callable[[], None]


class TransportNode(LocalNode):
    """See ``volery.ros.graph.interface.Node``. Made by a transport's graph."""

    def __init__(
        self,
        context: GraphContext,
        name: str,
        namespace: str,
        remaps: Mapping[str, str],
        place: ExecutionContext,
    ) -> None:
        self._self = TransportMember(context, names.node_name(name, namespace), place)
        super().__init__(context, name, namespace, remaps, self._self)
        self._wire: LibraryNode

    def join(self, wire: LibraryNode) -> None:
        """It is on the graph."""
        self._wire = wire
        self._context.changed.notify()

    @property
    def wire(self) -> LibraryNode:
        """Its side of the client library."""
        return self._wire

    def keep(self, close: Callable[[], None]) -> None:
        """Something more that ends with it."""
        self._keep(_Ends(close))

    def thrown_out(self, why: str) -> None:
        """It has lost its place on the graph. House code."""
        self._self.why = why
        self.close()

    def close(self) -> None:
        """Leave the graph."""
        if not self.closed:
            self._wire.leave()
        super().close()

    def part(self) -> None:
        """Take it off the graph, when all that it has made is closed."""
        self._wire.close()

    def _abroad(self, what: str, work: Callable[[], T]) -> T:
        self._member.check_open()
        return run_in_thread(self._context.kernel, f"{self.name}: {what}", work)

    def advertise(self, topic: str, message_type: str, qos: QoS = DEFAULT) -> TransportPublisher:
        """Publish to a topic."""
        full, kind = self.resolve(topic), message_class(message_type).__msgtype__
        outlet = self._abroad(f"advertise {full}", partial(self._wire.advertise, full, kind, qos))
        return self._keep(TransportPublisher(self._member, full, kind, outlet))

    def subscribe(
        self,
        topic: str,
        message_type: str,
        callback: Callback,
        qos: QoS = AS_OFFERED,
        group: Group | None = None,
    ) -> TransportSubscription:
        """Call *callback* with each message of a topic."""
        full, kind = self.resolve(topic), message_class(message_type).__msgtype__
        made = TransportSubscription(self._member, full, kind, callback, self._group_of(group))
        wanted = partial(self._wire.subscribe, full, kind, qos, made.arrive)
        made.connect(self._abroad(f"subscribe {full}", wanted), qos)
        return self._keep(made)

    def serve(
        self, name: str, service_type: str, handler: Handler, group: Group | None = None
    ) -> TransportService:
        """Answer requests."""
        full, kind = self.resolve(name), service(service_type)
        made = TransportService(self._member, full, kind, handler, self._group_of(group))
        made.served = self._abroad(f"serve {full}", partial(self._wire.serve, full, kind, made.ask))
        return self._keep(made)

    def client(self, name: str, service_type: str) -> TransportClient:
        """Call a service."""
        full, kind = self.resolve(name), service(service_type)
        caller = self._abroad(f"client of {full}", partial(self._wire.caller, full, kind))
        return self._keep(TransportClient(self._member, full, kind, caller))

    def wait_for_service(self, name: str, within: Ns | None = None) -> bool:
        """Block until somebody serves *name*."""
        full = self.resolve(name)
        return poll_in_thread(
            self._context.kernel, f"service {full}", partial(self._wire.has_service, full), within
        )

    def get_parameter(self, name: str, default: Any = ...) -> Any:
        """A parameter's value."""
        full = self.resolve(name)
        try:
            return self._abroad(f"parameter {full}", partial(self._wire.get_parameter, full))
        except KeyError:
            if default is not ...:
                return default
            raise UsageError(f"no parameter {full!r}") from None

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter."""
        full = self.resolve(name)
        self._abroad(f"parameter {full}", partial(self._wire.set_parameter, full, value))

    def has_parameter(self, name: str) -> bool:
        """Whether there is such a parameter."""
        return self.get_parameter(name, None) is not None

    def delete_parameter(self, name: str) -> None:
        """Remove a parameter."""
        full = self.resolve(name)
        try:
            self._abroad(f"parameter {full}", partial(self._wire.delete_parameter, full))
        except KeyError:
            raise UsageError(f"no parameter {full!r}") from None
