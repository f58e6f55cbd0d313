from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from volery.base.time import MS
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext, Scope, Task
from volery.kernel.virtual import VirtualKernel
from volery.kernel.wall import WallKernel
from volery.trace.events import Event, Slice

Spawn = Callable[..., Task]


@pytest.fixture
def events() -> list[Event]:
    """What the kernel of this test records."""
    return []


@pytest.fixture
def virtual(events: list[Event]) -> Iterator[VirtualKernel]:
    kernel = VirtualKernel(events.append)
    yield kernel
    kernel.close()


@pytest.fixture
def wall(events: list[Event]) -> Iterator[WallKernel]:
    kernel = WallKernel(events.append, speed=1000.0)
    yield kernel
    kernel.close(grace_s=0.0)


@pytest.fixture(params=["virtual", "wall"])
def kernel(request: pytest.FixtureRequest) -> Kernel:
    """The same test on both clocks; the wall's runs a thousand times as fast."""
    chosen: Kernel = request.getfixturevalue(request.param)
    return chosen


@pytest.fixture
def spawn(request: pytest.FixtureRequest) -> Spawn:
    """``spawn(body, name)`` on the kernel of this test, at a place of that name that takes no time."""
    both = "kernel" in request.fixturenames
    kernel: Kernel = request.getfixturevalue("kernel" if both else "virtual")

    def spawn(body: Callable[[], object], name: str = "task", scope: Scope | None = None) -> Task:
        return kernel.spawn(lambda: void(body()), name, ExecutionContext(name), scope)

    return spawn


def void(_: object) -> None:
    pass


@pytest.fixture
def slices(events: list[Event]) -> Callable[[], list[tuple[float, float, str, str]]]:
    """Who ran when on what: (start ms, end ms, processor, component)."""

    def read() -> list[tuple[float, float, str, str]]:
        return [
            (each.start / MS, each.end / MS, f"{each.processor}.{each.core}", each.component)
            for each in events
            if isinstance(each, Slice)
        ]

    return read
