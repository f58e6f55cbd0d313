"""The embedded ROS graph: nothing to install, one kernel's time, every call priced and every message carried.

What a call costs and how a message travels are asked of two functions that are given from above; the graph
knows neither laws nor networks.

``/clock``: ticks while somebody listens, and costs nobody anything: it is no part of the system.
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
    Price,
    RosGraph,
    Routing,
    ServiceState,
    TopicState,
    free,
    no_route,
)
from volery.ros.messages import cdr_size, new

if TYPE_CHECKING:

    def _is_a(graph: EmbeddedGraph) -> RosGraph:
        """Checked by the type checker: it has all that a graph has."""
        return graph


class ClockPublisher:
    """The publisher of ``/clock``."""

    def __init__(self, context: GraphContext) -> None:
        self._context = context
        self._ticking: Handle | None = None

    def listen(self) -> None:
        """Somebody has subscribed: tick, if it does not tick already."""
        if self._ticking is None:
            self._ticking = self._context.kernel.every(CLOCK_PERIOD, self._tick)

    def _tick(self) -> None:
        listeners = self._context.topics[CLOCK].subscriptions
        if not listeners and self._ticking is not None:
            self._ticking.cancel()
            self._ticking = None
        now = self._context.kernel.now()
        stamp = self._context.stamp()
        for subscription in tuple(listeners):
            message = new(CLOCK_TYPE, clock={"sec": stamp // S, "nanosec": stamp % S})
            subscription.arrive(message, now, CLOCK, cdr_size(message))


def record_all(topic_name: str) -> bool:
    """Record the content of all topics."""
    return True


def _nothing(topic_name: str) -> bool:
    return False


class EmbeddedGraph:
    """One ROS graph.

    *price* says what a call takes, *between* how messages get from node to node. *records* says for which
    topics the content of messages is recorded. *epoch* is what ROS time is at the kernel's zero: 0 in virtual
    time, the Unix time in ns on the wall clock. ``/clock`` ticks each 10 ms of the kernel's time while
    somebody subscribes to it.

    *unrecorded*: nothing of it is recorded at all; for a graph that is no part of a system, such as the wire
    to a simulated vehicle. *as_bytes*: messages make the trip through their bytes, so that they have the
    digits that a transport carries, and no more.
    """

    def __init__(
        self,
        kernel: Kernel,
        price: Price = free,
        between: Routing = no_route,
        *,
        records: Records = record_all,
        epoch: Ns = 0,
        unrecorded: bool = False,
        as_bytes: bool = False,
    ) -> None:
        self.kernel = kernel
        self._context = GraphContext(
            kernel,
            price,
            between,
            _nothing if unrecorded else records,
            epoch,
            Signal(kernel, "the ROS graph"),
            unrecorded=unrecorded,
            as_bytes=as_bytes,
        )
        self._context.listen_to_clock = ClockPublisher(self._context).listen
        self._nodes: dict[str, EmbeddedNode] = {}

    @property
    def epoch(self) -> Ns:
        """What ROS time is at the kernel's zero."""
        return self._context.epoch

    @property
    def parameters(self) -> Parameters:
        """All parameters, by absolute name."""
        return self._context.parameters

    def node(
        self,
        name: str,
        namespace: str = "/",
        *,
        remaps: Mapping[str, str] | None = None,
        anonymous: bool = False,
        context: ExecutionContext | None = None,
    ) -> EmbeddedNode:
        """Join the graph as *name*; priced as ``init`` and ``node_handle``.

        *place* is where the node's computing is spent, that of the current task if it is not given.
        *anonymous* adds a number to the name. Raises ``UsageError`` for an invalid name or one that is
        taken.
        """
        with self.kernel:
            if anonymous:
                name = self._numbered(name, namespace)
            made = EmbeddedNode(self._context, name, namespace, remaps or {}, context or self._here(name))
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

    def _here(self, name: str) -> ExecutionContext:
        task = self.kernel.current()
        return task.context if task is not None else ExecutionContext(name)

    def _numbered(self, name: str, namespace: str) -> str:
        number = 1
        while f"{namespace.rstrip('/')}/{name}_{number}" in self._nodes:
            number += 1
        return f"{name}_{number}"

    def _forget(self, node: EmbeddedNode) -> None:
        del self._nodes[node.name]

    def node_names(self) -> list[str]:
        """Who is there, sorted."""
        return sorted(self._nodes)

    def topics(self) -> list[TopicState]:
        """The topics that somebody publishes or subscribes to, by name."""
        states = []
        for name, at in sorted(self._context.topics.items()):
            publishers = tuple(one.member.name for one in at.publishers)
            subscribers = tuple(one.member.name for one in at.subscriptions)
            if publishers or subscribers:
                states.append(TopicState(name, at.type, publishers, subscribers))
        return states

    def heard(self, topic_name: str) -> bool:
        """Whether somebody subscribes to the topic; without being an interaction point."""
        at = self._context.topics.get(topic_name)
        return at is not None and bool(at.subscriptions)

    def services(self) -> list[ServiceState]:
        """The services that somebody serves, by name."""
        served = sorted(self._context.services.items())
        return [ServiceState(name, one.type, one.member.name) for name, one in served]

    def close(self) -> None:
        """All nodes leave the graph."""
        for node in list(self._nodes.values()):
            node.close()
