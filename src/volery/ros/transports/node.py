"""A node of a transport: what it does by itself is the embedded graph's, the rest goes over the wire."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.task import Place
from volery.ros.graph import names
from volery.ros.graph.context import Context, Member
from volery.ros.graph.local import LocalNode
from volery.ros.graph.node import AS_OFFERED, DEFAULT, Callback, Group, Handler, Node, QoS
from volery.ros.messages import message_class, service
from volery.ros.transports.abroad import abroad, until
from volery.ros.transports.services import TransportClient, TransportService
from volery.ros.transports.topics import TransportPublisher, TransportSubscription
from volery.ros.transports.wire import Wire

if TYPE_CHECKING:

    def _is_a(node: TransportNode) -> Node:
        """Checked by the type checker: it has all that a node has."""
        return node


T = TypeVar("T")


class TransportMember(Member):
    """Who acts. The calls themselves take the time that they take; they are not priced."""

    __slots__ = ("why",)

    def __init__(self, context: Context, name: str, place: Place) -> None:
        super().__init__(context, name, place)
        self.why = ""

    def pay(self, call: str, x: float = 0.0) -> None:
        """Only an interaction point."""
        self.context.kernel.pay(0)

    def check_open(self) -> None:
        """``UsageError`` if the node has left the graph, with the reason if it was thrown out."""
        if self.closed:
            raise UsageError(f"node {self.name} has left the graph{f': {self.why}' if self.why else ''}")


class _Ends(NamedTuple):
    close: Callable[[], None]


class TransportNode(LocalNode):
    """See ``volery.ros.graph.node.Node``. Made by a transport's graph."""

    def __init__(
        self,
        context: Context,
        name: str,
        namespace: str,
        remaps: Mapping[str, str],
        place: Place,
    ) -> None:
        self._self = TransportMember(context, names.node_name(name, namespace), place)
        super().__init__(context, name, namespace, remaps, self._self)
        self._wire: Wire

    def join(self, wire: Wire) -> None:
        """It is on the graph."""
        self._wire = wire
        self._context.changed.notify()

    @property
    def wire(self) -> Wire:
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
        return abroad(self._context.kernel, f"{self.name}: {what}", work)

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
        return until(self._context.kernel, f"service {full}", partial(self._wire.has_service, full), within)

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
