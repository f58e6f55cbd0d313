"""What every Python client library shares: launch settings, module objects and ``/rosout``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, NoReturn

from volery.base.errors import UsageError, choices, did_you_mean
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import current_task
from volery.ros.graph import EmbeddedGraph, Node, Publisher, QoS, RosGraph
from volery.ros.messages import message_class

# -- components and their launch settings


class Launch(NamedTuple):
    """Namespace, remappings and private parameters of a node, as in a launch file."""

    namespace: str = "/"
    remaps: Mapping[str, str] = {}
    parameters: Mapping[str, Any] = {}


AtEnd = Callable[[ExecutionContext, Callable[[], object]], None]
"""Registers a function that runs in a context at the end of the run, after the components were cancelled."""


def ignore_end(context: ExecutionContext, last: Callable[[], object]) -> None:
    """Register nothing: an ``AtEnd`` for runs that end without notice."""


@dataclass(eq=False)
class LaunchedComponents:
    """The components of one run that use one client library.

    Args:
        graph: The graph of the run.
        launched: Launch settings by component.
        nodes: Existing nodes by component; a component without one creates its own.
        at_end: Registers functions for the end of the run.
    """

    graph: RosGraph
    launched: Mapping[str, Launch] | None = None
    nodes: Mapping[str, Node] | None = None
    at_end: AtEnd = ignore_end

    def __post_init__(self) -> None:
        self.kernel = self.graph.kernel

    @property
    def component(self) -> str:
        """Component of the current task."""
        return current_task(self.kernel).context.component

    def launch_of(self, component: str) -> Launch | None:
        """Return the launch settings of *component*, or None."""
        return None if self.launched is None else self.launched.get(component)

    def node_of(self, component: str) -> Node | None:
        """Return the existing node of *component*, or None."""
        return None if self.nodes is None else self.nodes.get(component)


# -- module objects


def library_module(name: str, names: Mapping[str, Any]) -> ModuleType:
    """Return a module object whose ``AttributeError`` lists the available names.

    Args:
        name: Dotted name of the module.
        names: Content of the module.
    """
    module = ModuleType(name, f"{name.partition('.')[0]} on the embedded graph.")
    module.__path__ = []
    vars(module).update(names)

    def missing(attribute: str) -> NoReturn:
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        hint = did_you_mean(attribute, names)
        raise AttributeError(
            f"{name}.{attribute} is not there on the embedded graph{hint}; there is {choices(names)}"
        )

    vars(module)["__getattr__"] = missing
    return module


# -- /rosout

ROSOUT = "/rosout"


class Caller(NamedTuple):
    """Source location of a log call: file name, function and line."""

    file: str
    function: str
    line: int


def caller(depth: int) -> Caller:
    """Return the source location *depth* calls above the calling function."""
    frame = sys._getframe(depth + 1)
    return Caller(Path(frame.f_code.co_filename).name, frame.f_code.co_name, frame.f_lineno)


class Rosout:
    """Publishes the log lines of a node as messages of one type.

    On the embedded graph the node joins the topic only if the topic has a subscriber, so that logging costs
    nothing otherwise. Where the topic carries the type of another client library, or the type is not
    installed, log lines are recorded but not published.
    """

    def __init__(self, graph: RosGraph, node: Node, message_type: str, qos: QoS) -> None:
        self._graph, self._node, self._type, self._qos = graph, node, message_type, qos
        self._publisher: Publisher | None = None
        self._closed = False

    def publish(self, fill: Callable[[Any], None]) -> None:
        """Publish a message that *fill* completes, if there is a subscriber. Then an interaction point."""
        if self._closed or self._node.closed:
            return
        if isinstance(self._graph, EmbeddedGraph) and not self._graph.has_subscribers(ROSOUT):
            return
        try:
            if self._publisher is None:
                self._publisher = self._node.advertise(ROSOUT, self._type, self._qos)
            message = message_class(self._type)()
            fill(message)
            self._publisher.publish(message)
        except UsageError:
            self._closed = True
