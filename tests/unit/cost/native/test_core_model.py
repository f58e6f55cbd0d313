import numpy as np
import pytest

from volery.cost import IssueQueue, LibraryLaw, load_catalogue
from volery.cost.native.block_costs import ExecutionSequence, execute
from volery.cost.native.core_model import BLOCKED
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


def through_memory(addresses: tuple[int, int]) -> float:
    """Cycles of one pass that stores a sum and loads it by another register; addresses are known."""
    lines = ("addsd xmm0, xmm1", "movsd qword ptr [rbx], xmm0", "movsd xmm0, qword ptr [rcx + 8]")
    ran = np.zeros(REPEATS, dtype=np.int64)
    took, _ = execute(
        instruction_tables([piece(*lines)], LAW, frozenset()),
        ExecutionSequence(
            ran, np.zeros(REPEATS, dtype=np.int8), addresses=np.tile([-1, *addresses], REPEATS)
        ),
    )
    return float(took.sum()) / REPEATS


def test_a_store_is_found_by_its_address_however_it_is_written():
    chain = LAW.operations["fp_add"].latency + LAW.forward
    assert through_memory((640, 640)) == pytest.approx(chain, abs=2.5)
    assert through_memory((640, 704)) < chain / 2


def test_a_load_of_parts_of_several_stores_waits_until_they_retire():
    assert through_memory((640, 636)) > through_memory((640, 640))


def test_a_blocked_load_waits_as_long_as_measured():
    blocked = through_memory((640, 636)) - through_memory((640, 640))
    assert blocked == pytest.approx(BLOCKED, abs=1.0)


def between_misses(calls: int, window: int) -> float:
    """Cycles of one pass with two loads from memory and library calls of 8 cycles after each."""
    library = LibraryLaw(
        provenance="measured", source="a test", unknown=8.0, calls={"other": 8.0}, latencies={"other": 1.0}
    )
    law = LAW.model_copy(update={"library": library, "window": window})
    call = MachineBlock("f", "", None, [Instruction("call", ("other",), "")], End.CALL, "other")
    parts = [
        piece("mov rbx, qword ptr [rbx]"),
        *[call] * calls,
        piece("mov rcx, qword ptr [rcx]"),
        *[call] * calls,
    ]
    ran = np.tile(np.arange(len(parts)), REPEATS)
    starts = range(0, len(ran), len(parts))
    misses = np.array([(at + step, step, 3, 0) for at in starts for step in (0, calls + 1)])
    took, _ = execute(
        instruction_tables(parts, law, frozenset()),
        ExecutionSequence(ran, np.zeros(len(ran), dtype=np.int8), misses),
        MEMORY,
    )
    return float(took.sum()) / REPEATS


def test_the_instructions_of_a_call_fill_the_reorder_buffer():
    fit = int(LAW.window / (LAW.width * 8.0 / 2.0))
    assert between_misses(fit // 2, LAW.window) < OVERLAP
    assert between_misses(fit + 1, LAW.window) > NO_OVERLAP
    assert between_misses(fit + 1, 4 * LAW.window) < OVERLAP


def test_a_pattern_of_two_ways_of_a_loop_is_learnt():
    """Which of two branches jumps back is told by more than the last two bits of the history."""
    slope = [int((number * 0.382) % 1.0 < 0.382) for number in range(6000)]
    for shift in range(4):
        loop = [
            piece(*["add rax, rbx"] * shift, "test eax, eax", "jne .LBB0_1", end=End.BRANCH),
            piece("add rcx, rbx", "jmp .LBB0_1", end=End.JUMP),
        ]
        ran = np.array([one for way in slope for one in ((0,) if way else (0, 1))], dtype=np.int64)
        ways = np.array([one for way in slope for one in ((1,) if way else (0, 1))], dtype=np.int8)
        _, stalled = execute(instruction_tables(loop, LAW, frozenset()), ExecutionSequence(ran, ways))
        assert np.count_nonzero(stalled) < 0.03 * len(slope)


def test_repeating_branches_are_predicted_and_random_ones_are_not():
    random = [int(one) for one in np.random.default_rng(1).integers(0, 2, 4000)]
    assert mispredicted([number % 2 for number in range(4000)]) < 0.02
    assert mispredicted([int(number % 7 == 0) for number in range(4000)]) < 0.05
    assert 0.4 < mispredicted(random) < 0.6


def test_one_taken_branch_enters_a_cycle():
    tables = instruction_tables([piece("jmp .LBB0_1", end=End.JUMP)], LAW, frozenset())
    ran = ExecutionSequence(np.zeros(REPEATS, dtype=np.int64), np.ones(REPEATS, dtype=np.int8))
    assert execute(tables, ran)[0].sum() / REPEATS == pytest.approx(1.0, rel=0.02)


def test_quotients_and_roots_are_computed_by_one_unit():
    each = [cycles(f"v{one}sd xmm1, xmm2, xmm3") for one in ("div", "sqrt")]
    both = cycles("vdivsd xmm1, xmm2, xmm3", "vsqrtsd xmm4, xmm2, xmm3")
    assert both == pytest.approx(sum(each), rel=0.02)


def computed(ways: list[int], targets: list[int], computed_jumps: float = 1.0) -> tuple[float, int]:
    """Cycles, and mispredictions in the second half, of a loop with a branch and a computed jump."""
    loop = [
        piece("test eax, eax", "jne .LBB0_1", end=End.BRANCH),
        piece("jmp rax", end=End.COMPUTED),
        *(piece("jmp .LBB0_1", end=End.JUMP) for _ in range(8)),
    ]
    ran = np.array([one for target in targets for one in (0, 1, 2 + target)], dtype=np.int64)
    taken = np.array([one for way in ways for one in (way, 1, 1)], dtype=np.int8)
    law = LAW.model_copy(update={"computed": computed_jumps})
    took, stalled = execute(instruction_tables(loop, law, frozenset()), ExecutionSequence(ran, taken))
    after = stalled[np.arange(len(ran)) % 3 == 2]
    return float(took.sum()), int(np.count_nonzero(after[len(after) // 2 :]))


def test_a_jump_to_one_target_is_predicted_whatever_was_before():
    random = [int(one) for one in np.random.default_rng(1).integers(0, 2, 2000)]
    assert computed(random, [3] * 2000)[1] < 20


def test_targets_in_a_repeating_order_are_learnt_and_random_ones_are_not():
    order = [int(one) for one in np.random.default_rng(2).integers(0, 8, 2000)]
    assert computed([0] * 2000, order[:20] * 100)[1] < 20
    assert computed([0] * 2000, order)[1] > 800


def test_a_computed_jump_to_another_target_enters_later():
    alternating = [0, 1] * 500  # half of them is the usual target
    assert computed([0] * 1000, alternating, 4.0)[0] > computed([0] * 1000, alternating)[0] + 400
    assert computed([0] * 1000, [1] * 1000, 4.0)[0] < computed([0] * 1000, [1] * 1000)[0] + 100


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


def two_misses(between: int, first: str, second: str, queues: tuple[IssueQueue, ...] = LAW.queues) -> float:
    """Cycles of one pass with two loads from memory, and operations after each that may wait for it."""
    lines = [CHAIN, *[first] * between, "mov rcx, qword ptr [rcx]", *[second] * between]
    ran = np.zeros(REPEATS, dtype=np.int64)
    rows = np.array([(step, row, 3, 0) for step in range(REPEATS) for row in (0, between + 1)])
    encoded = instruction_tables([piece(*lines)], LAW.model_copy(update={"queues": queues}), frozenset())
    took, _ = execute(encoded, ExecutionSequence(ran, np.zeros(REPEATS, dtype=np.int8), rows), MEMORY)
    return float(took.sum()) / REPEATS


WAITING = ("add rdx, rax", "add rsi, rcx")
OVERLAP, NO_OVERLAP = 1.4 * MEMORY[0], 1.8 * MEMORY[0]


def test_a_full_issue_queue_stops_what_follows():
    (queue,) = LAW.queues
    assert two_misses(queue.entries - 4, *WAITING) < OVERLAP
    assert two_misses(queue.entries + 4, *WAITING) > NO_OVERLAP


def test_operations_that_execute_leave_the_issue_queue():
    (queue,) = LAW.queues
    assert two_misses(queue.entries + 4, "add rdx, rbx", "add rsi, rbx") < OVERLAP


def test_operations_wait_in_the_queue_of_their_pipes():
    small, large = (IssueQueue(entries=entries, pipes=("integer",)) for entries in (4, 90))
    vector = IssueQueue(entries=4, pipes=("vector",))
    assert two_misses(60, *WAITING, queues=(vector, large)) < OVERLAP
    assert two_misses(60, *WAITING, queues=(vector,)) < OVERLAP
    assert two_misses(60, *WAITING, queues=(small,)) > NO_OVERLAP


def call_of(symbol: str, latencies: dict[str, float], *more: str) -> float:
    library = LibraryLaw(
        provenance="measured", source="test", unknown=50.0, calls={"f": 20.0}, latencies=latencies
    )
    law = LAW.model_copy(update={"library": library})
    block = piece(*more, f"call {symbol}", end=End.CALL)
    block.target = symbol
    ran = np.zeros(REPEATS, dtype=np.int64)
    took, _ = execute(
        instruction_tables([block], law, frozenset()),
        ExecutionSequence(ran, np.zeros(REPEATS, dtype=np.int8)),
    )
    return float(took.sum()) / REPEATS


def test_calls_of_which_each_needs_the_result_before_take_their_latency():
    assert call_of("f", {"f": 70.0}) == pytest.approx(70.0, rel=0.05)
    assert call_of("f", {}) == pytest.approx(40.0, rel=0.05)  # twice the cycles where none is stated
    assert call_of("g", {}) == pytest.approx(100.0, rel=0.05)


def test_independent_calls_take_their_cycles():
    assert call_of("f", {"f": 70.0}, "xor eax, eax", "xorps xmm0, xmm0") == pytest.approx(20.0, rel=0.1)
