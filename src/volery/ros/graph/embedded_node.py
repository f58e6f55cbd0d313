"""What a node does by itself, whatever graph it is on: its names, its groups, its timers, its time.

A node of the embedded graph.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.task import ExecutionContext
from volery.ros.graph import names
from volery.ros.graph.callbacks import CallbackGroup, NodeRate, NodeTimer, Work, sleep
from volery.ros.graph.graph_context import GraphContext, NodeContext
from volery.ros.graph.interface import AS_OFFERED, CLOCK, DEFAULT, Callback, Group, Handler, Node, QoS
from volery.ros.graph.services import EmbeddedClient, EmbeddedService
from volery.ros.graph.topics import EmbeddedPublisher, EmbeddedSubscription, topic

if TYPE_CHECKING:

    def _is_a(node: EmbeddedNode) -> Node:
        """Checked by the type checker: it has all that a node has."""
        return node


class Closes(Protocol):
    """Whatever a node has made and takes with it."""

    def close(self) -> None:
        """It is gone."""


Made = TypeVar("Made", bound=Closes)


class LocalNode:
    """See ``volery.ros.graph.interface.Node``; what talks to others is added by each kind of graph."""

    def __init__(
        self, context: GraphContext, name: str, namespace: str, remaps: Mapping[str, str], member: NodeContext
    ) -> None:
        self.name = names.node_name(name, namespace)
        self.namespace = namespace
        self._context = context
        self._member = member
        self._remaps = names.remapping(remaps, namespace, self.name)
        self._groups: list[CallbackGroup] = []
        self._own = self._new_group("callbacks")
        self._made: list[Closes] = []
        self.on_close: Callable[[], None] | None = None

    @property
    def context(self) -> ExecutionContext:
        """Where its computing is spent."""
        return self._member.place

    @property
    def closed(self) -> bool:
        """Whether it has left the graph."""
        return self._member.closed

    def resolve(self, name: str) -> str:
        """The absolute name, remappings applied."""
        absolute = names.absolute(name, self.namespace, self.name)
        return self._remaps.get(absolute, absolute)

    def _new_group(self, label: str, start: Callable[[Work], None] | None = None) -> CallbackGroup:
        made = CallbackGroup(self._member, label, start)
        self._groups.append(made)
        return made

    def group(self, start: Callable[[Work], None] | None = None) -> CallbackGroup:
        """A new group. With *start* its work waits for no spin: *start* is given it, as house code."""
        return self._new_group(f"callbacks of group {len(self._groups)}", start)

    def _group_of(self, group: Group | None) -> CallbackGroup:
        if group is None:
            return self._own
        if not isinstance(group, CallbackGroup) or group not in self._groups:
            raise UsageError(f"node {self.name}: this group is of another node; make one with group()")
        return group

    def _keep(self, made: Made) -> Made:
        self._made.append(made)
        self._context.changed.notify()
        return made

    def timer(self, period: Ns, callback: Callable[[], None], group: Group | None = None) -> NodeTimer:
        """Call back each *period*."""
        with self._context.kernel:
            self._member.check_open()
            return NodeTimer(self._member, period, callback, self._group_of(group))

    def rate(self, period: Ns) -> NodeRate:
        """Keep the loop of the current task at *period*."""
        return NodeRate(self._member, period)

    def sleep(self, duration: Ns) -> None:
        """Block the current task for *duration*."""
        sleep(self._member, duration)

    def now(self) -> Ns:
        """ROS time."""
        with self._context.kernel:
            return self._context.stamp()

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
        with self._context.kernel.guard:
            if self._member.closed:
                return
            self._member.closed = True
            for made in self._made:
                made.close()
            for group in self._groups:
                group.wake()
            if self.on_close is not None:
                self.on_close()
            self._context.changed.notify()


class EmbeddedNode(LocalNode):
    """See ``volery.ros.graph.interface.Node``. Made by ``Graph.node``."""

    def __init__(
        self,
        context: GraphContext,
        name: str,
        namespace: str,
        remaps: Mapping[str, str],
        place: ExecutionContext,
    ) -> None:
        full = names.node_name(name, namespace)
        super().__init__(context, name, namespace, remaps, NodeContext(context, full, place))

    def join(self) -> None:
        """Pay for it."""
        self._member.pay("init")
        self._member.pay("node_handle")
        self._member.keep_up()
        self._context.changed.notify()

    def advertise(self, topic_name: str, message_type: str, qos: QoS = DEFAULT) -> EmbeddedPublisher:
        """Publish to a topic."""
        with self._context.kernel:
            self._member.check_open()
            at = topic(self._context, self.resolve(topic_name), message_type, self._member)
            self._member.pay("advertise")
            return self._keep(EmbeddedPublisher(self._member, at, qos))

    def subscribe(
        self,
        topic_name: str,
        message_type: str,
        callback: Callback,
        qos: QoS = AS_OFFERED,
        group: Group | None = None,
    ) -> EmbeddedSubscription:
        """Call *callback* with each message of a topic."""
        with self._context.kernel:
            self._member.check_open()
            at = topic(self._context, self.resolve(topic_name), message_type, self._member)
            self._member.pay("subscribe")
            into = self._group_of(group)
            if at.name == CLOCK:
                self._context.listen_to_clock()
            return self._keep(EmbeddedSubscription(self._member, at, callback, qos, into))

    def serve(
        self, name: str, service_type: str, handler: Handler, group: Group | None = None
    ) -> EmbeddedService:
        """Answer requests."""
        with self._context.kernel:
            self._member.check_open()
            self._member.pay("advertise_service")
            into = self._group_of(group)
            return self._keep(EmbeddedService(self._member, self.resolve(name), service_type, handler, into))

    def client(self, name: str, service_type: str) -> EmbeddedClient:
        """Call a service."""
        with self._context.kernel:
            self._member.check_open()
            self._member.pay("service_client")
            return EmbeddedClient(self._member, self.resolve(name), service_type)

    def wait_for_service(self, name: str, within: Ns | None = None) -> bool:
        """Block until somebody serves *name*; False if *within* has passed first."""
        full = self.resolve(name)
        return self._context.changed.wait_for(lambda: full in self._context.services, within)

    def get_parameter(self, name: str, default: Any = ...) -> Any:
        """A parameter's value."""
        with self._context.kernel:
            full = self.resolve(name)
            if default is not ... and not self._context.parameters.has(full):
                return default
            return self._context.parameters.get(full)

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter."""
        with self._context.kernel:
            self._context.parameters.set(self.resolve(name), value)

    def has_parameter(self, name: str) -> bool:
        """Whether there is such a parameter."""
        with self._context.kernel:
            return self._context.parameters.has(self.resolve(name))

    def delete_parameter(self, name: str) -> None:
        """Remove a parameter."""
        with self._context.kernel:
            self._context.parameters.delete(self.resolve(name))
