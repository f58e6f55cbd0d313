"""What one component is to rclpy: its context, its nodes, and whether it is shutting down."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.waiting import Signal, current_task
from volery.ros.client_libraries.library_base import AtEnd, Launch, LaunchedComponents, ignore_end
from volery.ros.client_libraries.rclpy.errors import NameValidationException, NotInitializedException
from volery.ros.graph import Node, RosGraph
from volery.trace.events import Text

if TYPE_CHECKING:
    from volery.ros.client_libraries.rclpy.executors import Executor


class Context:
    """One component's. ``rclpy.init()`` starts it, ``rclpy.shutdown()`` ends it; it may be started again.

    The first node that it makes is called as the component is, whatever the file says, as a launch file does
    it; further ones keep their own names.
    """

    def __init__(self, graph: RosGraph, component: str, launch: Launch | None, node: Node | None) -> None:
        self._graph = graph
        self._component = component
        self._launch = launch
        self._given = node
        self._nodes: list[Node] = []
        self._started = self._asked = False
        self.at_end: AtEnd = ignore_end
        self._hooks: list[Callable[[], Any]] = []
        self.kernel = graph.kernel
        self.changed = Signal(graph.kernel, f"{component} (rclpy)")
        self.executor: Executor | None = None
        """The one that ``rclpy.spin`` uses."""
        self.task = current_task(graph.kernel)

    def init(self, args: Any = None, **options: Any) -> None:
        """Start it. Options about signals and domains are accepted and mean nothing here."""
        if self._started:
            raise RuntimeError("Context.init() must only be called once")
        self._started = True

    def ok(self) -> bool:
        """Whether it runs. An interaction point, as every call is."""
        with self.kernel:
            return self._started

    @property
    def running(self) -> bool:
        """``ok`` without being an interaction point."""
        return self._started

    def on_shutdown(self, callback: Callable[[], Any]) -> None:
        """Call it at shutdown, or when the run ends."""
        if not self._asked:
            self._asked = True
            self.at_end(self.task.place, self.try_shutdown)
        self.when_over(callback)

    def when_over(self, action: Callable[[], Any]) -> None:
        """``on_shutdown`` of the house's own: nothing that keeps a run from ending."""
        self._hooks.append(action)

    def shutdown(self) -> None:
        """End it: who spins returns. Nodes stay until they are destroyed, but nothing spins them."""
        if not self._started:
            raise RuntimeError("rcl_shutdown already called on the given context")
        self.try_shutdown()

    def try_shutdown(self) -> None:
        """End it, if it runs."""
        if self._started:
            self._started = False
            for hook in self._hooks:
                hook()
            self._hooks.clear()
            self.executor = None
            self.changed.notify()

    # -- nodes

    def join(self, name: str, namespace: str | None) -> Node:
        """A new node of the graph."""
        if not self._started:
            raise NotInitializedException("cannot create node: rclpy.init() has not been called")
        if not re.fullmatch(r"[A-Za-z_]\w*", name):
            raise NameValidationException(f"Invalid node name: {name!r}: letters, digits and underscores")
        first = not self._nodes and self._launch is not None
        launch = self._launch or Launch()
        where = namespace if namespace is not None and launch.namespace == "/" else launch.namespace
        where = where if where.startswith("/") else f"/{where}"
        made = self._given if first else None
        if made is None:
            label = re.sub(r"\W", "_", self._component) if first else name
            made = self._graph.node(label, where, remaps=launch.remaps)
        if first:
            for key, value in launch.parameters.items():
                made.set_parameter(f"~{key.replace('.', '/')}", value)
        self._nodes.append(made)
        return made

    def node(self) -> Node:
        """Its first node: who pays for what no node is named for."""
        if not self._nodes:
            raise UsageError(f"{self._component}: create a node first")
        return self._nodes[0]

    def leave(self, node: Node) -> None:
        """A node was destroyed."""
        node.close()
        self.changed.notify()

    def sleep(self, duration: Ns) -> None:
        """Block the current task."""
        self.node().sleep(duration)

    def spawn(self, body: Callable[[], None], label: str) -> None:
        """A helping task of this component."""
        place = replace(self.task.place, deadline=None, on_release=None)
        self.kernel.spawn(body, f"{self._component} ({label})", place, self.task.scope)

    def say(self, severity: int, text: str) -> None:
        """Record a log line. An interaction point."""
        with self.kernel as kernel:
            kernel.record(Text(kernel.now(), self._component, severity, text))


@dataclass(eq=False)
class Contexts(LaunchedComponents):
    """All components of one run that import rclpy."""

    levels: dict[str, int] = field(default_factory=dict, init=False)
    """Of loggers, by name."""
    _contexts: dict[str, Context] = field(default_factory=dict, init=False)

    def here(self) -> Context:
        """That of the component that the current task computes for."""
        component = self.component
        found = self._contexts.get(component)
        if found is None:
            launch, node = self.launch_of(component), self.node_of(component)
            found = self._contexts[component] = Context(self.graph, component, launch, node)
            found.at_end = self.at_end
        return found

    def now(self) -> Ns:
        """ROS time; an interaction point."""
        with self.kernel as kernel:
            return self.graph.epoch + kernel.now()
