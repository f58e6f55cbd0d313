"""A program's machine code as the tables of numbers that the core model reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from volery.cost.code_laws import CoreLaw
from volery.cost.native import core_model, isa_aarch64, isa_x86_64
from volery.cost.native.assembly import OPERATION_CLASSES, Effect, End, Instruction, MachineBlock
from volery.cost.native.branch_prediction import history_lengths

Array = np.ndarray[Any, np.dtype[Any]]

_SHARED = {
    "integer": ("alu", "move", "increment", "shift"),
    "branch": ("branch",),
    "multiply": ("multiply", "shifted_alu"),
    "divide": ("divide32", "divide64"),
    "load": ("load", "load_vector"),
    "store": ("store",),
    "vector": (
        "fp_add", "fp_compare", "fp_multiply", "fp_fma", "convert", "transfer", "vector", "vector_move",
        "vector_multiply", "shuffle",
    ),
    "slow": ("fp_divide32", "fp_divide64", "fp_root32", "fp_root64"),
}  # fmt: skip
GROUPS = {operation: group for group, operations in _SHARED.items() for operation in operations}
"""Which pipes an operation shares with which others."""

EFFECTS: dict[str, Callable[[Instruction], Effect]] = {
    "x86_64": isa_x86_64.effect,
    "aarch64": isa_aarch64.effect,
}
RESULTS = {"x86_64": ("rax", "xmm0"), "aarch64": ("x0", "v0")}


@dataclass(frozen=True)
class InstructionTables:
    """``first``: each piece's first row and one more; the rest are the arguments of ``core_model.run``."""

    first: Array
    table: Array
    slots: Array
    library: Array
    operations: Array
    capacity: Array
    core: Array
    lengths: Array
    levels: Array
    """Latencies of the caches, from the first on."""

    def instructions(self, piece: int) -> int:
        """How many instructions a piece has."""
        return int(self.first[piece + 1] - self.first[piece])


def instruction_tables(
    pieces: Sequence[MachineBlock], law: CoreLaw, own: frozenset[str]
) -> InstructionTables:
    """Encode a program; *own* are the symbols that it defines, all others belong to libraries."""
    names: dict[str, int] = {}
    for name in RESULTS[law.isa]:
        names[name] = len(names)
    places: dict[str, int] = {}
    rows, slots, library, first = [], [], [], [0]
    for piece in pieces:
        before: Effect | None = None
        for number, one in enumerate(piece.instructions):
            effect = EFFECTS[law.isa](one)
            last = number == len(piece.instructions) - 1
            rows.append(_row(effect, names, places))
            fused = (
                law.isa == "x86_64"
                and one.mnemonic.startswith("j")
                and before is not None
                and "flags" in before.writes
            )
            slots.append(0.0 if fused else effect.slots)
            library.append(_call(piece, own, law, rows[-1]) if last else 0.0)
            if last and piece.end is End.BRANCH:
                rows[-1][core_model.KIND] = core_model.CONDITIONAL
            elif last and piece.end is End.COMPUTED:
                rows[-1][core_model.KIND] = core_model.COMPUTED
            elif last and piece.end is not End.FALLS and rows[-1][core_model.KIND] == core_model.PLAIN:
                rows[-1][core_model.KIND] = core_model.JUMP
            before = effect
        first.append(len(rows))
    table = np.array(rows, dtype=np.int64).reshape(-1, core_model.COLUMNS)
    operations, capacity = _pipes(law)
    core = np.array([law.width, law.window, law.refill, law.forward], dtype=float)
    return InstructionTables(
        np.array(first),
        table,
        np.array(slots),
        np.array(library),
        operations,
        capacity,
        core,
        history_lengths(law.tables, law.history),
        np.array([one.latency for one in law.memory.caches] if law.memory else [0.0]),
    )


def _call(piece: MachineBlock, own: frozenset[str], law: CoreLaw, row: list[int]) -> float:
    """The cycles of a call out of the program, entered into the last row of a piece."""
    leaves = piece.end in (End.CALL, End.JUMP) and piece.target and not piece.target.startswith(".L")
    if not leaves or piece.target in own:
        return 0.0
    row[core_model.KIND] = core_model.LIBRARY
    return law.library.calls.get(piece.target, law.library.unknown)


def _row(effect: Effect, names: dict[str, int], places: dict[str, int]) -> list[int]:
    def operation(name: str) -> int:
        return OPERATION_CLASSES.index(name) if name else -1

    def numbered(registers: tuple[str, ...], room: int) -> list[int]:
        known = [names.setdefault(one, len(names)) for one in dict.fromkeys(registers)][:room]
        return known + [-1] * (room - len(known))

    memory = effect.memory
    place = places.setdefault(memory.place, len(places) + 1) if memory.place else 0
    return [
        memory.size, operation(effect.load), effect.loads, operation(effect.operation), effect.times,
        operation("store" if effect.store else ""), place, core_model.PLAIN, memory.displacement,
        *numbered(effect.reads, core_model.READS), *numbered(memory.registers, core_model.ADDRESSES),
        *numbered(effect.writes, core_model.WRITES), *numbered(effect.bumps, core_model.BUMPS),
    ]  # fmt: skip


def _pipes(law: CoreLaw) -> tuple[Array, Array]:
    """Operations as (latency, their own pipes, their group's pipes), and how much pipes start per cycle."""
    groups = sorted(set(GROUPS.values()))
    capacity = np.zeros(len(OPERATION_CLASSES) + len(groups))
    table = np.zeros((len(OPERATION_CLASSES), 3))
    for number, name in enumerate(OPERATION_CLASSES):
        operation = law.operations[name]
        renamed = operation.latency < 0.5  # takes no pipe at all
        group = number if renamed else len(OPERATION_CLASSES) + groups.index(GROUPS[name])
        capacity[number] = operation.per_cycle
        capacity[group] = max(capacity[group], operation.per_cycle)
        table[number] = (operation.latency, number, group)
    return table, capacity
