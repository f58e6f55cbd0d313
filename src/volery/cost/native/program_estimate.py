"""One program, one core, one run: its cycles, its instructions, where they go, and what is left out."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from volery.cost.native.assembly import End
from volery.cost.native.block_costs import BlockCosts, blocks_of, save_costs, traced_costs
from volery.cost.native.compilation import Program
from volery.cost.native.instrumented_run import (
    WINDOW,
    Invocation,
    block_counts,
    build_executable,
    trace_blocks,
)
from volery.cost.native.llvm_ir import critical_edges
from volery.cost.native.path_reconstruction import MachineCode

Array = np.ndarray[Any, np.dtype[Any]]

MOST_TRACED = 400_000
"""Blocks that are traced at most; the rest of a longer program is sampled in windows."""


@dataclass(frozen=True)
class SourceLineCost:
    """A line of source, ``file:line``: its share of all cycles, and how many blocks with it were entered."""

    source: str
    share: float
    entries: int


@dataclass(frozen=True)
class ProgramEstimate:
    """What one run costs: cycles of the core, and nanoseconds of waiting for ``memory``, whatever the core's
    frequency. ``left_out`` says, in sentences, what a reader must know to judge the figure.
    """

    cycles: float
    memory_ns: float
    instructions: float
    counts: Array
    costs: BlockCosts
    places: tuple[SourceLineCost, ...]
    library_calls: dict[str, int]
    left_out: tuple[str, ...]

    def seconds(self, mhz: float) -> float:
        """How long it takes at that frequency."""
        return self.cycles / (mhz * 1e6) + self.memory_ns * 1e-9


def estimate_program(program: Program, wanted: Invocation) -> ProgramEstimate:
    """Trace and count one run of *wanted*; costs are kept for the same code on the same core."""
    with TemporaryDirectory(prefix="volery-native-") as made:
        folder = Path(made)
        counting, tracing = folder / "counting", folder / "tracing"
        for one in (counting, tracing):
            one.mkdir()
        program.counted_object(counting / "code.o")
        entered = block_counts(
            build_executable(program, wanted, counting / "code.o", counting), wanted, counting
        )
        program.traced_object(tracing / "code.o")
        stride = WINDOW * max(1, -(-int(entered.sum()) // MOST_TRACED))
        traced = build_executable(program, wanted, tracing / "code.o", tracing)
        run = trace_blocks(traced, wanted, tracing, stride, program.law.memory)
    costs, walked = traced_costs(program, run)
    save_costs(program.key, costs)
    calls = library_calls(program, entered)
    return ProgramEstimate(
        costs.total(entered),
        costs.waiting(entered),
        float(costs.instructions @ entered),
        entered,
        costs,
        costs_by_line(program, costs, entered),
        dict(calls),
        _left_out(program, costs, entered, calls, walked.lost / max(len(run.blocks), 1)),
    )


def library_calls(program: Program, entered: Array) -> Counter[str]:
    """How often each function of a library was called."""
    machine = MachineCode(program.blocks, program.pieces)
    calls: Counter[str] = Counter()
    for block, first in machine.piece_of_block.items():
        for number in blocks_of(machine, first):
            piece = program.pieces[number]
            leaves = piece.end in (End.CALL, End.JUMP) and piece.target and not piece.target.startswith(".L")
            if leaves and piece.target not in program.defined and entered[block]:
                calls[piece.target] += int(entered[block])
    return calls


def costs_by_line(program: Program, costs: BlockCosts, entered: Array) -> tuple[SourceLineCost, ...]:
    """Lines of source by cost: a block's cycles spread evenly over its instructions. What ways between blocks
    take, wrong predictions mostly, is the line's that they come from.
    """
    machine = MachineCode(program.blocks, program.pieces)
    cycles: Counter[str] = Counter()
    entries: Counter[str] = Counter()
    for block, first in machine.piece_of_block.items():
        if not entered[block]:
            continue
        lines = [
            one.source for number in blocks_of(machine, first) for one in program.pieces[number].instructions
        ]
        for line in lines:
            cycles[line] += costs.cycles[block] * float(entered[block]) / len(lines)
        for line in set(lines):
            entries[line] += int(entered[block])
    for edge, block in critical_edges(program.text).items():
        if edge not in machine.piece_of_block and entered[edge]:
            line = _last_line(program, machine, block)
            cycles[line] += costs.cycles[edge] * float(entered[edge])
    total = sum(cycles.values()) or 1.0
    return tuple(
        SourceLineCost(line, spent / total, entries[line]) for line, spent in cycles.most_common() if line
    )


def _last_line(program: Program, machine: MachineCode, block: int) -> str:
    """The line of a block's last instruction; empty where the block has none of its own."""
    first = machine.piece_of_block.get(block)
    if first is None:
        return ""
    last = program.pieces[blocks_of(machine, first)[-1]].instructions
    return last[-1].source if last else ""


def _left_out(
    program: Program, costs: BlockCosts, entered: Array, calls: Counter[str], lost: float
) -> tuple[str, ...]:
    said = [] if program.law.memory else ["every access to memory is taken to hit the first cache"]
    law = program.law.library
    unknown = {name: count for name, count in calls.items() if name not in law.calls}
    if unknown:
        named = ", ".join(f"{name} ({count})" for name, count in Counter(unknown).most_common(4))
        said.append(f"library calls without a figure are taken at {law.unknown:g} cycles each: {named}")
    unseen = float((costs.cycles * entered)[~costs.seen].sum()) / max(costs.total(entered), 1.0)
    if unseen > 0.01:
        said.append(
            f"{unseen:.0%} of the cycles are of blocks that the trace has not met: from their code alone"
        )
    if lost > 0.01:
        said.append(f"at {lost:.1%} of the traced blocks the way through the machine code was not clear")
    return tuple(said)
