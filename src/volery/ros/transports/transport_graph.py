"""A real ROS graph as this process sees it, and ``/clock`` in both directions.

The time of a transport must not run ahead of wall time: the wall clock, a paced virtual one, or one that
follows ``/clock``.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from functools import partial
from time import time_ns
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from volery.base.errors import UsageError
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import Signal
from volery.ros.graph.embedded_graph import record_short
from volery.ros.graph.graph_context import GraphContext, Records
from volery.ros.graph.interface import (
    BEST_AVAILABLE,
    CLOCK,
    CLOCK_PERIOD,
    CLOCK_TYPE,
    NameTakenError,
    QoS,
    RosGraph,
    ServiceState,
    TopicState,
    free,
    no_route,
)
from volery.ros.graph.unserved import PUBLISHED, SUBSCRIBED, KnownParticipants, unserved
from volery.ros.messages import new, to_cdr
from volery.ros.transports.client_library import ClientLibrary, LibraryNode, ReceivedMessage, run_in_thread
from volery.ros.transports.transport_node import TransportNode
from volery.trace.events import WARNING, Text, Unserved

if TYPE_CHECKING:

    def _is_a(graph: TransportGraph) -> RosGraph:
        """Let the type checker verify that the class implements the protocol."""
        return graph


NEWEST = QoS(depth=1, reliability=BEST_AVAILABLE)

Close = Callable[[], None]


@runtime_checkable
class ExternallyClocked(Protocol):
    """A kernel whose time is set from outside."""

    def advance(self, by: Ns) -> None:
        """Let `by` ns pass."""


def publish_clock(graph: GraphContext, library: LibraryNode, period: Ns = CLOCK_PERIOD) -> Close:
    """Publish the kernel's time as ``/clock`` every `period` ns of it; return what ends that."""
    publisher = library.advertise(CLOCK, CLOCK_TYPE, QoS(depth=1))

    def tick() -> None:
        sec, nanosec = divmod(graph.stamp(), S)
        publisher.send(to_cdr(new(CLOCK_TYPE, clock={"sec": sec, "nanosec": nanosec})))

    ticking = graph.kernel.every(period, tick)

    def close() -> None:
        ticking.cancel()
        publisher.close()

    return close


def follow_clock(graph: GraphContext, library: LibraryNode, since: Ns | None = None) -> Close:
    """Set the kernel's time from ``/clock``; return what ends that.

    The kernel's time never goes back: where ``/clock`` does (a simulation or a recording starts anew), ROS
    time goes back, and waits continue for the time that is left.

    Args:
        graph: Graph whose kernel and epoch are set.
        library: Node that subscribes to ``/clock``.
        since: ROS time at the kernel's zero, ns; None takes the first time that is received.

    Raises:
        UsageError: the kernel's time passes by itself.
    """
    kernel = graph.kernel
    if not isinstance(kernel, ExternallyClocked):
        raise UsageError(
            f"a {type(kernel).__name__} keeps its own time; to follow {CLOCK} take a FollowingKernel"
        )
    guard = threading.Lock()
    last = [] if since is None else [since]

    def arrived(received: ReceivedMessage) -> None:
        stamp = received.read(received.data).clock.to_nsec()
        with guard:
            if last and stamp >= last[0]:
                kernel.advance(stamp - last[0])
            else:
                graph.epoch = stamp - graph.kernel.now()
            last[:] = [stamp]

    return library.subscribe(CLOCK, CLOCK_TYPE, NEWEST, arrived).close


class TransportGraph:
    """The nodes of this process on a real ROS graph.

    Args:
        kernel: Clock and tasks of the nodes.
        library: Client library that connects them.
        records: What is recorded of each topic; here of long messages the content as well.
        epoch: ROS time at the kernel's zero, ns; by default the Unix time then.
    """

    def __init__(
        self,
        kernel: Kernel,
        library: ClientLibrary,
        *,
        records: Records = record_short,
        epoch: Ns | None = None,
    ) -> None:
        self.kernel = kernel
        self._since = epoch
        if epoch is None:
            epoch = time_ns() - kernel.now()
        self._graph = GraphContext(kernel, free, no_route, records, epoch, Signal(kernel, "the ROS graph"))
        self._library = library
        self._nodes: dict[str, TransportNode] = {}
        self._numbers = 0

    def notice(self) -> None:
        """Note for ``unserved`` which topics of this process have another side now, else what is there."""
        for node in list(self._nodes.values()):  # of other threads, too
            node.notice()
        wants, now = self._graph.wants, self.kernel.now()
        if all(entry.met for entry in list(wants.entries.values()) if entry.node in self._nodes):
            return
        for topic in self.topics():
            for kind, nodes in ((PUBLISHED, topic.publishers), (SUBSCRIBED, topic.subscribers)):
                for node_name in nodes:
                    wants.of(kind, topic.name, topic.type, ("", node_name), now)
        wants.served.update((service.name, service.type) for service in self.services())

    def unserved(self, around: KnownParticipants) -> list[Unserved]:
        """Return what components of this process have offered or asked for and no node took or served."""
        return unserved(self._graph.wants, around, self.kernel.now())

    @property
    def epoch(self) -> Ns:
        """ROS time at the kernel's zero, ns."""
        return self._graph.epoch

    def node(
        self,
        name: str,
        namespace: str = "/",
        *,
        remaps: Mapping[str, str] | None = None,
        anonymous: bool = False,
        context: ExecutionContext | None = None,
    ) -> TransportNode:
        """Join the graph; see ``RosGraph.node``. `anonymous` appends the time and a number to the name.

        Raises:
            UsageError: the name is not valid or is taken.
            LinkError: the graph cannot be reached.
        """
        if anonymous:
            self._numbers += 1
            name = f"{name}_{time_ns() // 1000}_{self._numbers}"
        task = self.kernel.current()
        context = context or (task.context if task is not None else ExecutionContext(name))
        made = TransportNode(self._graph, name, namespace, remaps or {}, context)
        if made.name in self._nodes:
            raise NameTakenError(
                f"a node named {made.name} is there already, in this process; choose another name"
            )
        join = partial(self._library.join, name, namespace, partial(self._lost, made))
        self._nodes[made.name] = made
        try:
            made.join(run_in_thread(self.kernel, f"joining as {made.name}", join))
        except BaseException:
            del self._nodes[made.name]
            raise
        made.on_close = partial(self._leave, made)
        return made

    def _lost(self, node: TransportNode, why: str) -> None:
        """Close a node that the graph has removed. Called by a thread of the client library."""

        def close() -> None:
            if not node.closed:
                self.kernel.record(Text(self.kernel.now(), node.name, WARNING, f"{node.name}: {why}"))
                node.removed(why)

        self.kernel.post(close)

    def _leave(self, node: TransportNode) -> None:
        del self._nodes[node.name]
        node.library.close()

    def publish_clock(self, node: TransportNode | str = "clock", period: Ns = CLOCK_PERIOD) -> None:
        """Publish ``/clock`` from `node`, or from a new one of that name, as the time of other nodes.

        On ROS 1 ``/use_sim_time`` is set, which nodes read when they start; on ROS 2 each node has its own
        parameter ``use_sim_time``.
        """
        self._start_clock(node, partial(publish_clock, period=period), self._library.announce_clock)

    def follow_clock(self, node: TransportNode | str = "clock_listener") -> None:
        """Set the kernel's time from ``/clock``, received by `node` or by a new one of that name.

        Time stands still until the first message. Raises ``UsageError`` for a kernel that keeps its own time.
        """
        self._start_clock(node, partial(follow_clock, since=self._since))

    def _start_clock(
        self,
        where: TransportNode | str,
        start: Callable[[GraphContext, LibraryNode], Close],
        before: Callable[[], None] = lambda: None,
    ) -> None:
        node = self.node(where) if isinstance(where, str) else where

        def begin() -> Close:
            before()
            return start(self._graph, node.library)

        node.close_with_node(run_in_thread(self.kernel, "/clock", begin))

    def warn(self, text: str) -> None:
        """Record a warning of the client library. From any thread."""
        self.kernel.post(lambda: self.kernel.record(Text(self.kernel.now(), "ROS", WARNING, text)))

    def node_names(self) -> list[str]:
        """Return the names of all nodes, sorted."""
        return run_in_thread(self.kernel, "the nodes of the graph", self._library.node_names)

    def topics(self) -> list[TopicState]:
        """Return the topics that have a publisher or a subscription, by name."""
        return run_in_thread(self.kernel, "the topics of the graph", self._library.topics)

    def offered(self, topic: str) -> tuple[QoS, ...]:
        """Return what the publishers of a topic offer."""
        return run_in_thread(self.kernel, f"what {topic} offers", partial(self._library.offered, topic))

    def services(self) -> list[ServiceState]:
        """Return the services that have a server, by name."""
        return run_in_thread(self.kernel, "the services of the graph", self._library.services)

    def close(self) -> None:
        """Close all nodes of this process, and the client library."""
        for node in list(self._nodes.values()):
            node.close()
        self._library.close()
