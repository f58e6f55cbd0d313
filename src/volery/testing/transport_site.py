"""The site of one transport check, and the registration of checks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from volery.base.time import MS, Ns, S
from volery.kernel.task import ExecutionContext
from volery.ros.graph.interface import Node, RosGraph
from volery.testing.checks import demand

LIMIT: Ns = 120 * S
"""Longest wait for something that must happen, ns; DDS repeats a lost announcement only after seconds."""
QUIET: Ns = 300 * MS
"""Time of waiting for something that must not happen, ns."""


@dataclass(frozen=True)
class Traits:
    """Intended differences of graphs.

    Attributes:
        qos: Publishers and subscriptions of incompatible QoS are not connected.
        reports_failure: The caller of a service is notified at once if its handler raised or its server left;
            ROS 2 cannot report that.
        global_parameters: There are parameters outside of nodes.
        keeps_depth: A latched publisher keeps as many messages as its depth, not only one.
        carries: Whether the graph carries a type, by its name.
    """

    qos: bool = True
    reports_failure: bool = True
    global_parameters: bool = True
    keeps_depth: bool = True
    carries: Callable[[str], bool] = lambda name: True


EMBEDDED = Traits()
ROS1 = Traits(qos=False, keeps_depth=False)
ROS2 = Traits(reports_failure=False, global_parameters=False)


class Site:
    """Site of one check: nodes in a namespace of their own, closed at its end."""

    def __init__(self, graph: RosGraph, check: str, traits: Traits = EMBEDDED) -> None:
        self.graph, self.kernel, self.traits = graph, graph.kernel, traits
        self.space = f"/{check.replace('-', '_')}"
        self._nodes: list[Node] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for node in self._nodes:
            node.close()

    def node(self, name: str, namespace: str = "", **options: object) -> Node:
        """Return a new node below the check's namespace."""
        made = self.graph.node(name, f"{self.space}{namespace}", **options)  # type: ignore[arg-type]
        self._nodes.append(made)
        return made

    def spinning(self, node: Node) -> Node:
        """Spin a node in a task of its own; return the node."""
        self.kernel.spawn(node.spin, f"spins {node.name}", ExecutionContext(node.name))
        return node

    def until(self, node: Node, holds: Callable[[], object], what: str, within: Ns = LIMIT) -> None:
        """Demand that `holds` becomes true."""
        end = self.kernel.now() + within
        while not holds():
            demand(self.kernel.now() < end, f"not within {within / S:g} s: {what}")
            node.sleep(5 * MS)

    def spin_until(self, node: Node, holds: Callable[[], object], what: str, within: Ns = LIMIT) -> None:
        """Demand that `holds` becomes true while `node` is spun."""
        end = self.kernel.now() + within
        while not holds():
            demand(self.kernel.now() < end, f"not within {within / S:g} s: {what}")
            node.spin_once(50 * MS)

    def listen(self, node: Node, duration: Ns = QUIET) -> None:
        """Spin `node` for `duration` ns."""
        end = self.kernel.now() + duration
        while self.kernel.now() < end:
            node.spin_once(20 * MS)


Body = Callable[[Site], None]
CHECKS: dict[str, Body] = {}
"""All checks by name, in the order of execution."""


def check(body: Body) -> Body:
    """Register a function as a check: its name is the check's, its docstring the demand."""
    CHECKS[body.__name__.replace("_", "-")] = body
    return body
