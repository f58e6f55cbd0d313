"""What each block of a program costs on its core: from a trace, or from its code alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from volery.cost.core import CoreLaw
from volery.cost.native import core_model
from volery.cost.native.assembly import End
from volery.cost.native.code import accesses_of
from volery.cost.native.encoding import Encoded, encode
from volery.cost.native.memory import served_late
from volery.cost.native.program import Program
from volery.cost.native.trace import Trace
from volery.cost.native.walk import Machine, Walked, walk

Array = np.ndarray[Any, np.dtype[Any]]

REPEATS = 16
LINE_BYTES = 64.0


@dataclass(frozen=True)
class Costs:
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


def static_costs(program: Program) -> Costs:
    """Costs from the code alone: each block as if it ran several times in a row, no branch mispredicted."""
    machine = Machine(program.blocks, program.pieces)
    encoded = encode(program.pieces, program.law, program.defined)
    cycles, instructions = np.zeros(len(program.blocks)), np.zeros(len(program.blocks))
    for block, first in machine.piece_of_block.items():
        own = own_pieces(machine, first)
        repeated = np.array(own * REPEATS, dtype=np.int64)
        took, _ = execute(encoded, Ran(repeated, np.zeros(len(repeated), dtype=np.int8)))
        cycles[block] = took.sum() / REPEATS
        instructions[block] = sum(encoded.instructions(one) for one in own)
    none = np.zeros(len(program.blocks))
    return Costs(cycles, instructions, none, none > 0.0)


def traced_costs(program: Program, trace: Trace) -> tuple[Costs, Walked]:
    """Costs from what ran: the mean of each block that was entered, the others from the code alone.

    What a wrong prediction costs belongs to the way that was taken then: the more often that is taken with
    other data, the more there are.
    """
    machine = Machine(program.blocks, program.pieces)
    encoded = encode(program.pieces, program.law, program.defined)
    walked = walk(machine, trace)
    late = served_late(walked, encoded, accesses_of(program.text))
    ran = Ran(np.array(walked.pieces, dtype=np.int64), np.array(walked.taken, dtype=np.int8), late)
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
    return Costs(
        np.where(seen, cycles / divisor, static.cycles),
        np.where(seen, instructions / divisor, static.instructions),
        np.maximum(waited, 0.0) / divisor,
        seen,
    ), walked


@dataclass(frozen=True)
class Ran:
    """Pieces in the order in which they ran, whether the branch of each was taken, and which accesses the
    first cache did not serve (``memory.served_late``).
    """

    pieces: Array
    taken: Array
    late: Array = field(default_factory=lambda: np.zeros((0, 4), dtype=np.int64))


def execute(
    encoded: Encoded, ran: Ran, memory_cycles: tuple[float, float] | None = None
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


def _waiting_ns(law: CoreLaw, encoded: Encoded, ran: Ran, took: Array) -> Array:
    """What each piece takes longer because memory is slower than the last cache: at the core's greatest
    frequency, where least of it is hidden.
    """
    if law.memory is None or not np.any(ran.late[:, core_model.LEVEL] == len(law.memory.caches)):
        return np.zeros(len(took))
    per_ns = law.greatest_mhz / 1000.0
    line = LINE_BYTES / law.memory.bytes_per_ns
    slower, _ = execute(encoded, ran, (law.memory.latency_ns * per_ns, line * per_ns))
    return (slower - took) / per_ns


def own_pieces(machine: Machine, first: int) -> list[int]:
    """The pieces of a block that follow its first one without another block's beginning."""
    own = [first]
    number = first
    while machine.pieces[number].end in (End.FALLS, End.CALL):
        number += 1
        if number >= len(machine.pieces) or number in machine.block_of_piece:
            break
        own.append(number)
    return own
