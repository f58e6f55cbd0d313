import numpy as np
import pytest

from volery.cost.core import core_law
from volery.native.assembly import End, Instruction, Piece
from volery.native.costs import execute
from volery.native.encoding import encode

LAW = core_law("intel-i5-3470")
REPEATS = 400


def piece(*lines: str, end: End = End.FALLS) -> Piece:
    parts = [line.partition(" ") for line in lines]
    made = [Instruction(name, tuple(one.strip() for one in rest.split(",")), "") for name, _, rest in parts]
    return Piece("f", "", None, made, end, ".LBB0_1" if end is End.JUMP else "")


def cycles(*lines: str) -> float:
    """Cycles of one pass through a piece that runs again and again."""
    ran = np.zeros(REPEATS, dtype=np.int64)
    took, _ = execute(encode([piece(*lines)], LAW, frozenset()), ran, np.zeros(REPEATS, dtype=np.int8))
    return float(took.sum()) / REPEATS


def mispredicted(taken: list[int]) -> float:
    """The share of branches that were not foreseen, in a loop with one branch that goes as *taken* says."""
    loop = [piece("test eax, eax", "jne .LBB0_1", end=End.BRANCH), piece("jmp .LBB0_1", end=End.JUMP)]
    ran = np.array([0, 1] * len(taken), dtype=np.int64)
    ways = np.array([way for one in taken for way in (one, 1)], dtype=np.int8)
    took, stalled = execute(encode(loop, LAW, frozenset()), ran, ways)
    assert np.all(stalled <= took)
    wrong = stalled > 0.0
    assert stalled.sum() >= wrong.sum() * (LAW.refill - 1)
    assert not np.any(wrong[2::2])  # the wait is before what follows the branch
    return float(wrong.sum()) / len(taken)


def test_what_depends_takes_its_latency():
    assert cycles("addsd xmm0, xmm1") == pytest.approx(LAW.operations["fp_add"].latency, rel=0.05)


def test_what_does_not_depend_takes_its_share_of_the_pipes():
    adds = [f"paddd xmm{number}, xmm8" for number in range(6)]
    assert cycles(*adds) == pytest.approx(6 / LAW.operations["vector"].per_cycle, rel=0.05)


def test_nothing_is_faster_than_the_front_end():
    assert cycles(*["nop "] * 12) == pytest.approx(12 / LAW.width, rel=0.05)


def test_a_load_of_what_was_just_stored_waits_for_it():
    through = cycles("addsd xmm0, xmm1", "movsd qword ptr [rsp + 8], xmm0", "movsd xmm0, qword ptr [rsp + 8]")
    elsewhere = cycles(
        "addsd xmm0, xmm1", "movsd qword ptr [rsp + 8], xmm0", "movsd xmm0, qword ptr [rsp + 16]"
    )
    assert through == pytest.approx(LAW.operations["fp_add"].latency + LAW.forward, abs=2.5)
    assert elsewhere < through / 2


def test_branches_that_repeat_are_foreseen_and_random_ones_are_not():
    random = [int(one) for one in np.random.default_rng(1).integers(0, 2, 4000)]
    assert mispredicted([number % 2 for number in range(4000)]) < 0.02
    assert mispredicted([int(number % 7 == 0) for number in range(4000)]) < 0.05
    assert 0.4 < mispredicted(random) < 0.6
