"""Cost of each basic block of a program on its core: from a trace, from its code alone, or from the cache.

Costs that were taken from a trace are kept in the user's cache under the key of the program, which stands
for the code and the core.

The trace has the accesses to memory by their number in the intermediate code, which the instructions of the
machine code have as well. An instruction that ran takes address and cache level of its access at the same
position of the trace, or at the last position before: code may have been moved out of its block. Spilled
registers and constants have no number: they hit the first cache, and the core model identifies them by the
text of their address.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from volery.cost.code_laws import CoreLaw
from volery.cost.native import core_model
from volery.cost.native.build_cache import cached_path, keep_file
from volery.cost.native.compilation import OptimisedCode, compile_program
from volery.cost.native.instruction_tables import InstructionTables, instruction_tables
from volery.cost.native.instrumented_run import ADDRESS, AHEAD, LEVEL, NUMBER, POSITION, BlockTrace
from volery.cost.native.llvm_ir import access_blocks
from volery.cost.native.machine_code import End
from volery.cost.native.path_reconstruction import ExecutedPath, MachineCode, reconstruct_path
from volery.cost.pricing import STEPS_PER_CYCLE

Array = np.ndarray[Any, np.dtype[Any]]


def access_numbers(program: OptimisedCode) -> Array:
    """Return the number of the access of each row of the table of instructions; -1 for none."""
    first: dict[str, int] = {}
    for number, block in enumerate(access_blocks(program.text)):
        first.setdefault(program.blocks[block].function, number)
    return np.array(
        [
            first[block.function] + instruction.access - 1
            if instruction.access and block.function in first
            else -1
            for block in program.machine_blocks
            for instruction in block.instructions
        ],
        dtype=np.int64,
    )


@dataclass(frozen=True)
class ExecutedAccesses:
    """Accesses of the instructions that ran.

    Attributes:
        addresses: Address by instruction that ran, -1 where it is not known or there is none.
        misses: Rows (step of the path, row of the table of instructions, level, fetched ahead), in order, of
            the accesses that the first cache did not serve.
    """

    addresses: Array
    misses: Array


def executed_accesses(path: ExecutedPath, tables: InstructionTables, numbers: Array) -> ExecutedAccesses:
    """Assign the accesses of the trace to the instructions that ran.

    Args:
        path: What ran.
        tables: The program's instructions.
        numbers: Number of the access of each instruction in the tables, -1 for none.
    """
    blocks = np.array(path.blocks, dtype=np.int64)
    lengths = np.diff(tables.first)[blocks]
    steps = np.repeat(np.arange(len(blocks)), lengths)
    rows = (
        np.arange(lengths.sum())
        - np.repeat(np.cumsum(lengths) - lengths, lengths)
        + tables.first[blocks][steps]
    )
    addresses = np.full(len(rows), -1, dtype=np.int64)
    loads_or_stores = np.any(tables.table[:, [core_model.LOAD, core_model.STORE]] >= 0, axis=1)
    accesses = (numbers >= 0) & loads_or_stores & (tables.table[:, core_model.KIND] == core_model.PLAIN)
    places = np.flatnonzero(accesses[rows]) if len(path.accesses) else np.zeros(0, dtype=np.int64)
    if not len(places):
        return ExecutedAccesses(addresses, np.zeros((0, 4), dtype=np.int64))
    positions = np.array(path.positions, dtype=np.int64)[steps[places]]
    wanted = numbers[rows[places]]
    scale = max(int(positions.max()), int(path.accesses[:, POSITION].max())) + 2
    keys = path.accesses[:, NUMBER] * scale + path.accesses[:, POSITION]
    order = np.argsort(keys, kind="stable")
    at = np.searchsorted(keys[order], wanted * scale + positions, side="right") - 1
    at = np.where((at < 0) | (path.accesses[order[at], NUMBER] != wanted), at + 1, at)
    at = np.minimum(at, len(order) - 1)
    known = path.accesses[order[at], NUMBER] == wanted
    found, places = path.accesses[order[at[known]]], places[known]
    addresses[places] = found[:, ADDRESS]
    missing = found[:, LEVEL] > 0
    misses = [steps[places], rows[places], found[:, LEVEL], found[:, AHEAD]]
    return ExecutedAccesses(addresses, np.stack(misses, axis=1)[missing])


REPEATS = 16
LINE_BYTES = 64.0


@dataclass(frozen=True)
class BlockCosts:
    """Costs by basic block.

    Attributes:
        cycles: Cycles of one entry.
        instructions: Instructions of one entry.
        memory: Time of one entry that it waits for memory in addition to its cycles, ns.
        seen: Whether a trace contains the block.
    """

    cycles: Array
    instructions: Array
    memory: Array
    seen: Array

    def total(self, counts: Array) -> float:
        """Return the cycles of ``counts`` entries of each block."""
        return float(self.cycles @ counts)

    def waiting(self, counts: Array) -> float:
        """Return the time of waiting for memory in ``counts`` entries of each block, ns."""
        return float(self.memory @ counts)


def block_steps(cycles: Array, memory: Array, frequency_mhz: float, charged: Array) -> Array:
    """Return the whole steps of one entry of each block, which ``ProcessorPrices.compiled_code`` prices.

    Args:
        cycles: Cycles of one entry.
        memory: Waiting for memory in one entry, ns.
        frequency_mhz: Frequency of the core, MHz.
        charged: Whether a block is charged; blocks of the framework have prices of their own.
    """
    whole = (cycles + memory * frequency_mhz / 1000.0) * charged
    steps: Array = np.rint(whole * STEPS_PER_CYCLE).astype(np.int64)
    return steps


def static_costs(program: OptimisedCode) -> BlockCosts:
    """Estimate costs from the code alone: each block runs several times in a row, without mispredictions."""
    code = MachineCode(program.blocks, program.machine_blocks)
    tables = instruction_tables(program.machine_blocks, program.law, program.defined)
    cycles, instructions = np.zeros(len(program.blocks)), np.zeros(len(program.blocks))
    for block, first in code.first_of_block.items():
        own = blocks_of(code, first)
        repeated = np.array(own * REPEATS, dtype=np.int64)
        block_cycles, _ = execute(tables, ExecutionSequence(repeated, np.zeros(len(repeated), dtype=np.int8)))
        cycles[block] = block_cycles.sum() / REPEATS
        instructions[block] = sum(tables.instructions(one) for one in own)
    none = np.zeros(len(program.blocks))
    return BlockCosts(cycles, instructions, none, none > 0.0)


def traced_costs(program: OptimisedCode, trace: BlockTrace) -> tuple[BlockCosts, ExecutedPath, float]:
    """Return costs from a trace: the mean of each block that was entered, the others from the code alone.

    Beside them are the path and the share of the cycles that was lost to mispredicted branches.

    The cost of a misprediction belongs to the edge that was taken then: the more often other data take that
    edge, the more mispredictions there are.
    """
    code = MachineCode(program.blocks, program.machine_blocks)
    tables = instruction_tables(program.machine_blocks, program.law, program.defined)
    path = reconstruct_path(code, trace.at_their_blocks(access_blocks(program.text)))
    accesses = executed_accesses(path, tables, access_numbers(program))
    sequence = ExecutionSequence(
        np.array(path.blocks, dtype=np.int64),
        np.array(path.taken, dtype=np.int8),
        accesses.misses,
        accesses.addresses,
    )
    cycles, stalled = execute(tables, sequence)
    size = len(program.blocks)
    owners, reached = np.array(path.owners, dtype=np.int64), np.array(path.reached, dtype=np.int64)
    entered = np.bincount(np.array(trace.blocks, dtype=np.int64), minlength=size)
    lengths = np.diff(tables.first)[sequence.blocks]
    block_cycles = np.bincount(owners, weights=cycles - stalled, minlength=size)
    block_cycles += np.bincount(reached, weights=stalled, minlength=size)
    instructions = np.bincount(owners, weights=lengths, minlength=size)
    waiting_ns = _waiting_ns(program.law, tables, sequence, cycles)
    waited = np.bincount(owners, weights=waiting_ns, minlength=size)
    static = static_costs(program)
    seen = entered > 0
    divisor = np.maximum(entered, 1)
    return (
        BlockCosts(
            np.where(seen, block_cycles / divisor, static.cycles),
            np.where(seen, instructions / divisor, static.instructions),
            np.maximum(waited, 0.0) / divisor,
            seen,
        ),
        path,
        float(stalled.sum() / max(cycles.sum(), 1.0)),
    )


@dataclass(frozen=True)
class ExecutionSequence:
    """What ran: machine blocks in order, whether the branch of each was taken, misses and addresses.

    Misses and addresses are those of ``ExecutedAccesses``; without addresses none is known.
    """

    blocks: Array
    taken: Array
    misses: Array = field(default_factory=lambda: np.zeros((0, 4), dtype=np.int64))
    addresses: Array | None = None


def execute(
    tables: InstructionTables,
    sequence: ExecutionSequence,
    memory_cycles: tuple[float, float] | None = None,
) -> tuple[Array, Array]:
    """Run a sequence through the core model.

    Args:
        tables: The program's instructions.
        sequence: What ran.
        memory_cycles: Latency of memory and time of one line, cycles; by default memory is as fast as the
            last cache.

    Returns:
        Cycles of each machine block, and the part lost to a misprediction before it.
    """
    addresses = sequence.addresses
    if addresses is None:
        addresses = np.full(int(np.diff(tables.first)[sequence.blocks].sum()), -1, dtype=np.int64)
    last = tables.levels[-1:] if memory_cycles is None else np.array(memory_cycles[:1])
    return core_model.run(
        sequence.blocks, sequence.taken, tables.first, tables.table, tables.operations, tables.capacity,
        tables.core, tables.slots, tables.library, tables.histories, sequence.misses, addresses,
        np.concatenate([tables.levels, last]), 0.0 if memory_cycles is None else memory_cycles[1],
        tables.entries,
    )  # fmt: skip


def _waiting_ns(law: CoreLaw, tables: InstructionTables, sequence: ExecutionSequence, cycles: Array) -> Array:
    """Return the additional time of each machine block because memory is slower than the last cache, ns.

    It is taken at the core's greatest frequency, where the least of it is hidden.
    """
    if law.memory is None or not np.any(sequence.misses[:, core_model.LEVEL] == len(law.memory.caches)):
        return np.zeros(len(cycles))
    per_ns = law.greatest_mhz / 1000.0
    line = LINE_BYTES / law.memory.bytes_per_ns
    slower, _ = execute(tables, sequence, (law.memory.latency_ns * per_ns, line * per_ns))
    return (slower - cycles) / per_ns


def blocks_of(code: MachineCode, first: int) -> list[int]:
    """Return the machine blocks of a basic block, from ``first`` to the beginning of another basic block."""
    own = [first]
    number = first
    while code.machine_blocks[number].end in (End.FALLS, End.CALL):
        number += 1
        if number >= len(code.machine_blocks) or number in code.block_of_first:
            break
        own.append(number)
    return own


# -- costs kept in the user's cache


def load_costs(key: str) -> BlockCosts | None:
    """Return the costs kept under an ``OptimisedCode.key``, or None."""
    try:
        with np.load(cached_path(_name(key))) as kept:
            return BlockCosts(kept["cycles"], kept["instructions"], kept["memory"], kept["seen"])
    except (OSError, KeyError, ValueError):
        return None


def save_costs(key: str, costs: BlockCosts) -> None:
    """Keep costs under an ``OptimisedCode.key``; do nothing where the cache cannot be written."""
    with TemporaryDirectory(prefix="volery-native-") as folder:
        new = Path(folder, _name(key))
        np.savez(new, **asdict(costs))
        keep_file(new, new.name)


def _name(key: str) -> str:
    return f"{key}.npz"


# -- for components


@dataclass(frozen=True)
class Instrumented:
    """An object file that exports ``uint64_t volery_counters[]`` and ``volery_counters_length``.

    Attributes:
        object_file: The object file, for this machine.
        costs: Costs by counter.
        law: The core that the costs are for.
        functions: Symbol of the function that each counter is in.
        key: The program's key.
        estimated: Warning for a report, empty where the costs come from a trace of this very code.
    """

    object_file: Path
    costs: BlockCosts
    law: CoreLaw
    functions: tuple[str, ...]
    key: str
    estimated: str = ""


def instrument(sources: Sequence[Path], law: CoreLaw, out: Path, flags: Sequence[str] = ()) -> Instrumented:
    """Compile sources for a core and write the counting object for this machine.

    The costs are those kept from an earlier trace of the same code, else from the code alone.

    Args:
        sources: C and C++ files.
        law: The core.
        out: The object file to write.
        flags: Options of the compiler's front end.

    Raises:
        CompilerError: The sources do not compile; the message is the compiler's.
        UsageError: LLVM is missing.
    """
    program = compile_program(sources, law, flags)
    program.counted_object(out)
    functions = tuple(block.function for block in program.blocks)
    kept = load_costs(program.key)
    if kept is not None:
        return Instrumented(out, kept, law, functions, program.key)
    names = ", ".join(source.name for source in sources)
    warning = (
        f"the cost of {names} on {law.name} comes from the code alone; 'volery cost profile' measures it"
    )
    return Instrumented(out, static_costs(program), law, functions, program.key, warning)
