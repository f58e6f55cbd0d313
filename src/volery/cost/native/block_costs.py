"""What each block of a program costs on its core: from a trace, or from its code alone.

Costs that were taken from a trace, kept in the user's cache by what was compiled for what.

For components: sources become one object that counts its blocks, and what each block costs.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from volery.cost.code_laws import CoreLaw
from volery.cost.native import core_model
from volery.cost.native.assembly import End
from volery.cost.native.cache_misses import cache_misses
from volery.cost.native.compilation import Program, compile_program
from volery.cost.native.instruction_tables import InstructionTables, instruction_tables
from volery.cost.native.instrumented_run import BlockTrace
from volery.cost.native.llvm_ir import access_counts
from volery.cost.native.path_reconstruction import ExecutedPath, MachineCode, reconstruct_path

Array = np.ndarray[Any, np.dtype[Any]]

REPEATS = 16
LINE_BYTES = 64.0


@dataclass(frozen=True)
class BlockCosts:
    """Per block: ``cycles`` and ``instructions`` of one entry, the nanoseconds it waits for ``memory`` beside
    its cycles, and whether a trace has ``seen`` it.
    """

    cycles: Array
    instructions: Array
    memory: Array
    seen: Array

    def total(self, counts: Array) -> float:
        """Cycles of so many entries of each block."""
        return float(self.cycles @ counts)

    def waiting(self, counts: Array) -> float:
        """Nanoseconds of waiting for memory in so many entries of each block."""
        return float(self.memory @ counts)


def static_costs(program: Program) -> BlockCosts:
    """Costs from the code alone: each block as if it ran several times in a row, no branch mispredicted."""
    machine = MachineCode(program.blocks, program.pieces)
    encoded = instruction_tables(program.pieces, program.law, program.defined)
    cycles, instructions = np.zeros(len(program.blocks)), np.zeros(len(program.blocks))
    for block, first in machine.piece_of_block.items():
        own = blocks_of(machine, first)
        repeated = np.array(own * REPEATS, dtype=np.int64)
        took, _ = execute(encoded, ExecutionSequence(repeated, np.zeros(len(repeated), dtype=np.int8)))
        cycles[block] = took.sum() / REPEATS
        instructions[block] = sum(encoded.instructions(one) for one in own)
    none = np.zeros(len(program.blocks))
    return BlockCosts(cycles, instructions, none, none > 0.0)


def traced_costs(program: Program, trace: BlockTrace) -> tuple[BlockCosts, ExecutedPath]:
    """Costs from what ran: the mean of each block that was entered, the others from the code alone.

    What a wrong prediction costs belongs to the way that was taken then: the more often that is taken with
    other data, the more there are.
    """
    machine = MachineCode(program.blocks, program.pieces)
    encoded = instruction_tables(program.pieces, program.law, program.defined)
    walked = reconstruct_path(machine, trace)
    late = cache_misses(walked, encoded, access_counts(program.text))
    ran = ExecutionSequence(
        np.array(walked.pieces, dtype=np.int64), np.array(walked.taken, dtype=np.int8), late
    )
    took, stalled = execute(encoded, ran)
    size = len(program.blocks)
    owners, reached = np.array(walked.owners, dtype=np.int64), np.array(walked.reached, dtype=np.int64)
    entered = np.bincount(np.array(trace.blocks, dtype=np.int64), minlength=size)
    lengths = np.diff(encoded.first)[np.array(walked.pieces, dtype=np.int64)]
    cycles = np.bincount(owners, weights=took - stalled, minlength=size)
    cycles += np.bincount(reached, weights=stalled, minlength=size)
    instructions = np.bincount(owners, weights=lengths, minlength=size)
    waited = np.bincount(owners, weights=_waiting_ns(program.law, encoded, ran, took), minlength=size)
    static = static_costs(program)
    seen = entered > 0
    divisor = np.maximum(entered, 1)
    return BlockCosts(
        np.where(seen, cycles / divisor, static.cycles),
        np.where(seen, instructions / divisor, static.instructions),
        np.maximum(waited, 0.0) / divisor,
        seen,
    ), walked


@dataclass(frozen=True)
class ExecutionSequence:
    """Pieces in the order in which they ran, whether the branch of each was taken, and which accesses the
    first cache did not serve (``memory.served_late``).
    """

    pieces: Array
    taken: Array
    late: Array = field(default_factory=lambda: np.zeros((0, 4), dtype=np.int64))


def execute(
    encoded: InstructionTables, ran: ExecutionSequence, memory_cycles: tuple[float, float] | None = None
) -> tuple[Array, Array]:
    """Run pieces through the core model: cycles of each, and how many of them were lost to a wrong prediction
    before it.

    *memory_cycles*: the latency of memory and what a line takes; unless given, memory is as fast as the last
    cache.
    """
    last = encoded.levels[-1:] if memory_cycles is None else np.array(memory_cycles[:1])
    return core_model.run(
        ran.pieces, ran.taken, encoded.first, encoded.table, encoded.operations, encoded.capacity,
        encoded.core, encoded.slots, encoded.library, encoded.lengths, ran.late,
        np.concatenate([encoded.levels, last]), 0.0 if memory_cycles is None else memory_cycles[1],
    )  # fmt: skip


def _waiting_ns(law: CoreLaw, encoded: InstructionTables, ran: ExecutionSequence, took: Array) -> Array:
    """What each piece takes longer because memory is slower than the last cache: at the core's greatest
    frequency, where least of it is hidden.
    """
    if law.memory is None or not np.any(ran.late[:, core_model.LEVEL] == len(law.memory.caches)):
        return np.zeros(len(took))
    per_ns = law.greatest_mhz / 1000.0
    line = LINE_BYTES / law.memory.bytes_per_ns
    slower, _ = execute(encoded, ran, (law.memory.latency_ns * per_ns, line * per_ns))
    return (slower - took) / per_ns


def blocks_of(machine: MachineCode, first: int) -> list[int]:
    """The pieces of a block that follow its first one without another block's beginning."""
    own = [first]
    number = first
    while machine.pieces[number].end in (End.FALLS, End.CALL):
        number += 1
        if number >= len(machine.pieces) or number in machine.block_of_piece:
            break
        own.append(number)
    return own


def cache_folder() -> Path:
    """Where costs are kept: ``VOLERY_CACHE``, or ``volery`` in the user's cache."""
    named = os.environ.get("VOLERY_CACHE")
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "volery"


def load_costs(key: str) -> BlockCosts | None:
    """The costs kept for the code and core of that ``Program.key``, if there are any."""
    try:
        with np.load(_file(key)) as kept:
            return BlockCosts(kept["cycles"], kept["instructions"], kept["memory"], kept["seen"])
    except (OSError, KeyError, ValueError):
        return None


def save_costs(key: str, costs: BlockCosts) -> None:
    """Keep costs; without a place to write, nothing is kept."""
    file = _file(key)
    new = file.with_suffix(f".{os.getpid()}.npz")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez(new, **asdict(costs))
        new.replace(file)
    except OSError:
        return


def _file(key: str) -> Path:
    return cache_folder() / "native" / f"{key}.npz"


@dataclass(frozen=True)
class Instrumented:
    """An object that exports ``uint64_t volery_counters[]`` and ``volery_counters_length``; costs by counter.

    ``functions`` are the symbols of the functions that the counters are in; ``key`` is the program's.
    ``estimated`` says what a report has to say, empty where the costs come from a trace of this very code.
    """

    object_file: Path
    costs: BlockCosts
    law: CoreLaw
    functions: tuple[str, ...]
    key: str
    estimated: str = ""


def instrument(sources: Sequence[Path], law: CoreLaw, out: Path, flags: Sequence[str] = ()) -> Instrumented:
    """Compile *sources* for the core of *law*, write the counting object for this machine to *out*.

    Costs are those kept from an earlier trace of the same code, or else from the code alone, which
    ``estimated`` says. ``cycles`` of a stretch are ``costs.total(counters_after - counters_before)``.
    ``CompilerError`` has the compiler's words, ``UsageError`` says which package brings LLVM.
    """
    program = compile_program(sources, law, flags)
    program.counted_object(out)
    functions = tuple(block.function for block in program.blocks)
    kept = load_costs(program.key)
    if kept is not None:
        return Instrumented(out, kept, law, functions, program.key)
    names = ", ".join(source.name for source in sources)
    said = f"the cost of {names} on {law.name} comes from its code alone; calibrate components learns it"
    return Instrumented(out, static_costs(program), law, functions, program.key, said)
