"""A node of the embedded graph."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from volery.base.time import Ns
from volery.kernel.task import Place
from volery.ros.graph import names
from volery.ros.graph.clock import CLOCK
from volery.ros.graph.context import Context, Member
from volery.ros.graph.local import LocalNode
from volery.ros.graph.node import AS_OFFERED, DEFAULT, Callback, Group, Handler, Node, QoS
from volery.ros.graph.services import EmbeddedClient, EmbeddedService
from volery.ros.graph.topics import EmbeddedPublisher, EmbeddedSubscription, topic

if TYPE_CHECKING:

    def _is_a(node: EmbeddedNode) -> Node:
        """Checked by the type checker: it has all that a node has."""
        return node


class EmbeddedNode(LocalNode):
    """See ``volery.ros.graph.node.Node``. Made by ``Graph.node``."""

    def __init__(
        self, context: Context, name: str, namespace: str, remaps: Mapping[str, str], place: Place
    ) -> None:
        full = names.node_name(name, namespace)
        super().__init__(context, name, namespace, remaps, Member(context, full, place))

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
