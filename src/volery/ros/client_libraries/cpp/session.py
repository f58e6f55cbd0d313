"""The entities that C++ code refers to by number, its tasks, and the stacks on which its callbacks run."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from volery.base.time import Ns
from volery.kernel.task import Task
from volery.kernel.waiting import Signal, current_task, read_clock
from volery.ros.client_libraries.abi_codec import CppFiber
from volery.ros.client_libraries.library_base import Launch
from volery.ros.graph import Node, ReadyCallbacks, RosGraph, ServiceError
from volery.trace.events import Failure

Entity = TypeVar("Entity")


class RefusedRequestError(ServiceError):
    """A service handler of the code returned false. The caller gets an error; the code continues."""


@dataclass(eq=False)
class CppSession(ABC):
    """What one component uses of a client library in C++, from its start to its end.

    Args:
        graph: The graph of the run.
        component: Name of the component.
        launch: Launch settings of the component.
        nodes: Existing nodes by component, which the component uses.
    """

    graph: RosGraph
    component: str
    launch: Launch
    nodes: Mapping[str, Node] = field(default_factory=dict)
    finished: bool = False
    main: Task | None = None
    """The task of ``main``, where it has been recorded."""
    _entities: dict[int, Any] = field(default_factory=dict)
    _spinning: dict[Task, CppFiber] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.kernel = self.graph.kernel
        self.changed = Signal(self.kernel, f"{self.component} (an event of another task)")

    @property
    @abstractmethod
    def opened(self) -> Node | None:
        """The node that calls without a node belong to, or None."""

    @property
    @abstractmethod
    def node(self) -> Node:
        """The node that calls without a node belong to. Raises ``UsageError`` if there is none."""

    @abstractmethod
    def end(self) -> None:
        """Shut down: leave the graph; spinning tasks return."""

    def group(self, number: int) -> ReadyCallbacks:
        """Return the queue with a number, of which -1 is the node's own."""
        return self.node.own_group if number < 0 else self.entity(number)

    def now(self) -> Ns:
        """Return ROS time, also without a node. An interaction point."""
        return self.graph.epoch + read_clock(self.kernel)

    def spawn(self, body: Callable[[], object], label: str) -> None:
        """Run *body* in a task beside that of ``main``, as a thread; what it raises is a failure."""
        task = self.kernel.current() or self.main
        assert task is not None, "a thread begins in a task or after the library has begun to be used"
        context = replace(task.own, deadline=None, period=None, on_release=None)

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
