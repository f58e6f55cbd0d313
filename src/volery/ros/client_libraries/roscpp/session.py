"""The node of a roscpp component."""

from __future__ import annotations

from dataclasses import dataclass

from volery.base.errors import UsageError
from volery.kernel.waiting import Signal
from volery.ros.client_libraries.cpp.session import CppSession
from volery.ros.client_libraries.library_base import node_of_file
from volery.ros.graph import Node


@dataclass(eq=False)
class Session(CppSession):
    """The node of one component; it exists from ``ros::init`` on."""

    _node: Node | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self._ended = Signal(self.kernel, f"{self.component} (ros::waitForShutdown)")

    def join(self, name: str, anonymous: bool) -> None:
        """Execute ``ros::init``; a second call changes nothing."""
        if self._node is not None:
            return
        given = self.nodes.get(self.component)
        node = node_of_file(self.graph, self.component, name, self.launch, given, anonymous=anonymous)
        for key, value in self.launch.parameters.items():
            node.set_parameter(key if key.startswith("/") else f"~{key}", value)
        self._node = node

    @property
    def opened(self) -> Node | None:
        """The node, or None before ``ros::init``."""
        return self._node

    @property
    def node(self) -> Node:
        """The node. Raises ``UsageError`` before ``ros::init``."""
        if self._node is None:
            raise UsageError(f"{self.component}: call ros::init() before the first ros::NodeHandle")
        return self._node

    def ok(self) -> bool:
        """Return whether the node exists and is not shut down. An interaction point."""
        with self.kernel.interact():
            return self._node is not None and not self.finished

    def end(self) -> None:
        """Shut down: leave the graph; spinning tasks return."""
        if not self.finished:
            self.finished = True
            if self._node is not None:
                self._node.close()
            self._ended.notify()
            self.changed.notify()

    def wait_for_end(self) -> None:
        """Block until the shutdown."""
        self._ended.wait_for(lambda: self.finished, ends_activation=True)
