"""A real ROS graph as this process sees it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from time import time_ns
from typing import TYPE_CHECKING

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.kernel.task import Place
from volery.kernel.waiting import Signal
from volery.ros.graph.clock import CLOCK_PERIOD
from volery.ros.graph.context import Context, Records
from volery.ros.graph.graph import everything
from volery.ros.graph.node import RosGraph, ServiceState, TopicState, at_once, free
from volery.ros.transports import clock
from volery.ros.transports.abroad import abroad
from volery.ros.transports.node import TransportNode
from volery.ros.transports.topics import WARNING
from volery.ros.transports.wire import Library, Wire
from volery.trace.events import Text

if TYPE_CHECKING:

    def _is_a(graph: TransportGraph) -> RosGraph:
        """Checked by the type checker: it has all that a graph has."""
        return graph


class TransportGraph:
    """The nodes of this process on a real ROS graph.

    *epoch* is what ROS time is at the kernel's zero: by default the Unix time then.
    """

    def __init__(
        self, kernel: Kernel, library: Library, *, records: Records = everything, epoch: Ns | None = None
    ) -> None:
        self.kernel = kernel
        self._since = epoch
        if epoch is None:
            epoch = time_ns() - kernel.now()
        self._context = Context(kernel, free, at_once, records, epoch, Signal(kernel, "the ROS graph"))
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
        place: Place | None = None,
    ) -> TransportNode:
        """Join the graph as *name*.

        *anonymous* adds the time and a number to the name. Raises ``UsageError`` for an invalid name or one
        that is taken, ``LinkError`` if the graph cannot be reached.
        """
        if anonymous:
            self._numbers += 1
            name = f"{name}_{time_ns() // 1000}_{self._numbers}"
        task = self.kernel.current()
        here = place or (task.place if task is not None else Place(name))
        made = TransportNode(self._context, name, namespace, remaps or {}, here)
        if made.name in self._nodes:
            raise UsageError(
                f"a node named {made.name} is there already, in this process; choose another name"
            )
        lost = partial(self._lost, made)
        self._nodes[made.name] = made
        try:
            made.join(
                abroad(
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
        self._keep_time(node, partial(clock.tell, period=period), self._library.announce_clock)

    def follow_clock(self, node: TransportNode | str = "clock_listener") -> None:
        """Let the kernel's time be what ``/clock`` says, heard by *node* (or a new one of that name).

        Until it says something, time stands still. ``UsageError`` for a kernel that keeps its own time.
        """
        self._keep_time(node, partial(clock.follow, since=self._since))

    def _keep_time(
        self,
        where: TransportNode | str,
        way: Callable[[Context, Wire], Callable[[], None]],
        before: Callable[[], None] = lambda: None,
    ) -> None:
        node = self.node(where) if isinstance(where, str) else where

        def begin() -> Callable[[], None]:
            before()
            return way(self._context, node.wire)

        node.keep(abroad(self.kernel, "/clock", begin))

    def warn(self, text: str) -> None:
        """Record what the client library says went wrong. From any thread."""
        self.kernel.post(lambda: self.kernel.record(Text(self.kernel.now(), "ROS", WARNING, text)))

    def node_names(self) -> list[str]:
        """Who is there, sorted."""
        return abroad(self.kernel, "the nodes of the graph", self._library.node_names)

    def topics(self) -> list[TopicState]:
        """The topics that somebody publishes or subscribes to, by name."""
        return abroad(self.kernel, "the topics of the graph", self._library.topics)

    def services(self) -> list[ServiceState]:
        """The services that somebody serves, by name."""
        return abroad(self.kernel, "the services of the graph", self._library.services)

    def close(self) -> None:
        """All nodes leave the graph."""
        for node in list(self._nodes.values()):
            node.close()
        self._library.close()
