from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from volery.base.time import S
from volery.base.warmth import Warmth
from volery.cost.ros_law import ENDINGS
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.graph import EmbeddedGraph, NodeId, Route


class Price(NamedTuple):
    caller: int
    background: int


class Rig:
    """A graph whose calls cost what ``prices`` says and whose messages take ``delay`` between processors."""

    def __init__(self) -> None:
        self.events: list[Any] = []
        self.kernel = VirtualKernel(self.events.append)
        self.processor = Processor(self.kernel, "cpu", cores=2)
        self.prices: dict[str, Price] = {}
        self.asked: list[tuple[str, str, float]] = []  # warm calls by the names of their figures
        self.delay = 0
        self.loses = False
        self.carried: list[tuple[NodeId, NodeId, int, bool]] = []
        self.graph = self.new_graph()

    def new_graph(self, **options: Any) -> EmbeddedGraph:
        return EmbeddedGraph(self.kernel, self.tariff, self.route, **options)

    def tariff(self, node: NodeId) -> Callable[[str, float, Warmth], Price]:
        return lambda call, x, warmth: self.price(node, call + ENDINGS[warmth][0], x)

    def price(self, node: NodeId, call: str, x: float) -> Price:
        self.asked.append((node.name, call, x))
        return self.prices.get(call, Price(0, 0))

    def route(self, sender: NodeId, receiver: NodeId) -> Route:
        def way(size: int, reliable: bool, deliver: Any, lost: Any) -> None:
            self.carried.append((sender, receiver, size, reliable))
            arrives = lost if self.loses and not reliable else deliver
            self.kernel.call_at(self.kernel.now() + self.delay, arrives)

        return way

    def task(self, body: Callable[[], None], name: str = "component", on_processor: bool = False) -> None:
        context = ExecutionContext(name, self.processor if on_processor else None)
        self.kernel.spawn(body, name, context)

    def run(self, *bodies: Callable[[], None], until: int = 100 * S) -> None:
        """Run each body as a component of its own (named after the function)."""
        for body in bodies:
            self.task(body, body.__name__)
        self.kernel.run(until)

    def of(self, kind: type) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]


@pytest.fixture
def rig() -> Rig:
    return Rig()
