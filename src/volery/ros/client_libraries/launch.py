"""What a launch file says of a node, and how it is told of the end, for every face."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from volery.kernel.task import Place
from volery.kernel.waiting import current_task
from volery.ros.graph import Node, RosGraph


class Launch(NamedTuple):
    """A node's namespace, its remappings and its private parameters."""

    namespace: str = "/"
    remaps: Mapping[str, str] = {}
    parameters: Mapping[str, Any] = {}


AtEnd = Callable[[Place, Callable[[], object]], None]
"""Has something done at a place when the run ends, by which components have been cancelled already."""


def never(place: Place, last: Callable[[], object]) -> None:
    """Where runs end without a word."""


@dataclass(eq=False)
class Launched:
    """All components of one run behind one face: their graph, and what stands for each before it has begun.

    *launched* says what a launch file would, by component; *nodes* are those that they are given.
    """

    graph: RosGraph
    launched: Mapping[str, Launch] | None = None
    nodes: Mapping[str, Node] | None = None
    at_end: AtEnd = never

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
