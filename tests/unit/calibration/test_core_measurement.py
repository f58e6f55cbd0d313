"""From times of snippets to the figures of a core."""

from __future__ import annotations

import pytest

from volery.calibration.core_measurement import (
    Timing,
    core_law,
    snippet_names,
)
from volery.calibration.core_measurement import (
    source as source_of_measurement,
)
from volery.calibration.host_machine import Machine
from volery.calibration.queue_measurement import INTEGER, WINDOW, QueueSizes
from volery.cost import CoreLaw, IssueQueue

CYCLES = {
    "chain_fp_multiply": 3.95,
    "chain_fp_add": 4.1,  # a vector operation and the sum
    "chain_vector": 1.02,
    "free_alu": 0.253,
    "free_increment": 0.201,
    "chain_increment": 0.2,
    "width": 0.168,
    "chain_convert": 10.1,  # there and back
    "free_fp_divide64": 4.0,
    "library_sin": 20.0,
    "delay_sin": 61.0,
    "library_sinf": 15.0,
    "delay_sinf": 56.0,
    "library_floor": 16.0,
    "delay_floor": 12.0,
    "branches_random": 12.0,
    "branches_never": 2.0,
    "jumps_one": 3.0,
    "jumps_many": 5.1,
    "free_load": 0.34,
    "free_store": 0.5,
    "accesses": 0.335,  # two in 0.67 cycles
}


@pytest.fixture
def law(monkeypatch: pytest.MonkeyPatch) -> CoreLaw:
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    taken = {name: Timing(CYCLES.get(name, 1.0), 0.001, 15, 3000.0) for name in snippet_names()}
    queues = QueueSizes({WINDOW: 224, INTEGER: 97})
    return core_law(Machine("host", "a test", 4, 3000.0), "x86_64", taken, queues)


def test_latencies_are_whole_and_less_what_is_beside_in_the_chain(law: CoreLaw) -> None:
    found = {name: law.operations[name].latency for name in ("fp_multiply", "fp_add", "increment", "convert")}
    assert found == {"fp_multiply": 4, "fp_add": 3, "increment": 0, "convert": 5}


def test_pipes_are_whole_above_one_a_cycle(law: CoreLaw) -> None:
    assert law.operations["alu"].per_cycle == 4
    assert law.operations["fp_divide64"].per_cycle == 0.25
    assert law.width == 6


def test_the_latency_of_a_call_is_less_what_carries_its_result(law: CoreLaw) -> None:
    assert law.library.cycles("sin") == (20.0, 54.0)  # less a product and a sum
    assert law.library.cycles("sinf") == (15.0, 39.0)  # and two conversions
    assert law.library.cycles("floor") == (16.0, 16.0)  # never below the cycles of the call
    assert law.library.cycles("sincos") == law.library.cycles("sin")
    assert law.library.cycles("unheard_of") == (law.library.unknown, 2 * law.library.unknown)


def test_the_branch_itself_is_no_part_of_the_refill(law: CoreLaw) -> None:
    assert law.refill == 18.0


def test_what_is_assumed_is_named(law: CoreLaw) -> None:
    assert law.window == 224
    assert law.queues == (IssueQueue(entries=97, pipes=("integer", "branch", "multiply", "divide")),)
    assert law.validity == "assumed: the prediction of branches"


def test_loads_and_stores_that_share_pipes_are_fewer_together(law: CoreLaw) -> None:
    assert (law.operations["load"].per_cycle, law.operations["store"].per_cycle) == (3, 2)
    assert law.accesses == 3


def test_a_computed_jump_to_another_target_takes_longer(law: CoreLaw) -> None:
    assert law.computed == 3.1


def test_no_figure_is_taken_of_what_cores_fuse_or_learn() -> None:
    text = source_of_measurement()
    assert "nop" not in text[text.index("static void width") :].split("}")[0]
    assert "static uint64_t state = 88172645463325252ull;" in text  # random branches go on where they stopped
