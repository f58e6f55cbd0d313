"""The nodes of an rclcpp component, and their groups of callbacks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from volery.base.errors import UsageError
from volery.kernel.waiting import Signal, current_task
from volery.ros.client_libraries.cpp.session import CppSession
from volery.ros.client_libraries.library_base import Launch, node_of_file
from volery.ros.client_libraries.rclpy.context import NotInitializedException, private_name
from volery.ros.client_libraries.rclpy.names import (
    substituted,
    validate_namespace,
    validate_node_name,
    validate_topic_name,
)
from volery.ros.graph import Node, ReadyCallbacks


class CallbackQueue:
    """Ready callbacks of one group of a node; of an exclusive group one runs at a time."""

    def __init__(self, ready: ReadyCallbacks, *, exclusive: bool, automatic: bool) -> None:
        self.ready, self.exclusive, self.automatic = ready, exclusive, automatic
        self.running = False

    def may_run(self) -> bool:
        """Return whether a callback of the group may start."""
        return not (self.exclusive and self.running)


class RosNode:
    """A node of a component with its groups."""

    def __init__(self, node: Node, changed: Signal) -> None:
        self.node, self._changed = node, changed
        self.queues: list[CallbackQueue] = []
        self.executor: Any = None
        """The executor that spins the node, or None. It is untyped because executors depend on nodes."""
        self.parameters: Any = None
        """Its ``DeclaredParameters``, which depend on the node."""

    def add_queue(self, *, exclusive: bool, automatic: bool = True) -> CallbackQueue:
        """Return a new group of callbacks."""
        ready = self.node.group()
        ready.on_ready = self._changed.notify
        made = CallbackQueue(ready, exclusive=exclusive, automatic=automatic)
        self.queues.append(made)
        if self.executor is not None:
            self.executor.changed()
        return made

    def absolute_name(self, name: str, *, is_service: bool = False) -> str:
        """Return a checked name with its substitutions made, for the graph."""
        validate_topic_name(name, is_service=is_service)
        own, where = self.node.name.rpartition("/")[2], self.node.namespace
        return substituted(name, own, where) if "{" in name else name

    def close(self) -> None:
        """Leave the executor and the graph."""
        if self.executor is not None:
            self.executor.remove(self)
        self.node.close()


@dataclass(eq=False)
class Session(CppSession):
    """What one component uses of rclcpp, from ``rclcpp::init`` on."""

    initialized: bool = False
    _nodes: list[RosNode] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.ready = Signal(self.kernel, f"{self.component} (an executor's callbacks)")

    def init(self) -> None:
        """Start, also again after a shutdown."""
        self.initialized, self.finished = True, False
        self.main = current_task(self.kernel)

    @property
    def running(self) -> bool:
        """Whether the component is between init and shutdown; no interaction point."""
        return self.initialized and not self.finished

    def ok(self) -> bool:
        """Return whether the component is between init and shutdown. An interaction point."""
        with self.kernel.interact():
            return self.running

    @property
    def opened(self) -> Node | None:
        """The first node that has not left the graph, or None."""
        return next((one.node for one in self._nodes if not one.node.closed), None)

    @property
    def node(self) -> Node:
        """The first node. Raises ``UsageError`` if there is none."""
        if self.opened is None:
            raise UsageError(f"{self.component}: create a node first")
        return self.opened

    def create_node(self, name: str, namespace: str, launch: Launch) -> RosNode:
        """Return a new node, which *launch* names if it is the first."""
        if not self.running:
            raise NotInitializedException("failed to create a node: call rclcpp::init() first")
        validate_node_name(name)
        if namespace:
            validate_namespace(namespace if namespace.startswith("/") else f"/{namespace}")
        first = not self._nodes
        where = namespace if namespace and launch.namespace == "/" else launch.namespace
        where = where if where.startswith("/") else f"/{where}"
        given = self.nodes.get(self.component) if first else None
        node = node_of_file(self.graph, self.component, name, launch, given, namespace=where, first=first)
        if first:
            for key, value in launch.parameters.items():
                node.set_parameter(private_name(key), value)
        made = RosNode(node, self.ready)
        self._nodes.append(made)
        return made

    def launched(self, node: RosNode) -> Mapping[str, Any]:
        """Return the parameters that a node was launched with."""
        return self.launch.parameters if node is self._nodes[0] else {}

    def queue(self, number: int) -> CallbackQueue:
        """Return the group of callbacks with a number."""
        return self.find(number, CallbackQueue)

    def group(self, number: int) -> ReadyCallbacks:
        """Return the queue on the graph of a group with a number; -1 is the first node's own."""
        return self.node.own_group if number < 0 else self.queue(number).ready

    def shut_down(self) -> None:
        """Let executors return; nodes exist until they are destroyed."""
        self.finished = True
        self.ready.notify()
        self.changed.notify()

    def end(self) -> None:
        """Shut down and leave the graph, as a process that ends."""
        self.shut_down()
        for one in self._nodes:
            one.close()
