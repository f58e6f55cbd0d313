"""``/clock`` in both directions: telling others our time, and taking theirs.

A real ROS graph as this process sees it.
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
from volery.ros.graph.embedded_graph import record_all
from volery.ros.graph.graph_context import GraphContext, Records
from volery.ros.graph.interface import (
    BEST_AVAILABLE,
    CLOCK,
    CLOCK_PERIOD,
    CLOCK_TYPE,
    QoS,
    RosGraph,
    ServiceState,
    TopicState,
    free,
    no_route,
)
from volery.ros.messages import new, to_cdr
from volery.ros.transports.blocking_calls import run_in_thread
from volery.ros.transports.client_library import ClientLibrary, LibraryNode, ReceivedMessage
from volery.ros.transports.transport_node import WARNING, TransportNode
from volery.trace.events import Text

if TYPE_CHECKING:

    def _is_a(graph: TransportGraph) -> RosGraph:
        """Checked by the type checker: it has all that a graph has."""
        return graph


NEWEST = QoS(depth=1, reliability=BEST_AVAILABLE)


@runtime_checkable
class ExternallyClocked(Protocol):
    """A kernel whose time can be told to go on."""

    def advance(self, by: Ns) -> None:
        """Let time pass."""


def publish_clock(context: GraphContext, wire: LibraryNode, period: Ns = CLOCK_PERIOD) -> Callable[[], None]:
    """Publish the kernel's time as ``/clock`` each *period* of it, whoever listens. Returns what ends it."""
    outlet = wire.advertise(CLOCK, CLOCK_TYPE, QoS(depth=1))

    def tick() -> None:
        sec, nanosec = divmod(context.stamp(), S)
        outlet.send(to_cdr(new(CLOCK_TYPE, clock={"sec": sec, "nanosec": nanosec})))

    ticking = context.kernel.every(period, tick)

    def end() -> None:
        ticking.cancel()
        outlet.close()

    return end


def follow_clock(context: GraphContext, wire: LibraryNode, since: Ns | None = None) -> Callable[[], None]:
    """Let the kernel's time be what ``/clock`` says. Returns what ends it.

    *since* is ROS time at the kernel's zero, where that is agreed; else it is what is heard first.

    The kernel's time never goes back: where ``/clock`` does (a simulation or a recording begins anew), ROS
    time does, and what waits goes on waiting for the time that is left. ``UsageError`` for a kernel whose
    time passes by itself.
    """
    kernel = context.kernel
    if not isinstance(kernel, ExternallyClocked):
        raise UsageError(
            f"a {type(kernel).__name__} keeps its own time; to follow {CLOCK} take a FollowingKernel"
        )
    guard = threading.Lock()
    last = [] if since is None else [since]

    def arrived(parcel: ReceivedMessage) -> None:
        stamp = parcel.read(parcel.data).clock.to_nsec()
        with guard:
            if last and stamp >= last[0]:
                kernel.advance(stamp - last[0])
            else:
                context.epoch = stamp - context.kernel.now()
            last[:] = [stamp]

    return wire.subscribe(CLOCK, CLOCK_TYPE, NEWEST, arrived).close


class TransportGraph:
    """The nodes of this process on a real ROS graph.

    *epoch* is what ROS time is at the kernel's zero: by default the Unix time then.
    """

    def __init__(
        self,
        kernel: Kernel,
        library: ClientLibrary,
        *,
        records: Records = record_all,
        epoch: Ns | None = None,
    ) -> None:
        self.kernel = kernel
        self._since = epoch
        if epoch is None:
            epoch = time_ns() - kernel.now()
        self._context = GraphContext(kernel, free, no_route, records, epoch, Signal(kernel, "the ROS graph"))
        self._library = library
        self._nodes: dict[str, TransportNode] = {}
        self._numbers = 0

    @property
    def epoch(self) -> Ns:
        """What ROS time is at the kernel's zero."""
        return self._context.epoch

    def node(
        self,
        name: str,
        namespace: str = "/",
        *,
        remaps: Mapping[str, str] | None = None,
        anonymous: bool = False,
        context: ExecutionContext | None = None,
    ) -> TransportNode:
        """Join the graph as *name*.

        *anonymous* adds the time and a number to the name. Raises ``UsageError`` for an invalid name or one
        that is taken, ``LinkError`` if the graph cannot be reached.
        """
        if anonymous:
            self._numbers += 1
            name = f"{name}_{time_ns() // 1000}_{self._numbers}"
        task = self.kernel.current()
        here = context or (task.context if task is not None else ExecutionContext(name))
        made = TransportNode(self._context, name, namespace, remaps or {}, here)
        if made.name in self._nodes:
            raise UsageError(
                f"a node named {made.name} is there already, in this process; choose another name"
            )
        lost = partial(self._lost, made)
        self._nodes[made.name] = made
        try:
            made.join(
                run_in_thread(
                    self.kernel, f"joining as {made.name}", lambda: self._library.wire(name, namespace, lost)
                )
            )
        except BaseException:
            del self._nodes[made.name]
            raise
        made.on_close = partial(self._leave, made)
        return made

    def _lost(self, node: TransportNode, why: str) -> None:
        """A thread of the client library says that *node* was thrown out."""

        def tell() -> None:
            if not node.closed:
                self.kernel.record(Text(self.kernel.now(), node.name, WARNING, f"{node.name}: {why}"))
                node.thrown_out(why)

        self.kernel.post(tell)

    def _leave(self, node: TransportNode) -> None:
        del self._nodes[node.name]
        node.part()

    def tell_clock(self, node: TransportNode | str = "clock", period: Ns = CLOCK_PERIOD) -> None:
        """Publish ``/clock`` from *node* (or a new one of that name), for others to use as their time.

        On ROS 1 ``/use_sim_time`` is set, which nodes read when they start; on ROS 2 each node is told by
        its own parameter ``use_sim_time``.
        """
        self._keep_time(node, partial(publish_clock, period=period), self._library.announce_clock)

    def follow_clock(self, node: TransportNode | str = "clock_listener") -> None:
        """Let the kernel's time be what ``/clock`` says, heard by *node* (or a new one of that name).

        Until it says something, time stands still. ``UsageError`` for a kernel that keeps its own time.
        """
        self._keep_time(node, partial(follow_clock, since=self._since))

    def _keep_time(
        self,
        where: TransportNode | str,
        way: Callable[[GraphContext, LibraryNode], Callable[[], None]],
        before: Callable[[], None] = lambda: None,
    ) -> None:
        node = self.node(where) if isinstance(where, str) else where

        def begin() -> Callable[[], None]:
            before()
            return way(self._context, node.wire)

        node.keep(run_in_thread(self.kernel, "/clock", begin))

    def warn(self, text: str) -> None:
        """Record what the client library says went wrong. From any thread."""
        self.kernel.post(lambda: self.kernel.record(Text(self.kernel.now(), "ROS", WARNING, text)))

    def node_names(self) -> list[str]:
        """Who is there, sorted."""
        return run_in_thread(self.kernel, "the nodes of the graph", self._library.node_names)

    def topics(self) -> list[TopicState]:
        """The topics that somebody publishes or subscribes to, by name."""
        return run_in_thread(self.kernel, "the topics of the graph", self._library.topics)

    def services(self) -> list[ServiceState]:
        """The services that somebody serves, by name."""
        return run_in_thread(self.kernel, "the services of the graph", self._library.services)

    def close(self) -> None:
        """All nodes leave the graph."""
        for node in list(self._nodes.values()):
            node.close()
        self._library.close()
