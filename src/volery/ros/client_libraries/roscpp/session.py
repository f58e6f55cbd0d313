"""The node of a C++ component and the entities that its code refers to by number."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.task import Task
from volery.kernel.waiting import Signal, current_task, read_clock
from volery.ros.client_libraries.abi_codec import CppFiber
from volery.ros.client_libraries.library_base import Launch, node_of_file
from volery.ros.graph import Group, Node, RosGraph, ServiceError
from volery.trace.events import Failure

Entity = TypeVar("Entity")


class RefusedRequestError(ServiceError):
    """A service handler of the code returned false. The caller gets an error; the code continues."""


@dataclass(eq=False)
class Session:
    """The node of one component; it exists from ``ros::init`` on.

    Args:
        graph: The graph of the run.
        component: Name of the component.
        launch: Launch settings of the component.
        nodes: Existing nodes by component, which ``ros::init`` uses.
    """

    graph: RosGraph
    component: str
    launch: Launch
    nodes: Mapping[str, Node] = field(default_factory=dict)
    opened: Node | None = None
    finished: bool = False
    _entities: dict[int, Any] = field(default_factory=dict)
    _spinning: dict[Task, CppFiber] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.kernel = self.graph.kernel
        self.changed = Signal(self.kernel, f"{self.component} (an event of another task)")
        self._ended = Signal(self.kernel, f"{self.component} (ros::waitForShutdown)")

    def join(self, name: str, anonymous: bool) -> None:
        """Execute ``ros::init``; a second call changes nothing."""
        if self.opened is not None:
            return
        given = self.nodes.get(self.component)
        node = node_of_file(self.graph, self.component, name, self.launch, given, anonymous=anonymous)
        for key, value in self.launch.parameters.items():
            node.set_parameter(key if key.startswith("/") else f"~{key}", value)
        self.opened = node

    @property
    def node(self) -> Node:
        """The node. Raises ``UsageError`` before ``ros::init``."""
        if self.opened is None:
            raise UsageError(f"{self.component}: call ros::init() before the first ros::NodeHandle")
        return self.opened

    def ok(self) -> bool:
        """Return whether the node exists and is not shut down. An interaction point."""
        with self.kernel:
            return self.opened is not None and not self.finished

    def end(self) -> None:
        """Shut down: leave the graph; spinning tasks return."""
        if not self.finished:
            self.finished = True
            if self.opened is not None:
                self.opened.close()
            self._ended.notify()
            self.changed.notify()

    def wait_for_end(self) -> None:
        """Block until the shutdown."""
        self._ended.wait_for(lambda: self.finished, ends_activation=True)

    def now(self) -> Ns:
        """Return ROS time, also before ``ros::init``. An interaction point."""
        return self.graph.epoch + read_clock(self.kernel)

    def group(self, number: int) -> Group:
        """Return the queue with a number, of which -1 is the node's own."""
        return self.node.own_group if number < 0 else self.entity(number)

    def spawn(self, body: Callable[[], object], label: str) -> None:
        """Run *body* in a task beside that of ``main``, as a thread; what it raises is a failure."""
        task = current_task(self.kernel)
        context = replace(task.contexts[0], deadline=None, period=None, on_release=None)

        def guarded() -> None:
            try:
                body()
            except Exception as error:
                what = f"a thread ({label}) raised {error}"
                self.kernel.record(Failure(self.kernel.now(), self.component, what))

        self.kernel.spawn(guarded, f"{self.component} ({label})", context, task.scope)

    # -- entities that the code refers to

    def keep(self, entity: object) -> int:
        """Store an entity and return its number."""
        number = len(self._entities)
        self._entities[number] = entity
        return number

    def find(self, number: int, kind: type[Entity]) -> Entity:
        """Return the entity with a number."""
        entity = self._entities[number]
        assert isinstance(entity, kind), f"{number} is no {kind.__name__}"
        return entity

    def entity(self, number: int) -> Any:
        """Return the entity with a number, of any kind."""
        return self._entities[number]

    def close(self, number: int) -> None:
        """Remove an entity from the graph."""
        self._entities[number].close()

    # -- callbacks, which run on the stack of the spinning fiber

    def spin(self, fiber: CppFiber, spinning: Callable[[], object]) -> None:
        """Execute *spinning*, which runs callbacks, for the fiber that has requested it."""
        task = current_task(self.kernel)
        before = self._spinning.get(task)
        self._spinning[task] = fiber
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
        """Run a callback of the code. Must be called from within ``spin``."""
        return self._spinning[current_task(self.kernel)].call(callable_number, argument)
