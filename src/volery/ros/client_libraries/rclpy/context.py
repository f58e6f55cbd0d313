"""rclpy's ``Context``: the state of one component, its graph nodes, and its shutdown."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.waiting import Signal, current_task, read_clock
from volery.ros.client_libraries.library_base import AtEnd, Launch, LaunchedComponents, ignore_end
from volery.ros.client_libraries.rclpy.exceptions import NameValidationException, NotInitializedException
from volery.ros.graph import Node, RosGraph
from volery.trace.events import Text


class Context:
    """State of one component. ``rclpy.init()`` starts it, ``rclpy.shutdown()`` ends it; it can be restarted.

    As in a launch file, the name of the component names its first node; further nodes keep their own names.
    """

    def __init__(self, graph: RosGraph, component: str, launch: Launch | None, node: Node | None) -> None:
        self._graph = graph
        self._component = component
        self._launch = launch
        self._given = node
        self._nodes: list[Node] = []
        self._started = self._end_requested = False
        self.at_end: AtEnd = ignore_end
        self._hooks: list[Callable[[], Any]] = []
        self.kernel = graph.kernel
        self.changed = Signal(graph.kernel, f"{component} (rclpy)")
        self.executor: Any = None
        """The ``Executor`` of ``rclpy.spin``, or None. It is untyped because executors depend on contexts."""
        self.task = current_task(graph.kernel)

    def init(self, args: Any = None, **options: Any) -> None:
        """Start the context. Options about signals and domains are accepted without effect."""
        if self._started:
            raise RuntimeError("Context.init() must only be called once")
        self._started = True

    def ok(self) -> bool:
        """Return whether the context runs. An interaction point, as every call is."""
        with self.kernel:
            return self._started

    @property
    def running(self) -> bool:
        """Whether the context runs; unlike ``ok``, no interaction point."""
        return self._started

    def on_shutdown(self, callback: Callable[[], Any]) -> None:
        """Call *callback* at shutdown or at the end of the run."""
        if not self._end_requested:
            self._end_requested = True
            self.at_end(self.task.context, self.try_shutdown)
        self.on_end(callback)

    def on_end(self, action: Callable[[], Any]) -> None:
        """Call *action* at shutdown, but not at the end of the run, which it must not delay."""
        self._hooks.append(action)

    def shutdown(self) -> None:
        """End the context: ``spin`` returns. Nodes exist until they are destroyed, but are not spun."""
        if not self._started:
            raise RuntimeError("rcl_shutdown already called on the given context")
        self.try_shutdown()

    def try_shutdown(self) -> None:
        """End the context, if it runs."""
        if self._started:
            self._started = False
            for hook in self._hooks:
                hook()
            self._hooks.clear()
            self.executor = None
            self.changed.notify()

    # -- nodes

    def create_graph_node(self, name: str, namespace: str | None) -> Node:
        """Return a new node of the graph."""
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

    def first_node(self) -> Node:
        """Return the first node, which is charged for calls that name no node."""
        if not self._nodes:
            raise UsageError(f"{self._component}: create a node first")
        return self._nodes[0]

    def close_graph_node(self, node: Node) -> None:
        """Remove a destroyed node from the graph."""
        node.close()
        self.changed.notify()

    def sleep(self, duration: Ns) -> None:
        """Block the current task."""
        self.first_node().sleep(duration)

    def spawn(self, body: Callable[[], None], label: str) -> None:
        """Run *body* in a helper task of this component."""
        context = replace(self.task.context, deadline=None, period=None, on_release=None)
        self.kernel.spawn(body, f"{self._component} ({label})", context, self.task.scope)

    def log(self, severity: int, text: str) -> None:
        """Record a log line. An interaction point."""
        with self.kernel as kernel:
            kernel.record(Text(kernel.now(), self._component, severity, text))


@dataclass(eq=False)
class Contexts(LaunchedComponents):
    """Contexts of all components of one run that import rclpy."""

    levels: dict[str, int] = field(default_factory=dict, init=False)
    """Log levels by logger name."""
    _contexts: dict[str, Context] = field(default_factory=dict, init=False)

    def current(self) -> Context:
        """Return the context of the component that the current task belongs to."""
        component = self.component
        found = self._contexts.get(component)
        if found is None:
            launch, node = self.launch_of(component), self.node_of(component)
            found = self._contexts[component] = Context(self.graph, component, launch, node)
            found.at_end = self.at_end
        return found

    def now(self) -> Ns:
        """Return ROS time. An interaction point."""
        return self.graph.epoch + read_clock(self.kernel)
