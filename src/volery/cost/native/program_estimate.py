"""Estimate of one run of a program on a core: cycles, instructions, cost by source line, what is left out."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from volery.cost.code_laws import TimeBand, time_band
from volery.cost.native.block_costs import BlockCosts, blocks_of, save_costs, traced_costs
from volery.cost.native.build_cache import cached_file
from volery.cost.native.compilation import OptimisedCode
from volery.cost.native.instrumented_run import (
    WINDOW,
    Invocation,
    block_counts,
    build_executable,
    trace_blocks,
)
from volery.cost.native.llvm_ir import critical_edges
from volery.cost.native.machine_code import MachineBlock
from volery.cost.native.path_reconstruction import MachineCode

Array = np.ndarray[Any, np.dtype[Any]]

MOST_TRACED = 400_000
"""Blocks that are traced at most; a longer run is sampled in windows."""


@dataclass(frozen=True)
class SourceLineCost:
    """A source line, ``file:line``: its share of all cycles, and the entries of blocks that contain it."""

    source: str
    share: float
    entries: int


@dataclass(frozen=True)
class ProgramEstimate:
    """Cost of one run.

    Attributes:
        cycles: Cycles of the core.
        memory_ns: Waiting for memory, ns, at every frequency of the core.
        instructions: Executed instructions.
        counts: Entries of each basic block.
        costs: Costs by basic block.
        places: Cost by source line, the greatest first.
        library_calls: Number of calls by library function.
        left_out: Sentences on what limits the estimate.
        band: How far measured times lie from such estimates.
    """

    cycles: float
    memory_ns: float
    instructions: float
    counts: Array
    costs: BlockCosts
    places: tuple[SourceLineCost, ...]
    library_calls: dict[str, int]
    left_out: tuple[str, ...]
    band: TimeBand

    def seconds(self, mhz: float) -> float:
        """Return the execution time at a frequency in MHz, s."""
        return self.cycles / (mhz * 1e6) + self.memory_ns * 1e-9


def estimate_program(program: OptimisedCode, invocation: Invocation) -> ProgramEstimate:
    """Count and trace one run; keep the costs for the same code on the same core."""
    with TemporaryDirectory(prefix="volery-native-") as made:
        folder = Path(made)
        counting, tracing = folder / "counting", folder / "tracing"
        for one in (counting, tracing):
            one.mkdir()
        code = cached_file(f"{program.key}.counted.o", counting, program.counted_object)
        counted = build_executable(program, invocation, code, counting)
        counts = block_counts(counted, invocation, counting)
        stride = WINDOW * max(1, -(-int(counts.sum()) // MOST_TRACED))
        code = cached_file(f"{program.key}.traced.o", tracing, program.traced_object)
        traced = build_executable(program, invocation, code, tracing)
        trace = trace_blocks(traced, invocation, tracing, stride, program.law.memory)
    costs, path, lost = traced_costs(program, trace)
    save_costs(program.key, costs)
    calls = library_calls(program, counts)
    return ProgramEstimate(
        costs.total(counts),
        costs.waiting(counts),
        float(costs.instructions @ counts),
        counts,
        costs,
        costs_by_line(program, costs, counts),
        dict(calls),
        _left_out(program, costs, counts, calls, path.lost / max(len(trace.blocks), 1)),
        time_band(costs.total(counts), lost),
    )


def library_calls(program: OptimisedCode, counts: Array) -> Counter[str]:
    """Return the number of calls of each library function."""
    code = MachineCode(program.blocks, program.machine_blocks)
    calls: Counter[str] = Counter()
    for block, first in code.first_of_block.items():
        for number in blocks_of(code, first):
            machine_block = program.machine_blocks[number]
            if counts[block] and machine_block.calls_library(program.defined):
                calls[machine_block.target] += int(counts[block])
    return calls


def costs_by_line(program: OptimisedCode, costs: BlockCosts, counts: Array) -> tuple[SourceLineCost, ...]:
    """Return the cost of each source line, the greatest first.

    A block's cycles are spread evenly over its instructions. The cost of an edge between blocks, mostly
    mispredictions, is charged to the line that the edge comes from.
    """
    code = MachineCode(program.blocks, program.machine_blocks)
    cycles: Counter[str] = Counter()
    entries: Counter[str] = Counter()
    for block, first in code.first_of_block.items():
        if not counts[block]:
            continue
        lines = [
            instruction.source
            for number in blocks_of(code, first)
            for instruction in program.machine_blocks[number].instructions
        ]
        for line in lines:
            cycles[line] += costs.cycles[block] * float(counts[block]) / len(lines)
        for line in set(lines):
            entries[line] += int(counts[block])
    for edge, block in critical_edges(program.text).items():
        if edge not in code.first_of_block and counts[edge]:
            cycles[_last_line(code, block)] += costs.cycles[edge] * float(counts[edge])
    total = sum(cycles.values()) or 1.0
    return tuple(
        SourceLineCost(line, spent / total, entries[line]) for line, spent in cycles.most_common() if line
    )


def _last_line(code: MachineCode, block: int) -> str:
    """Return the line of a block's last instruction; empty where the block has no machine code of its own."""
    first = code.first_of_block.get(block)
    if first is None:
        return ""
    last: MachineBlock = code.machine_blocks[blocks_of(code, first)[-1]]
    return last.instructions[-1].source if last.instructions else ""


def _left_out(
    program: OptimisedCode, costs: BlockCosts, counts: Array, calls: Counter[str], lost: float
) -> tuple[str, ...]:
    found = [] if program.law.memory else ["every access to memory is taken to hit the first cache"]
    law = program.law.library
    unknown = {name: count for name, count in calls.items() if name not in law.calls}
    if unknown:
        named = ", ".join(f"{name} ({count})" for name, count in Counter(unknown).most_common(4))
        found.append(f"library calls without a figure are taken at {law.unknown:g} cycles each: {named}")
    unseen = float((costs.cycles * counts)[~costs.seen].sum()) / max(costs.total(counts), 1.0)
    if unseen > 0.01:
        found.append(
            f"{unseen:.0%} of the cycles are of blocks that the trace has not met: from their code alone"
        )
    if lost > 0.01:
        found.append(f"at {lost:.1%} of the traced blocks the way through the machine code was not clear")
    return tuple(found)
