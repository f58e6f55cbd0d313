"""The embedded ROS graph: nothing to install, the kernel's time, every call priced, every message carried.

What a call costs and how a message travels are functions given by the caller: the graph knows neither cost
laws nor networks. ``/clock`` is published while a node subscribes to it and is not charged, since it is no
part of the modelled system.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from volery.base.errors import UsageError
from volery.base.time import Ns, S
from volery.kernel.api import Handle, Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import Signal
from volery.ros.graph.embedded_node import EmbeddedNode
from volery.ros.graph.graph_context import GraphContext, Parameters, Records
from volery.ros.graph.interface import (
    CLOCK,
    CLOCK_PERIOD,
    CLOCK_TYPE,
    RosGraph,
    Routing,
    ServiceState,
    Tariffs,
    TopicState,
    free,
    no_route,
)
from volery.ros.messages import cdr_size, new

if TYPE_CHECKING:

    def _is_a(graph: EmbeddedGraph) -> RosGraph:
        """Let the type checker verify that the class implements the protocol."""
        return graph


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


def record_all(topic_name: str) -> bool:
    """Record the content of all topics."""
    return True


def _record_none(topic_name: str) -> bool:
    return False


class EmbeddedGraph:
    """One ROS graph.

    Args:
        kernel: Clock and tasks of its nodes.
        tariffs: Prices of each node's calls.
        route: Path of messages from node to node.
        records: Topics whose messages are recorded with their content.
        epoch: ROS time at the kernel's zero, ns: 0 in virtual time, Unix time on the wall clock.
        unrecorded: Record no event; for a graph that is no part of the modelled system, such as the wire to a
            simulated vehicle.
        as_bytes: Encode and decode every message, so that values have the precision of a transport.
    """

    def __init__(
        self,
        kernel: Kernel,
        tariffs: Tariffs = free,
        route: Routing = no_route,
        *,
        records: Records = record_all,
        epoch: Ns = 0,
        unrecorded: bool = False,
        as_bytes: bool = False,
    ) -> None:
        self.kernel = kernel
        self._graph = GraphContext(
            kernel,
            tariffs,
            route,
            _record_none if unrecorded else records,
            epoch,
            Signal(kernel, "the ROS graph"),
            unrecorded=unrecorded,
            as_bytes=as_bytes,
        )
        self._graph.listen_to_clock = ClockPublisher(self._graph).listen
        self._nodes: dict[str, EmbeddedNode] = {}

    @property
    def epoch(self) -> Ns:
        """ROS time at the kernel's zero, ns."""
        return self._graph.epoch

    @property
    def parameters(self) -> Parameters:
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
        with self.kernel:
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
                raise UsageError(
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

    def topics(self) -> list[TopicState]:
        """Return the topics that have a publisher or a subscription, by name."""
        states = []
        for name, topic in sorted(self._graph.topics.items()):
            publishers = tuple(one.node.name for one in topic.publishers)
            subscribers = tuple(one.node.name for one in topic.subscriptions)
            if publishers or subscribers:
                states.append(TopicState(name, topic.type, publishers, subscribers))
        return states

    def has_subscribers(self, topic_name: str) -> bool:
        """Return whether a node subscribes to the topic, without being an interaction point."""
        topic = self._graph.topics.get(topic_name)
        return topic is not None and bool(topic.subscriptions)

    def services(self) -> list[ServiceState]:
        """Return the services that have a server, by name."""
        served = sorted(self._graph.services.items())
        return [ServiceState(name, one.type, one.node.name) for name, one in served]

    def close(self) -> None:
        """Close all nodes."""
        for node in list(self._nodes.values()):
            node.close()
