import numpy as np
import pytest

from volery.cost import load_catalogue
from volery.cost.native.block_costs import ExecutionSequence, execute
from volery.cost.native.instruction_tables import instruction_tables
from volery.cost.native.machine_code import End, Instruction, MachineBlock

LAW = load_catalogue().processor("intel-i5-3470").core_law()
REPEATS = 400


def piece(*lines: str, end: End = End.FALLS) -> MachineBlock:
    parts = [line.partition(" ") for line in lines]
    made = [Instruction(name, tuple(one.strip() for one in rest.split(",")), "") for name, _, rest in parts]
    return MachineBlock("f", "", None, made, end, ".LBB0_1" if end is End.JUMP else "")


def cycles(*lines: str) -> float:
    """Cycles of one pass through a piece that runs again and again."""
    ran = np.zeros(REPEATS, dtype=np.int64)
    took, _ = execute(
        instruction_tables([piece(*lines)], LAW, frozenset()),
        ExecutionSequence(ran, np.zeros(REPEATS, dtype=np.int8)),
    )
    return float(took.sum()) / REPEATS


def mispredicted(taken: list[int]) -> float:
    """The share of branches that were not foreseen, in a loop with one branch that goes as *taken* says."""
    loop = [piece("test eax, eax", "jne .LBB0_1", end=End.BRANCH), piece("jmp .LBB0_1", end=End.JUMP)]
    ran = np.array([0, 1] * len(taken), dtype=np.int64)
    ways = np.array([way for one in taken for way in (one, 1)], dtype=np.int8)
    took, stalled = execute(instruction_tables(loop, LAW, frozenset()), ExecutionSequence(ran, ways))
    assert np.all(stalled <= took)
    wrong = stalled > 0.0
    assert stalled.sum() >= wrong.sum() * (LAW.refill - 1)
    assert not np.any(wrong[2::2])  # the wait is before what follows the branch
    return float(wrong.sum()) / len(taken)


def test_dependent_operations_take_their_latency():
    assert cycles("addsd xmm0, xmm1") == pytest.approx(LAW.operations["fp_add"].latency, rel=0.05)


def test_independent_operations_take_the_throughput_of_the_pipes():
    adds = [f"paddd xmm{number}, xmm8" for number in range(6)]
    assert cycles(*adds) == pytest.approx(6 / LAW.operations["vector"].per_cycle, rel=0.05)


def test_nothing_is_faster_than_the_front_end():
    assert cycles(*["nop "] * 12) == pytest.approx(12 / LAW.width, rel=0.05)


def test_a_load_after_a_store_to_the_same_address_is_forwarded():
    through = cycles("addsd xmm0, xmm1", "movsd qword ptr [rsp + 8], xmm0", "movsd xmm0, qword ptr [rsp + 8]")
    elsewhere = cycles(
        "addsd xmm0, xmm1", "movsd qword ptr [rsp + 8], xmm0", "movsd xmm0, qword ptr [rsp + 16]"
    )
    assert through == pytest.approx(LAW.operations["fp_add"].latency + LAW.forward, abs=2.5)
    assert elsewhere < through / 2


def test_repeating_branches_are_predicted_and_random_ones_are_not():
    random = [int(one) for one in np.random.default_rng(1).integers(0, 2, 4000)]
    assert mispredicted([number % 2 for number in range(4000)]) < 0.02
    assert mispredicted([int(number % 7 == 0) for number in range(4000)]) < 0.05
    assert 0.4 < mispredicted(random) < 0.6


def late(*lines: str, level: int, ahead: int = 0, memory: tuple[float, float] | None = None) -> float:
    """Cycles of one pass through a piece whose first instruction is always served by that level."""
    ran = np.zeros(REPEATS, dtype=np.int64)
    rows = np.array([(step, 0, level, ahead) for step in range(REPEATS)])
    encoded = instruction_tables([piece(*lines)], LAW, frozenset())
    took, _ = execute(encoded, ExecutionSequence(ran, np.zeros(REPEATS, dtype=np.int8), rows), memory)
    return float(took.sum()) / REPEATS


CHAIN = "mov rax, qword ptr [rax]"
MEMORY = (200.0, 16.0)
"""Cycles of its latency, and of a line."""


def test_dependent_loads_take_the_latency_of_their_level():
    assert LAW.memory is not None
    second, third = (one.latency for one in LAW.memory.caches[1:])
    assert late(CHAIN, level=1) == pytest.approx(second, rel=0.02)
    assert late(CHAIN, level=2) == pytest.approx(third, rel=0.02)
    assert late(CHAIN, level=3) == pytest.approx(third, rel=0.02)  # where memory is a cache like the last
    assert late(CHAIN, level=3, memory=MEMORY) == pytest.approx(MEMORY[0], rel=0.02)


def test_independent_loads_overlap_in_memory():
    assert late("mov rax, qword ptr [rbx]", level=3, memory=MEMORY) == pytest.approx(MEMORY[1], rel=0.1)


def test_prefetched_lines_take_the_time_of_a_line():
    assert late(CHAIN, level=3, ahead=1, memory=MEMORY) == pytest.approx(MEMORY[1], rel=0.1)
    assert late(CHAIN, *["add rax, 1"] * 40, level=3, ahead=1, memory=MEMORY) == pytest.approx(
        cycles(CHAIN, *["add rax, 1"] * 40), rel=0.05
    )


def test_a_store_miss_delays_no_instruction():
    assert late("mov qword ptr [rbx], rax", level=3, memory=MEMORY) == cycles("mov qword ptr [rbx], rax")
