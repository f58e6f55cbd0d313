"""What every Python client library shares: launch settings, module objects, ``/rosout``."""

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


class Launch(NamedTuple):
    """A node's namespace, its remappings and its private parameters."""

    namespace: str = "/"
    remaps: Mapping[str, str] = {}
    parameters: Mapping[str, Any] = {}


AtEnd = Callable[[ExecutionContext, Callable[[], object]], None]
"""Has something done at a place when the run ends, by which components have been cancelled already."""


def ignore_end(place: ExecutionContext, last: Callable[[], object]) -> None:
    """Where runs end without a word."""


@dataclass(eq=False)
class LaunchedComponents:
    """All components of one run behind one face: their graph, and what stands for each before it has begun.

    *launched* says what a launch file would, by component; *nodes* are those that they are given.
    """

    graph: RosGraph
    launched: Mapping[str, Launch] | None = None
    nodes: Mapping[str, Node] | None = None
    at_end: AtEnd = ignore_end

    def __post_init__(self) -> None:
        self.kernel = self.graph.kernel

    @property
    def component(self) -> str:
        """The one that the current task computes for."""
        return current_task(self.kernel).place.component

    def launch_of(self, component: str) -> Launch | None:
        """What is said of it; ``None`` where nothing is."""
        return None if self.launched is None else self.launched.get(component)

    def node_of(self, component: str) -> Node | None:
        """The one that it is given; ``None`` where it makes its own."""
        return None if self.nodes is None else self.nodes.get(component)


def library_module(name: str, names: Mapping[str, Any]) -> ModuleType:
    """The module *name* with these *names* in it; ``AttributeError`` for another one lists the valid ones."""
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


ROSOUT = "/rosout"


class Caller(NamedTuple):
    """Where a line was logged: the file's name, the function and the line."""

    file: str
    function: str
    line: int


def caller(depth: int) -> Caller:
    """Of the call that is *depth* calls above whoever asks."""
    frame = sys._getframe(depth + 1)
    return Caller(Path(frame.f_code.co_filename).name, frame.f_code.co_name, frame.f_lineno)


class Rosout:
    """Publishes a node's lines of the log as messages of one type.

    On the embedded graph it joins the topic only when somebody listens there, so that logging costs nothing
    and shows nowhere else. Where the topic carries another library's type, or the type is not installed, the
    lines are in the log alone.
    """

    def __init__(self, graph: RosGraph, node: Node, message_type: str, qos: QoS) -> None:
        self._graph, self._node, self._type, self._qos = graph, node, message_type, qos
        self._publisher: Publisher | None = None
        self._closed = False

    def tell(self, fill: Callable[[Any], None]) -> None:
        """Publish a message that *fill* completes, if somebody listens. An interaction point if so."""
        if self._closed or self._node.closed or not self._wanted():
            return
        try:
            if self._publisher is None:
                self._publisher = self._node.advertise(ROSOUT, self._type, self._qos)
            message = message_class(self._type)()
            fill(message)
            self._publisher.publish(message)
        except UsageError:
            self._closed = True

    def _wanted(self) -> bool:
        return not isinstance(self._graph, EmbeddedGraph) or self._graph.heard(ROSOUT)
