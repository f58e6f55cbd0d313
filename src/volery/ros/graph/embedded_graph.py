"""The embedded ROS graph and its nodes: the kernel's time, every call priced, every message carried.

What a call costs and how a message travels are functions given by the caller: the graph knows neither cost
laws nor networks. ``/clock`` is published while a node subscribes to it and is not charged, since it is no
part of the modelled system. `LocalNode` is the part that nodes of the transports share with `EmbeddedNode`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast

from volery.base.errors import UsageError
from volery.base.time import US, Ns, S
from volery.kernel.api import Handle, Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import Signal, sleep_within
from volery.ros.graph.callbacks import CallbackGroup, NodeRate, NodeTimer
from volery.ros.graph.endpoints import (
    EmbeddedClient,
    EmbeddedPublisher,
    EmbeddedService,
    EmbeddedSubscription,
    topic_named,
)
from volery.ros.graph.graph_context import GraphContext, NodeContext, ParameterTree, Recorded, Records
from volery.ros.graph.interface import (
    AS_OFFERED,
    CLOCK,
    CLOCK_PERIOD,
    CLOCK_TYPE,
    DEFAULT,
    INVALID_VALUES,
    Callback,
    Handler,
    NameTakenError,
    Node,
    Publisher,
    QoS,
    ReadyCallbacks,
    RosGraph,
    Routing,
    ServiceState,
    Tariffs,
    TopicState,
    absolute_name,
    absolute_remaps,
    free,
    full_node_name,
    no_route,
)
from volery.ros.graph.unserved import SERVICE, TRANSFORM, KnownParticipants, unserved
from volery.ros.graph.work import Work
from volery.ros.messages import RosMessage, cdr_size, new
from volery.trace.events import Unserved

if TYPE_CHECKING:

    def _are(graph: EmbeddedGraph, node: EmbeddedNode) -> tuple[RosGraph, Node]:
        """Let the type checker verify that the classes implement the protocols."""
        return graph, node


class Closable(Protocol):
    """A part of a node that is closed with it."""

    def close(self) -> None:
        """Leave the graph."""


Part = TypeVar("Part", bound=Closable)


class LocalNode:
    """The part of a ``volery.ros.graph.interface.Node`` that needs no other node."""

    def __init__(self, node: NodeContext, namespace: str, remaps: Mapping[str, str]) -> None:
        self.name = node.name
        self.namespace = namespace
        self._node, self._graph = node, node.graph
        self._remaps = absolute_remaps(remaps, namespace, self.name)
        self._groups: list[CallbackGroup] = []
        self._own = self._new_group("callbacks")
        self._parts: list[Closable] = []
        self.on_close: Callable[[], None] | None = None

    @property
    def context(self) -> ExecutionContext:
        """Context that its calls and callbacks are charged to."""
        return self._node.context

    @property
    def closed(self) -> bool:
        """Whether it has left the graph."""
        return self._node.closed

    @property
    def own_group(self) -> CallbackGroup:
        """Group of the callbacks that are given none."""
        return self._own

    def resolve(self, name: str) -> str:
        """Return the absolute name, remappings applied."""
        absolute = absolute_name(name, self.namespace, self.name)
        return self._remaps.get(absolute, absolute)

    def _new_group(self, label: str, start: Callable[[Work], None] | None = None) -> CallbackGroup:
        made = CallbackGroup(self._node, label, start)
        self._groups.append(made)
        return made

    def group(self, start: Callable[[Work], None] | None = None) -> CallbackGroup:
        """Return a new group; `start` is called at once with each callback that is ready, and none waits."""
        return self._new_group(f"callbacks of group {len(self._groups)}", start)

    def _group_of(self, group: ReadyCallbacks | None) -> CallbackGroup:
        if group is None:
            return self._own
        if not isinstance(group, CallbackGroup) or group not in self._groups:
            raise UsageError(f"node {self.name}: this group is of another node; make one with group()")
        return group

    def _keep(self, part: Part) -> Part:
        """Close `part` with the node, and announce it to those who wait for changes of the graph."""
        self._parts.append(part)
        self._graph.changed.notify()
        return part

    def publish_all(
        self, messages: Sequence[tuple[Publisher, Any]], refused: Callable[[int, Exception], None]
    ) -> None:
        """See ``Node``. Here the messages are sent one after the other."""
        for index, (publisher, message) in enumerate(messages):
            try:
                publisher.publish(message)
            except INVALID_VALUES as error:
                refused(index, error)

    def timer(
        self, period: Ns, callback: Callable[[], None], group: ReadyCallbacks | None = None
    ) -> NodeTimer:
        """Call back every `period` ns."""
        with self._graph.kernel.interact():
            self._node.check_open()
            return NodeTimer(self._node, period, callback, self._group_of(group))

    def rate(self, period: Ns) -> NodeRate:
        """Return what keeps the loop of the current task at `period` ns."""
        return NodeRate(self._node, period)

    def sleep(self, duration: Ns) -> None:
        """Block the current task for `duration` ns; what the sleep itself takes is executed meanwhile."""
        kernel = self._graph.kernel
        with kernel.interact():
            sleep_within(kernel, duration, self._node.consume("sleep", max(duration, 0) / US))

    def now(self) -> Ns:
        """Return ROS time, ns. An interaction point."""
        with self._graph.kernel.interact():
            return self._graph.stamp()

    def spin_once(self, within: Ns | None = None) -> bool:
        """``spin_once`` of the node's own group."""
        return self._own.spin_once(within)

    def spin_available(self) -> None:
        """``spin_available`` of the node's own group."""
        self._own.spin_available()

    def spin(self) -> None:
        """``spin`` of the node's own group."""
        self._own.spin()

    def close(self) -> None:
        """Leave the graph."""
        with self._graph.kernel.guard:
            if self._node.closed:
                return
            self._node.closed = True
            for part in self._parts:
                part.close()
            for group in self._groups:
                group.wake()
            if self.on_close is not None:
                self.on_close()
            self._graph.changed.notify()


class EmbeddedNode(LocalNode):
    """See ``volery.ros.graph.interface.Node``. Made by ``EmbeddedGraph.node``."""

    def __init__(
        self,
        graph: GraphContext,
        name: str,
        namespace: str,
        remaps: Mapping[str, str],
        context: ExecutionContext,
    ) -> None:
        super().__init__(NodeContext(graph, full_node_name(name, namespace), context), namespace, remaps)

    def join(self) -> None:
        """Join the graph: charge it and announce the node."""
        self._node.consume("init")
        self._node.consume("node_handle")
        self._node.start_charging_waits()
        self._graph.changed.notify()

    def advertise(self, topic: str, message_type: str, qos: QoS = DEFAULT) -> EmbeddedPublisher:
        """Publish to a topic."""
        with self._graph.kernel.interact():
            self._node.check_open()
            found = topic_named(self._graph, self.resolve(topic), message_type, self._node)
            self._node.consume("advertise")
            return self._keep(EmbeddedPublisher(self._node, found, qos))

    def publish_all(
        self, messages: Sequence[tuple[Publisher, Any]], refused: Callable[[int, Exception], None]
    ) -> None:
        """See ``Node``."""
        publishers = [cast("EmbeddedPublisher", publisher) for publisher, _ in messages]
        with self._graph.kernel.interact():
            self._node.check_open()
            sent = self._node.consume_publications([publisher.connected for publisher in publishers])
            for index, (publisher, (_, message)) in enumerate(zip(publishers, messages, strict=True)):
                try:
                    publisher.send(message, sent, fresh=True)
                except INVALID_VALUES as error:
                    refused(index, error)

    def subscribe(
        self,
        topic: str,
        message_type: str,
        callback: Callback,
        qos: QoS = AS_OFFERED,
        group: ReadyCallbacks | None = None,
    ) -> EmbeddedSubscription:
        """Call `callback` with each message of a topic."""
        with self._graph.kernel.interact():
            self._node.check_open()
            found = topic_named(self._graph, self.resolve(topic), message_type, self._node)
            self._node.consume("subscribe")
            into = self._group_of(group)
            if found.name == CLOCK:
                self._graph.listen_to_clock()
            return self._keep(EmbeddedSubscription(self._node, found, callback, qos, into))

    def serve(
        self, name: str, service_type: str, handler: Handler, group: ReadyCallbacks | None = None
    ) -> EmbeddedService:
        """Answer requests."""
        with self._graph.kernel.interact():
            self._node.check_open()
            self._node.consume("advertise_service")
            into = self._group_of(group)
            return self._keep(EmbeddedService(self._node, self.resolve(name), service_type, handler, into))

    def client(self, name: str, service_type: str) -> EmbeddedClient:
        """Return a client of a service."""
        with self._graph.kernel.interact():
            self._node.check_open()
            self._node.consume("service_client")
            return EmbeddedClient(self._node, self.resolve(name), service_type)

    def wait_for_service(self, name: str, within: Ns | None = None) -> bool:
        """Block until a node serves `name`; return False if `within` ns have passed first."""
        full = self.resolve(name)
        self._node.want(SERVICE, full, "")
        return self._graph.changed.wait_for(lambda: full in self._graph.services, within)

    def get_parameter(self, name: str, default: Any = ...) -> Any:
        """Return a parameter's value."""
        with self._graph.kernel.interact():
            full = self.resolve(name)
            if default is not ... and not self._graph.parameters.has(full):
                return default
            return self._graph.parameters.get(full)

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter."""
        with self._graph.kernel.interact():
            self._graph.parameters.set(self.resolve(name), value)

    def has_parameter(self, name: str) -> bool:
        """Return whether there is such a parameter."""
        with self._graph.kernel.interact():
            return self._graph.parameters.has(self.resolve(name))

    def delete_parameter(self, name: str) -> None:
        """Remove a parameter."""
        with self._graph.kernel.interact():
            self._graph.parameters.delete(self.resolve(name))


class ClockPublisher:
    """Publisher of ``/clock``, which runs while the topic has subscriptions."""

    def __init__(self, graph: GraphContext) -> None:
        self._graph = graph
        self._ticking: Handle | None = None

    def listen(self) -> None:
        """Start publishing for a new subscription, unless it is running."""
        if self._ticking is None:
            self._ticking = self._graph.kernel.every(CLOCK_PERIOD, self._tick)

    def _tick(self) -> None:
        subscriptions = self._graph.topics[CLOCK].subscriptions
        if not subscriptions and self._ticking is not None:
            self._ticking.cancel()
            self._ticking = None
        now = self._graph.kernel.now()
        stamp = self._graph.stamp()
        for subscription in tuple(subscriptions):
            message = new(CLOCK_TYPE, clock={"sec": stamp // S, "nanosec": stamp % S})
            subscription.arrive(message, now, CLOCK, cdr_size(message))


def record_short(topic_name: str) -> Recorded:
    """Record all topics, long messages without their content."""
    return Recorded.SHORT


def record_none(topic_name: str) -> Recorded:
    """Record no topic."""
    return Recorded.NOTHING


class EmbeddedGraph:
    """One ROS graph.

    Args:
        kernel: Clock and tasks of its nodes.
        tariffs: Prices of each node's calls.
        route: Path of messages from node to node.
        records: What is recorded of each topic: messages with their content are events ``Published``, those
            without are ``Omitted``.
        epoch: ROS time at the kernel's zero, ns: 0 in virtual time, Unix time on the wall clock.
        unrecorded: Record no event; for a graph that is no part of the modelled system, such as the wire to a
            simulated vehicle.
        as_bytes: Encode and decode every message, so that values have the precision of a transport.
        size_of: Returns the size of a message for its route, bytes; by default that of its encoding.
    """

    def __init__(
        self,
        kernel: Kernel,
        tariffs: Tariffs = free,
        route: Routing = no_route,
        *,
        records: Records = record_short,
        epoch: Ns = 0,
        unrecorded: bool = False,
        as_bytes: bool = False,
        size_of: Callable[[RosMessage], int] = cdr_size,
    ) -> None:
        self.kernel = kernel
        self._graph = GraphContext(
            kernel,
            tariffs,
            route,
            record_none if unrecorded else records,
            epoch,
            Signal(kernel, "the ROS graph"),
            unrecorded=unrecorded,
            as_bytes=as_bytes,
            size_of=size_of,
        )
        self._graph.listen_to_clock = ClockPublisher(self._graph).listen
        self._nodes: dict[str, EmbeddedNode] = {}

    @property
    def epoch(self) -> Ns:
        """ROS time at the kernel's zero, ns."""
        return self._graph.epoch

    @property
    def changed(self) -> Signal:
        """Notified when nodes, publishers, subscriptions or services come or go."""
        return self._graph.changed

    @property
    def parameters(self) -> ParameterTree:
        """All parameters, by absolute name."""
        return self._graph.parameters

    def node(
        self,
        name: str,
        namespace: str = "/",
        *,
        remaps: Mapping[str, str] | None = None,
        anonymous: bool = False,
        context: ExecutionContext | None = None,
    ) -> EmbeddedNode:
        """Join the graph; charged as ``init`` and ``node_handle``.

        Args:
            name: Name without slashes.
            namespace: ``/`` or an absolute name.
            remaps: Names of topics, services and parameters, and what replaces them.
            anonymous: Append a number to the name.
            context: Context that the node's computing is charged to; the current task's by default.

        Raises:
            UsageError: the name is not valid or is taken.
        """
        with self.kernel.interact():
            if anonymous:
                number = 1
                while f"{namespace.rstrip('/')}/{name}_{number}" in self._nodes:
                    number += 1
                name = f"{name}_{number}"
            task = self.kernel.current()
            context = context or (task.context if task is not None else ExecutionContext(name))
            made = EmbeddedNode(self._graph, name, namespace, remaps or {}, context)
            other = self._nodes.get(made.name)
            if other is not None:
                raise NameTakenError(
                    f"a node named {made.name} is there already (of component {other.context.component}); "
                    f"give this one of component {made.context.component} another name or namespace"
                )
            self._nodes[made.name] = made
            made.on_close = lambda: self._forget(made)
            made.join()
            return made

    def _forget(self, node: EmbeddedNode) -> None:
        del self._nodes[node.name]

    def node_names(self) -> list[str]:
        """Return the names of all nodes, sorted."""
        return sorted(self._nodes)

    def nodes_of(self, component: str) -> list[EmbeddedNode]:
        """Return the nodes that are charged to a component."""
        return [node for node in self._nodes.values() if node.context.component == component]

    def topics(self) -> list[TopicState]:
        """Return the topics that have a publisher or a subscription, by name."""
        states = []
        listed = (
            one for _, first in sorted(self._graph.topics.items()) for one in (first, *first.others.values())
        )
        for topic in listed:
            publishers = tuple(publisher.node.name for publisher in topic.publishers)
            subscribers = tuple(subscription.node.name for subscription in topic.subscriptions)
            if publishers or subscribers:
                states.append(TopicState(topic.name, topic.type, publishers, subscribers))
        return states

    def offered(self, topic: str) -> tuple[QoS, ...]:
        """Return what the publishers of a topic offer."""
        found = self._graph.topics.get(topic)
        return tuple(publisher.qos for publisher in found.publishers) if found is not None else ()

    def requested(self, topic: str) -> tuple[QoS, ...]:
        """Return what the subscriptions to a topic request."""
        found = self._graph.topics.get(topic)
        return tuple(subscription.qos for subscription in found.subscriptions) if found is not None else ()

    def has_subscribers(self, topic_name: str) -> bool:
        """Return whether a node subscribes to the topic, without being an interaction point."""
        topic = self._graph.topics.get(topic_name)
        return topic is not None and bool(topic.subscriptions)

    def uses_content(self, topic_name: str) -> bool:
        """Return whether a node subscribes to the topic, or its messages are recorded with their content."""
        return self.has_subscribers(topic_name) or self._graph.records(topic_name) is Recorded.ALL

    def services(self) -> list[ServiceState]:
        """Return the services that have a server, by name."""
        served = sorted(self._graph.services.items())
        return [ServiceState(name, one.type, one.node.name) for name, one in served]

    def looked_up(self, transform: str, problem: str) -> None:
        """Note a look-up of a transform by the current component; *problem* is empty if it was there."""
        task = self.kernel.current()
        if task is not None:
            who = task.context.component
            want = self._graph.wants.of(TRANSFORM, transform, "", (who, f"/{who}"), self.kernel.now())
            want.met = want.met or not problem
            want.count += 1
            want.reason = problem

    def unserved(self, around: KnownParticipants) -> list[Unserved]:
        """Return what components have offered or asked for until now, and no node took or served."""
        return unserved(self._graph.wants, around, self.kernel.now())

    def close(self) -> None:
        """Close all nodes."""
        for node in list(self._nodes.values()):
            node.close()
