from __future__ import annotations

import builtins
import textwrap
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from volery.base.time import S
from volery.base.warmth import Warmth
from volery.cost import Price
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.client_libraries.importable_modules import importable_modules
from volery.ros.client_libraries.library_base import Launch
from volery.ros.graph import EmbeddedGraph, EmbeddedNode


class Stage:
    """Runs texts of Python files as components that import rospy or rclpy."""

    def __init__(self) -> None:
        self.events: list[Any] = []
        self.kernel = VirtualKernel(self.events.append)
        self.priced: list[tuple[str, str]] = []
        self.graph = EmbeddedGraph(self.kernel, self._tariff)
        self.launched: dict[str, Launch] = {}
        self.nodes: dict[str, EmbeddedNode] = {}
        self.modules = importable_modules(self.graph, self.launched, self.nodes)
        self.out: list[Any] = []

    def _tariff(self, node: Any) -> Any:
        def price(call: str, x: float, warmth: Warmth) -> Price:
            self.priced.append((node.name, call))
            return Price(0, 0)

        return price

    def load(self, text: str) -> ModuleType:
        def find(
            name: str, globals_: Any = None, locals_: Any = None, wanted: Any = (), level: int = 0
        ) -> Any:
            if name in self.modules:
                return self.modules[name if wanted else name.partition(".")[0]]
            if name in ("array", "copy", "numpy", "unittest"):
                return builtins.__import__(name)
            raise ImportError(name)

        module = ModuleType("user")
        module.__dict__["__builtins__"] = {**vars(builtins), "__import__": find, "out": self.out.append}
        exec(text, module.__dict__)
        return module

    def component(self, name: str, text: str) -> None:
        """The text is the body of a function that runs as component *name*."""
        lines = "\n".join(f"    {line}" for line in text.strip("\n").splitlines())
        main: Callable[[], None] = self.load(f"import rospy\ndef main():\n{lines}\n").main
        self.kernel.spawn(main, name, ExecutionContext(name))

    def script(self, name: str, text: str) -> None:
        """The text is a file that runs as component *name*."""

        def main() -> None:
            self.load(textwrap.dedent(text))

        self.kernel.spawn(main, name, ExecutionContext(name))

    def run(self, until: int = 60 * S) -> list[Any]:
        self.kernel.call_at(until + 1, lambda: None)  # nodes that only wait are no deadlock yet
        self.kernel.run(until)
        return self.out

    def of(self, kind: type) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]


@pytest.fixture
def stage() -> Stage:
    return Stage()
