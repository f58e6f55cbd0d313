"""Where one check of a transport happens, and how a check is made of a function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from volery.base.time import MS, Ns, S
from volery.kernel.task import ExecutionContext
from volery.ros.graph.interface import Node, RosGraph
from volery.testing.checks import demand

LIMIT: Ns = 10 * S
"""How long a check waits for what must come; real ROS takes a moment to find its peers."""
QUIET: Ns = 300 * MS
"""How long it listens for what must not come."""


@dataclass(frozen=True)
class Traits:
    """What kind of graph it is.

    ``qos``: it keeps apart publishers and subscriptions whose QoS does not fit. ``tells_failure``: the caller
    of a service hears at once that its handler raised or its server left (ROS 2 has no word for it: it hears
    nothing). ``global_parameters``: there are parameters outside of nodes. ``keeps_depth``: a latched
    publisher keeps as many messages as its depth says, not just one. ``carries``: whether it carries a type.
    """

    qos: bool = True
    tells_failure: bool = True
    global_parameters: bool = True
    keeps_depth: bool = True
    carries: Callable[[str], bool] = lambda name: True


EMBEDDED = Traits()
ROS1 = Traits(qos=False, keeps_depth=False)
ROS2 = Traits(tells_failure=False, global_parameters=False)


class Site:
    """Where one check happens: nodes of its own under names of its own, gone when it is over."""

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
        """A node below the check's own namespace."""
        made = self.graph.node(name, f"{self.space}{namespace}", **options)  # type: ignore[arg-type]
        self._nodes.append(made)
        return made

    def spinning(self, node: Node) -> Node:
        """The same node, spun by a task beside the check."""
        self.kernel.spawn(node.spin, f"spins {node.name}", ExecutionContext(node.name))
        return node

    def until(self, node: Node, holds: Callable[[], object], what: str, within: Ns = LIMIT) -> None:
        """Demand that *holds* comes true."""
        end = self.kernel.now() + within
        while not holds():
            demand(self.kernel.now() < end, f"not within {within / S:g} s: {what}")
            node.sleep(5 * MS)

    def spin_until(self, node: Node, holds: Callable[[], object], what: str, within: Ns = LIMIT) -> None:
        """Demand that *holds* comes true while *node* spins."""
        end = self.kernel.now() + within
        while not holds():
            demand(self.kernel.now() < end, f"not within {within / S:g} s: {what}")
            node.spin_once(50 * MS)

    def listen(self, node: Node, duration: Ns = QUIET) -> None:
        """Spin *node* for a while."""
        end = self.kernel.now() + duration
        while self.kernel.now() < end:
            node.spin_once(20 * MS)


Body = Callable[[Site], None]
CHECKS: dict[str, Body] = {}
"""By name, in the order in which they are run."""


def check(body: Body) -> Body:
    """Make a check of the function: its name is the check's, its docstring what it demands."""
    CHECKS[body.__name__.replace("_", "-")] = body
    return body
