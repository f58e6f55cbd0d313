"""What each block of a program costs on its core: from a trace, or from its code alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from volery.native import core_model
from volery.native.assembly import End
from volery.native.encoding import Encoded, encode
from volery.native.program import Program
from volery.native.trace import Trace
from volery.native.walk import Machine, Walked, walk

Array = np.ndarray[Any, np.dtype[Any]]

REPEATS = 16


@dataclass(frozen=True)
class Costs:
    """Per block: ``cycles`` and ``instructions`` of one entry, and whether a trace has ``seen`` it."""

    cycles: Array
    instructions: Array
    seen: Array

    def total(self, counts: Array) -> float:
        """Cycles of so many entries of each block."""
        return float(self.cycles @ counts)


def static_costs(program: Program) -> Costs:
    """Costs from the code alone: each block as if it ran several times in a row, no branch mispredicted."""
    machine = Machine(program.blocks, program.pieces)
    encoded = encode(program.pieces, program.law, program.defined)
    cycles, instructions = np.zeros(len(program.blocks)), np.zeros(len(program.blocks))
    for block, first in machine.piece_of_block.items():
        own = own_pieces(machine, first)
        repeated = np.array(own * REPEATS, dtype=np.int64)
        took, _ = execute(encoded, repeated, np.zeros(len(repeated), dtype=np.int8))
        cycles[block] = took.sum() / REPEATS
        instructions[block] = sum(encoded.instructions(one) for one in own)
    return Costs(cycles, instructions, np.zeros(len(program.blocks), dtype=bool))


def traced_costs(program: Program, trace: Trace) -> tuple[Costs, Walked]:
    """Costs from what ran: the mean of each block that was entered, the others from the code alone.

    What a wrong prediction costs belongs to the way that was taken then: the more often that is taken with
    other data, the more there are.
    """
    machine = Machine(program.blocks, program.pieces)
    encoded = encode(program.pieces, program.law, program.defined)
    walked = walk(machine, trace)
    took, stalled = execute(
        encoded, np.array(walked.pieces, dtype=np.int64), np.array(walked.taken, dtype=np.int8)
    )
    size = len(program.blocks)
    owners, reached = np.array(walked.owners, dtype=np.int64), np.array(walked.reached, dtype=np.int64)
    entered = np.bincount(np.array(trace.blocks, dtype=np.int64), minlength=size)
    lengths = np.diff(encoded.first)[np.array(walked.pieces, dtype=np.int64)]
    cycles = np.bincount(owners, weights=took - stalled, minlength=size)
    cycles += np.bincount(reached, weights=stalled, minlength=size)
    instructions = np.bincount(owners, weights=lengths, minlength=size)
    static = static_costs(program)
    seen = entered > 0
    divisor = np.maximum(entered, 1)
    return Costs(
        np.where(seen, cycles / divisor, static.cycles),
        np.where(seen, instructions / divisor, static.instructions),
        seen,
    ), walked


def execute(encoded: Encoded, pieces: Array, taken: Array) -> tuple[Array, Array]:
    """Run pieces through the core model: cycles of each, and how many of them were lost to a wrong prediction
    before it.
    """
    return core_model.run(
        pieces, taken, encoded.first, encoded.table, encoded.operations, encoded.capacity, encoded.core,
        encoded.slots, encoded.library, encoded.lengths,
    )  # fmt: skip


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
