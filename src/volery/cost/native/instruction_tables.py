"""A program's machine code as the numeric tables that the core model reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from volery.cost.code_laws import CoreLaw
from volery.cost.native import core_model, isa_aarch64, isa_x86_64
from volery.cost.native.core_model import history_lengths
from volery.cost.native.machine_code import OPERATION_CLASSES, SIMILAR, Effect, End, Instruction, MachineBlock

Array = np.ndarray[Any, np.dtype[Any]]

_PIPES = {
    "integer": ("alu", "move", "increment", "shift", "conditional"),
    "branch": ("branch",),
    "multiply": ("multiply", "shifted_alu"),
    "divide": ("divide32", "divide64"),
    "load": ("load", "load_vector"),
    "store": ("store", "store_vector"),
    "vector": (
        "fp_add", "fp_compare", "fp_multiply", "fp_fma", "convert", "transfer", "vector", "vector_move",
        "vector_multiply", "shuffle", "convert_integer", "fp_flags", "vector_shift",
    ),
    "slow": ("fp_divide32", "fp_divide64", "fp_root32", "fp_root64"),
}  # fmt: skip
GROUPS = {operation: group for group, operations in _PIPES.items() for operation in operations}
"""Group of pipes by class of operations: classes of one group share pipes."""

SHARED = {"x86_64": {"multiply": "integer", "divide": "integer"}}
"""Groups whose operations take a pipe of another one, by instruction set: on cores of Intel and AMD products
and quotients begin in pipes of the integer operations (A. Fog, *The microarchitecture of Intel, AMD and VIA
CPUs*)."""

EFFECTS: dict[str, Callable[[Instruction], Effect]] = {
    "x86_64": isa_x86_64.effect,
    "aarch64": isa_aarch64.effect,
}
RESULTS = {"x86_64": ("rax", "xmm0"), "aarch64": ("x0", "v0")}


@dataclass(frozen=True)
class InstructionTables:
    """Arguments of ``core_model.run``.

    Attributes:
        first: First row of each machine block, and one more.
        table: Instructions, one a row.
        slots: Slots of the front end by instruction.
        library: Cycles and latency of a library call by instruction.
        operations: Classes of operations: latency, own pipes, group's pipes, issue queue.
        capacity: Operations that pipes start per cycle.
        core: Width, window, refill, forwarding and computed jumps of the core.
        histories: Lengths of the branch predictor's histories.
        levels: Latencies of the caches, from the first on.
        entries: Entries of each issue queue.
    """

    first: Array
    table: Array
    slots: Array
    library: Array
    operations: Array
    capacity: Array
    core: Array
    histories: Array
    levels: Array
    entries: Array

    def instructions(self, block: int) -> int:
        """Return the number of instructions of a machine block."""
        return int(self.first[block + 1] - self.first[block])


def instruction_tables(
    blocks: Sequence[MachineBlock], law: CoreLaw, defined: frozenset[str]
) -> InstructionTables:
    """Encode a program.

    Args:
        blocks: The program's machine code.
        law: The core.
        defined: Symbols that the program defines; all others belong to libraries.
    """
    registers: dict[str, int] = {}
    for name in RESULTS[law.isa]:
        registers[name] = len(registers)
    places: dict[str, int] = {}
    rows, slots, library, first = [], [], [], [0]
    for block in blocks:
        before: Effect | None = None
        for number, one in enumerate(block.instructions):
            effect = EFFECTS[law.isa](one)
            last = number == len(block.instructions) - 1
            rows.append(_row(effect, registers, places))
            fused = (
                law.isa == "x86_64"
                and one.mnemonic.startswith("j")
                and before is not None
                and "flags" in before.writes
            )
            slots.append(0.0 if fused else effect.slots)
            library.append(_library_cycles(block, defined, law, rows[-1]) if last else (0.0, 0.0))
            if last and block.end is End.BRANCH:
                rows[-1][core_model.KIND] = core_model.CONDITIONAL
            elif last and (block.end is End.COMPUTED or (block.end is End.CALL and not block.target)):
                rows[-1][core_model.KIND] = core_model.COMPUTED
            elif last and block.end is not End.FALLS and rows[-1][core_model.KIND] == core_model.PLAIN:
                rows[-1][core_model.KIND] = core_model.JUMP
            before = effect
        first.append(len(rows))
    table = np.array(rows, dtype=np.int64).reshape(-1, core_model.COLUMNS)
    operations, capacity = _operation_table(law)
    core = np.array([law.width, law.window, law.refill, law.forward, law.computed], dtype=float)
    return InstructionTables(
        np.array(first),
        table,
        np.array(slots),
        np.array(library).reshape(-1, 2),
        operations,
        capacity,
        core,
        history_lengths(law.tables, law.history),
        np.array([cache.latency for cache in law.memory.caches] if law.memory else [0.0]),
        np.array([queue.entries for queue in law.queues], dtype=np.int64),
    )


def _library_cycles(
    block: MachineBlock, defined: frozenset[str], law: CoreLaw, row: list[int]
) -> tuple[float, float]:
    """Return cycles and latency of the library call that a block ends with, and mark its row; else 0."""
    if not block.calls_library(defined):
        return 0.0, 0.0
    row[core_model.KIND] = core_model.LIBRARY
    return law.library.cycles(block.target)


def _row(effect: Effect, known: dict[str, int], places: dict[str, int]) -> list[int]:
    """Encode an instruction; new registers and places are numbered in order of appearance."""

    def operation(name: str) -> int:
        return OPERATION_CLASSES.index(name) if name else -1

    def numbers(registers: tuple[str, ...], columns: int) -> list[int]:
        found = [known.setdefault(fromkey, len(known)) for fromkey in dict.fromkeys(registers)][:columns]
        return found + [-1] * (columns - len(found))

    memory = effect.memory
    place = places.setdefault(memory.place, len(places) + 1) if memory.place else 0
    return [
        memory.size, operation(effect.load), effect.loads, operation(effect.operation), effect.times,
        operation(effect.store), place, core_model.PLAIN, memory.displacement,
        *numbers(effect.reads, core_model.READS), *numbers(memory.registers, core_model.ADDRESSES),
        *numbers(effect.writes, core_model.WRITES), *numbers(effect.bumps, core_model.BUMPS),
    ]  # fmt: skip


def _operation_table(law: CoreLaw) -> tuple[Array, Array]:
    """Return the classes of operations, with the columns of ``core_model``, and the pipes' capacity.

    Quotients and roots of numbers are computed by one unit, which each occupies until the next may begin.
    """
    groups = sorted(set(GROUPS.values()))
    shared = dict(SHARED.get(law.isa, {}))
    if law.accesses is not None:
        shared["store"] = "load"
    queues: dict[str, int] = {group: number for number, one in enumerate(law.queues) for group in one.pipes}
    capacity = np.zeros(len(OPERATION_CLASSES) + len(groups))
    table = np.zeros((len(OPERATION_CLASSES), 5))
    for number, name in enumerate(OPERATION_CLASSES):
        operation = law.operations.get(name) or law.operations[SIMILAR[name]]
        renamed = operation.latency < 0.5  # eliminated by register renaming: it takes no pipe
        pipes = shared.get(GROUPS[name], GROUPS[name])
        group = number if renamed else len(OPERATION_CLASSES) + groups.index(pipes)
        capacity[number] = operation.per_cycle
        occupies = 1.0 / operation.per_cycle if GROUPS[name] == "slow" else 1.0
        capacity[group] = max(capacity[group], operation.per_cycle * occupies)
        queue = -1 if renamed else queues.get(GROUPS[name], -1)
        table[number] = (operation.latency, number, group, queue, occupies)
    if law.accesses is not None:
        capacity[len(OPERATION_CLASSES) + groups.index("load")] = law.accesses
    return table, capacity
