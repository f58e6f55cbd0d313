"""Nodes: what every node does by itself (names, groups, timers, time), and the embedded graph's own.

`LocalNode` is the part that nodes of the transports share with `EmbeddedNode`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from volery.base.errors import UsageError
from volery.base.time import US, Ns
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import sleep_within
from volery.ros.graph import names
from volery.ros.graph.callbacks import CallbackGroup, NodeRate, NodeTimer
from volery.ros.graph.graph_context import GraphContext, NodeContext
from volery.ros.graph.interface import AS_OFFERED, CLOCK, DEFAULT, Callback, Group, Handler, Node, QoS, Work
from volery.ros.graph.services import EmbeddedClient, EmbeddedService
from volery.ros.graph.topics import EmbeddedPublisher, EmbeddedSubscription, topic_named

if TYPE_CHECKING:

    def _is_a(node: EmbeddedNode) -> Node:
        """Let the type checker verify that the class implements the protocol."""
        return node


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
        self._remaps = names.remapping(remaps, namespace, self.name)
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

    def resolve(self, name: str) -> str:
        """Return the absolute name, remappings applied."""
        absolute = names.absolute(name, self.namespace, self.name)
        return self._remaps.get(absolute, absolute)

    def _new_group(self, label: str, start: Callable[[Work], None] | None = None) -> CallbackGroup:
        made = CallbackGroup(self._node, label, start)
        self._groups.append(made)
        return made

    def group(self, start: Callable[[Work], None] | None = None) -> CallbackGroup:
        """Return a new group; `start` is called at once with each callback that is ready, and none waits."""
        return self._new_group(f"callbacks of group {len(self._groups)}", start)

    def _group_of(self, group: Group | None) -> CallbackGroup:
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

    def timer(self, period: Ns, callback: Callable[[], None], group: Group | None = None) -> NodeTimer:
        """Call back every `period` ns."""
        with self._graph.kernel:
            self._node.check_open()
            return NodeTimer(self._node, period, callback, self._group_of(group))

    def rate(self, period: Ns) -> NodeRate:
        """Return what keeps the loop of the current task at `period` ns."""
        return NodeRate(self._node, period)

    def sleep(self, duration: Ns) -> None:
        """Block the current task for `duration` ns; what the sleep itself takes is executed meanwhile."""
        with self._graph.kernel as kernel:
            self._node.consume("sleep", max(duration, 0) / US)
            sleep_within(kernel, duration)

    def now(self) -> Ns:
        """Return ROS time, ns. An interaction point."""
        with self._graph.kernel:
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
        super().__init__(NodeContext(graph, names.node_name(name, namespace), context), namespace, remaps)

    def join(self) -> None:
        """Join the graph: charge it and announce the node."""
        self._node.consume("init")
        self._node.consume("node_handle")
        self._node.start_charging_waits()
        self._graph.changed.notify()

    def advertise(self, topic: str, message_type: str, qos: QoS = DEFAULT) -> EmbeddedPublisher:
        """Publish to a topic."""
        with self._graph.kernel:
            self._node.check_open()
            found = topic_named(self._graph, self.resolve(topic), message_type, self._node)
            self._node.consume("advertise")
            return self._keep(EmbeddedPublisher(self._node, found, qos))

    def subscribe(
        self,
        topic: str,
        message_type: str,
        callback: Callback,
        qos: QoS = AS_OFFERED,
        group: Group | None = None,
    ) -> EmbeddedSubscription:
        """Call `callback` with each message of a topic."""
        with self._graph.kernel:
            self._node.check_open()
            found = topic_named(self._graph, self.resolve(topic), message_type, self._node)
            self._node.consume("subscribe")
            into = self._group_of(group)
            if found.name == CLOCK:
                self._graph.listen_to_clock()
            return self._keep(EmbeddedSubscription(self._node, found, callback, qos, into))

    def serve(
        self, name: str, service_type: str, handler: Handler, group: Group | None = None
    ) -> EmbeddedService:
        """Answer requests."""
        with self._graph.kernel:
            self._node.check_open()
            self._node.consume("advertise_service")
            into = self._group_of(group)
            return self._keep(EmbeddedService(self._node, self.resolve(name), service_type, handler, into))

    def client(self, name: str, service_type: str) -> EmbeddedClient:
        """Return a client of a service."""
        with self._graph.kernel:
            self._node.check_open()
            self._node.consume("service_client")
            return EmbeddedClient(self._node, self.resolve(name), service_type)

    def wait_for_service(self, name: str, within: Ns | None = None) -> bool:
        """Block until a node serves `name`; return False if `within` ns have passed first."""
        full = self.resolve(name)
        return self._graph.changed.wait_for(lambda: full in self._graph.services, within)

    def get_parameter(self, name: str, default: Any = ...) -> Any:
        """Return a parameter's value."""
        with self._graph.kernel:
            full = self.resolve(name)
            if default is not ... and not self._graph.parameters.has(full):
                return default
            return self._graph.parameters.get(full)

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter."""
        with self._graph.kernel:
            self._graph.parameters.set(self.resolve(name), value)

    def has_parameter(self, name: str) -> bool:
        """Return whether there is such a parameter."""
        with self._graph.kernel:
            return self._graph.parameters.has(self.resolve(name))

    def delete_parameter(self, name: str) -> None:
        """Remove a parameter."""
        with self._graph.kernel:
            self._graph.parameters.delete(self.resolve(name))
