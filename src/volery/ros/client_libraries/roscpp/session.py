"""A C++ component's node: what it has on the graph, by the numbers that its code knows them by."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.task import Task
from volery.kernel.waiting import Signal, current_task
from volery.ros.client_libraries.abi_codec import CppFiber
from volery.ros.client_libraries.library_base import Launch
from volery.ros.graph import Node, RosGraph, ServiceError

Thing = TypeVar("Thing")


class Closes(Protocol):
    """What a node has on the graph."""

    def close(self) -> None:
        """It is gone."""


class RefusedRequestError(ServiceError):
    """A handler of the code returned false: its caller is told, the code itself goes on."""


@dataclass(eq=False)
class Session:
    """The node of the component called *component*; there is none before ``ros::init``.

    *nodes* holds, by component, nodes that are there already: ``ros::init`` finds its own there.
    """

    graph: RosGraph
    component: str
    launch: Launch
    nodes: Mapping[str, Node] = field(default_factory=dict)
    opened: Node | None = None
    finished: bool = False
    _things: dict[int, Any] = field(default_factory=dict)
    _spinning: dict[Task, CppFiber] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.kernel = self.graph.kernel
        self._ended = Signal(self.kernel, f"{self.component} (ros::waitForShutdown)")

    def join(self, name: str, anonymous: bool) -> None:
        """``ros::init``: a second call changes nothing."""
        if self.opened is not None:
            return
        launched = self.component != ""
        label = re.sub(r"\W", "_", self.component if launched else name)
        node = self.nodes.get(self.component) or self.graph.node(
            label, self.launch.namespace, remaps=self.launch.remaps, anonymous=anonymous and not launched
        )
        for key, value in self.launch.parameters.items():
            node.set_parameter(f"~{key}", value)
        self.opened = node

    @property
    def node(self) -> Node:
        """The node; ``UsageError`` before ``ros::init``."""
        if self.opened is None:
            raise UsageError(f"{self.component}: call ros::init() before the first ros::NodeHandle")
        return self.opened

    def ok(self) -> bool:
        """Whether it has joined and is not shutting down. An interaction point."""
        with self.kernel:
            return self.opened is not None and not self.finished

    def end(self) -> None:
        """Shut down: leave the graph, let those who spin return."""
        if not self.finished:
            self.finished = True
            if self.opened is not None:
                self.opened.close()
            self._ended.notify()

    def wait_for_end(self) -> None:
        """Block until it shuts down."""
        self._ended.wait_for(lambda: self.finished, ends_activation=True)

    def now(self) -> Ns:
        """ROS time; an interaction point, also before ``ros::init``."""
        with self.kernel as kernel:
            return self.graph.epoch + kernel.now()

    # -- what the code holds

    def keep(self, thing: object) -> int:
        """The number of *thing* from now on."""
        number = len(self._things)
        self._things[number] = thing
        return number

    def find(self, number: int, kind: type[Thing]) -> Thing:
        """What has that number."""
        thing = self._things[number]
        assert isinstance(thing, kind), f"{number} is no {kind.__name__}"
        return thing

    def thing(self, number: int) -> Any:
        """What has that number, of whatever kind."""
        return self._things[number]

    def close(self, number: int) -> None:
        """Take it off the graph."""
        self._things[number].close()

    # -- callbacks run on the stack of whoever spins

    def spin(self, flow: CppFiber, spinning: Callable[[], object]) -> None:
        """Run *spinning*, which runs callbacks, for the flow that asked for it."""
        task = current_task(self.kernel)
        before = self._spinning.get(task)
        self._spinning[task] = flow
        try:
            while True:
                try:
                    spinning()
                except RefusedRequestError:
                    continue
                break
        finally:
            if before is None:
                del self._spinning[task]
            else:
                self._spinning[task] = before

    def call_back(self, callable_number: int, argument: bytes) -> bytes:
        """Run a callback of the code; called while ``spin`` is under way."""
        return self._spinning[current_task(self.kernel)].call(callable_number, argument)
