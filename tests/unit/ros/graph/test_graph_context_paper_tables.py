"""The paper's drone controller: what its calls into ROS are estimated to take (Table III)."""

from __future__ import annotations

from typing import Any

import pytest

from volery.base.time import MS, S
from volery.cost import RosLaw, Tariff, load_catalogue
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.graph import EmbeddedGraph
from volery.trace.events import Charge, Slice

SLEEPS = 2566
TABLE_III = {
    ("intel-i5-3470", 1600): (485_873_399, 94.3),
    ("intel-i5-3470", 3000): (318_626_359, 104.3),
    ("rpi4-cortex-a72", 600): (521_466_358, 101.5),
    ("rpi4-cortex-a72", 1500): (233_965_058, 99.4),
}
"""ns that the paper estimates, and the ratio (per cent) of a controller that only sleeps to it."""


def law_of(kind: str) -> RosLaw:
    return load_catalogue().processor(kind).ros_law("roscpp")


def ros_time(law: RosLaw, mhz: int) -> tuple[int, int]:
    """ns charged for calls into ROS, and ns that the processor executed, by a controller of 2566 sleeps."""
    events: list[Any] = []
    kernel = VirtualKernel(events.append)
    processor = Processor(kernel, "board", cores=4)
    tariff = Tariff(law, mhz)
    graph = EmbeddedGraph(
        kernel,
        lambda node: tariff,
        lambda sender, receiver, size, reliable, deliver, lost: None,
    )

    def controller() -> None:
        node = graph.node("controller")
        for _ in range(SLEEPS):
            node.sleep(100 * MS)

    kernel.spawn(controller, "controller", ExecutionContext("controller", processor))
    kernel.run(300 * S)
    charged = sum(event.caller + event.background for event in events if isinstance(event, Charge))
    executed = sum(event.end - event.start for event in events if isinstance(event, Slice))
    return charged, executed


def ratio(law: RosLaw, mhz: int, estimated: int) -> float:
    return 100.0 * ros_time(law, mhz)[0] / estimated


@pytest.mark.parametrize("platform", TABLE_III)
def test_a_controller_that_sleeps_is_the_estimated_column(platform: tuple[str, int]) -> None:
    kind, mhz = platform
    estimated, expected = TABLE_III[platform]
    found = ratio(law_of(kind), mhz, estimated)
    assert round(found, 1) == expected
    assert abs(found - 100.0) < 6.0


def test_what_is_charged_is_executed() -> None:
    charged, executed = ros_time(law_of("rpi4-cortex-a72"), 600)
    assert charged == executed


COEFFICIENTS = [("per_x", "offset"), ("per_x", "per_ghz"), ("constant", "offset")]


@pytest.mark.parametrize("platform", TABLE_III)
@pytest.mark.parametrize(("part", "coefficient"), COEFFICIENTS)
def test_one_coefficient_changed_is_noticed(platform: tuple[str, int], part: str, coefficient: str) -> None:
    kind, mhz = platform
    estimated, expected = TABLE_III[platform]
    law = law_of(kind)
    sleep = law.calls["sleep"]
    line = getattr(sleep, part)
    changed = line.model_copy(update={coefficient: getattr(line, coefficient) * 1.1})
    calls = {**law.calls, "sleep": sleep.model_copy(update={part: changed})}
    assert round(ratio(law.model_copy(update={"calls": calls}), mhz, estimated), 1) != expected
