"""From a trace of basic blocks to the machine blocks that ran, in order, each with its basic block.

The trace says which blocks of the intermediate code were entered. The reconstruction follows the machine
code's own jumps and calls. At a branch it takes the successor on whose way the next block of the trace comes
first. So code that the code generator has merged, split, duplicated or moved is found where it ran. Several
paths of a switch may lead to the same block: its value is traced and followed through the comparisons that
the code generator made of it.

Debug information was rejected as the link between the blocks of the two codes: optimisation loses it where it
matters most. It links single accesses to memory (``llvm_ir.with_access_columns``).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from operator import eq, ge, gt, le, lt, ne
from typing import NamedTuple

from volery.cost.native.instrumented_run import Array, BlockTrace, no_accesses
from volery.cost.native.llvm_ir import BasicBlock
from volery.cost.native.machine_code import End, Instruction, MachineBlock

_REGISTER = re.compile(
    r"([wx])(\d+)$|(r)(\d+)([dwb]?)$|([re]?)([a-d]x|[sd]i|[sb]p)$|([a-d])l$|([sd]i|[sb]p)l$"
)
_BITS = {"w": 32, "x": 64, "r": 64, "e": 32, "": 16, "rd": 32, "rw": 16, "rb": 8}
_AMOUNT = re.compile(r"#?(-?\d+)$")
_ADDRESS = re.compile(r"\[(\w+) ([+-]) (\d+)\]$")
_ADDS = {"add": 1, "adds": 1, "sub": -1, "subs": -1}
_COPIES = {"mov", "movzx", "uxtb", "uxth"}
_COMPARES = {"cmp": 1, "cmn": -1}
_OTHER_FLAGS = (
    "test", "tst", "ccm", "fcm", "fccm", "and", "or", "xor", "bt", "bic", "ucomi", "vucomi", "shr",
)  # fmt: skip
"""Beginnings of other mnemonics that set flags."""

_UNSIGNED: dict[str, Callable[[int, int], bool]] = {
    "e": eq, "ne": ne, "b": lt, "be": le, "a": gt, "ae": ge,
}  # fmt: skip
_SIGNED: dict[str, Callable[[int, int], bool]] = {
    "l": lt, "le": le, "g": gt, "ge": ge,
}  # fmt: skip
_SAME = {"eq": "e", "lo": "b", "cc": "b", "ls": "be", "hi": "a", "hs": "ae", "cs": "ae", "lt": "l", "gt": "g"}


class _Register(NamedTuple):
    name: str
    bits: int


class _Compared(NamedTuple):
    """A comparison of a register that holds the value plus ``offset`` with a number."""

    offset: int
    amount: int
    bits: int


class SwitchResolver:
    """One execution of a switch over ``value``. Machine blocks must be given in the order of execution."""

    def __init__(self, value: int) -> None:
        self._value = value
        self._offsets: dict[str, int] = {}
        self._found = False
        self._perhaps: dict[str, tuple[str, int]] = {}
        self._compared: _Compared | None = None
        self._passed: set[int] = set()

    def taken(self, block: MachineBlock) -> bool | None:
        """Return whether the branch at the end of a machine block is taken.

        None if that does not depend on the value, as far as the instructions show, or if the block has been
        passed before: a chain of comparisons passes a block once.
        """
        if id(block) in self._passed:
            return None
        self._passed.add(id(block))
        for instruction in block.instructions:
            self._execute(instruction)
        return self._decide(block.instructions[-1]) if block.instructions else None

    def _execute(self, one: Instruction) -> None:
        name, operands = one.mnemonic, one.operands
        into = _register(operands[0]) if operands else None
        if into is None:
            return
        if name in _COMPARES or (name == "test" and operands[0] == operands[-1]):
            amount = 0 if name == "test" else _amount(operands[-1])
            self._compared = self._compare(into, None if amount is None else _COMPARES.get(name, 1) * amount)
        elif name in ("cbz", "cbnz"):
            self._compared = self._compare(into, 0)
        elif name.startswith(_OTHER_FLAGS):
            self._compared = None
        elif not name.startswith(("st", "b", "j", "tb", "push")):
            self._move(name, into, operands)

    def _move(self, name: str, into: _Register, operands: tuple[str, ...]) -> None:
        """Track a register that receives the value plus a constant."""
        out, added = _sum(name, operands)
        offset = None if out is None else self._offsets.get(out)
        if name in ("adds", "subs") or (name in _ADDS and len(operands) == 2):
            self._compared = None if offset is None else _Compared(offset, -added, into.bits)
        self._offsets.pop(into.name, None)
        self._perhaps.pop(into.name, None)
        if offset is not None:
            self._offsets[into.name] = offset + added
        elif out is not None and not self._found:
            self._perhaps[into.name] = (out, added)

    def _compare(self, register: _Register, amount: int | None) -> _Compared | None:
        """Return a comparison with a number; the first register that is compared holds the value."""
        if amount is None:
            return None
        if not self._found:
            self._found = True
            out, added = self._perhaps.get(register.name, (register.name, 0))
            self._offsets = {out: 0, register.name: added}
        offset = self._offsets.get(register.name)
        return None if offset is None else _Compared(offset, amount, register.bits)

    def _decide(self, last: Instruction) -> bool | None:
        if self._compared is None:
            return None
        name = {"cbz": "e", "cbnz": "ne"}.get(last.mnemonic) or re.sub(r"^(?:b\.|j)", "", last.mnemonic)
        condition = _SAME.get(name, name)
        offset, amount, bits = self._compared
        one, other = (self._value + offset) % (1 << bits), amount % (1 << bits)
        if condition in _UNSIGNED:
            return _UNSIGNED[condition](one, other)
        if condition in _SIGNED:
            half = 1 << (bits - 1)
            return _SIGNED[condition]((one ^ half) - half, (other ^ half) - half)
        return None


def _register(operand: str) -> _Register | None:
    match = _REGISTER.match(operand)
    if match is None:
        return None
    if match[1]:
        return _Register(match[2], _BITS[match[1]])
    if match[3]:
        return _Register(f"r{match[4]}", _BITS["r" + match[5]])
    if match[7]:
        return _Register(match[7], _BITS[match[6]])
    return _Register(f"{match[8]}x" if match[8] else match[9], 8)


def _amount(operand: str) -> int | None:
    match = _AMOUNT.match(operand)
    return int(match[1]) if match else None


def _sum(name: str, operands: tuple[str, ...]) -> tuple[str | None, int]:
    """Return the register and the constant whose sum is the result of an instruction."""
    if name in _COPIES and len(operands) == 2 and (out := _register(operands[1])):
        return out.name, 0
    if name == "lea" and (address := _ADDRESS.match(operands[1])) and (base := _register(address[1])):
        return base.name, int(address[2] + address[3])
    if name in ("inc", "dec") and (own := _register(operands[0])):
        return own.name, 1 if name == "inc" else -1
    if name in _ADDS:
        source, amount = _register(operands[-2]), _amount(operands[-1])
        if source is not None and amount is not None:
            return source.name, _ADDS[name] * amount
    return None, 0


_LOOK_AHEAD = 6
"""Records of the trace that a way may skip: blocks whose code was duplicated into the one before."""
_DEPTH = 24
_LOST = 99
_FOREIGN = 30
"""Penalty for a block that the trace does not have: the code generator has merged equal ends of blocks."""


@dataclass
class ExecutedPath:
    """What ran, one entry a machine block.

    Attributes:
        blocks: Number of the machine block.
        owners: Basic block that it is charged to.
        reached: Basic block that a stall before it is charged to: that of the edge by which it was reached.
        taken: Whether its branch was taken.
        positions: Position of its basic block in the trace.
        lost: Jumps that could not be followed.
        accesses: Accesses to memory, as in the trace.
    """

    blocks: list[int] = field(default_factory=list)
    owners: list[int] = field(default_factory=list)
    reached: list[int] = field(default_factory=list)
    taken: list[int] = field(default_factory=list)
    positions: list[int] = field(default_factory=list)
    lost: int = 0
    accesses: Array = field(default_factory=no_accesses)


class MachineCode:
    """The machine blocks of a program, and the machine block that each basic block begins with."""

    def __init__(self, blocks: Sequence[BasicBlock], machine_blocks: Sequence[MachineBlock]) -> None:
        self.machine_blocks = machine_blocks
        self.entry_block: dict[str, int] = {}
        self.labels: dict[tuple[str, str], int] = {}
        for number, machine_block in enumerate(machine_blocks):
            self.entry_block.setdefault(machine_block.function, number)
            if machine_block.label:
                self.labels[machine_block.function, machine_block.label] = number
        self.blocks = blocks
        self.entries = {block.function: number for number, block in enumerate(blocks) if block.entry}
        self.block_of_first = self._first_blocks(blocks)
        self.first_of_block: dict[int, int] = {}
        for number, block in sorted(self.block_of_first.items()):
            self.first_of_block.setdefault(block, number)

    def successors(self, number: int) -> list[int]:
        """Return the possible successors of a machine block in its function, the fall-through first."""
        machine_block = self.machine_blocks[number]
        after = [number + 1] if number + 1 < len(self.machine_blocks) else []
        if machine_block.end in (End.FALLS, End.CALL):
            return after
        if machine_block.end in (End.BRANCH, End.JUMP):
            target = self.labels.get((machine_block.function, machine_block.target))
            jump = [target] if target is not None else []
            return [*after, *jump] if machine_block.end is End.BRANCH else jump
        return []

    def _first_blocks(self, blocks: Sequence[BasicBlock]) -> dict[int, int]:
        """Return {machine block: basic block} for those that are entered from another basic block."""
        known = {(block.function, block.name): number for number, block in enumerate(blocks)}
        predecessors: dict[int, set[int]] = {}
        for number in range(len(self.machine_blocks)):
            for after in self.successors(number):
                predecessors.setdefault(after, set()).add(number)
        candidates: dict[int, list[int]] = {}
        for number, machine_block in enumerate(self.machine_blocks):
            if self.entry_block[machine_block.function] == number:
                candidates.setdefault(self.entries[machine_block.function], []).insert(0, number)
            elif machine_block.came_from is not None and (number == 0 or self._is_labelled(number)):
                block = known.get((machine_block.function, machine_block.came_from))
                if block is not None and not blocks[block].entry:
                    candidates.setdefault(block, []).append(number)
        chosen: dict[int, int] = {}
        for block, numbers in candidates.items():
            entered = [
                number for number in numbers if self._is_entered(number, predecessors.get(number, set()))
            ]
            chosen.update(dict.fromkeys(entered or numbers[:1], block))
        return chosen

    def _is_entered(self, number: int, predecessors: set[int]) -> bool:
        """Return whether a machine block is entered from another basic block."""
        came_from = self.machine_blocks[number].came_from
        return not predecessors or any(
            self.machine_blocks[predecessor].came_from != came_from for predecessor in predecessors
        )

    def _is_labelled(self, number: int) -> bool:
        """Return whether a machine block begins a labelled block (else it follows a call or branch)."""
        before, here = self.machine_blocks[number - 1], self.machine_blocks[number]
        return bool(here.label) or before.function != here.function or before.came_from != here.came_from


class _PathSearch:
    def __init__(self, code: MachineCode, trace: BlockTrace, limit: int) -> None:
        self.code = code
        followed = trace.only(code.first_of_block)
        self.trace, self.values, self.edges = followed.blocks, followed.switches, followed.edges
        self.switch, self.switch_at = SwitchResolver(0), -1
        self.limit = limit
        self.at = self.owner = self.position = 0
        self.edge: int | None = None
        self.path = ExecutedPath(accesses=followed.accesses)
        self.frames: list[tuple[int, int, int]] = []
        self._costs: dict[tuple[int, int, tuple[int, ...]], int] = {}

    def run(self) -> ExecutedPath:
        number = self._resume_at_next_record()
        while number is not None and len(self.path.blocks) < self.limit:
            number = self._step(number)
        return self.path

    def _next_record(self) -> int | None:
        return self.trace[self.at] if self.at < len(self.trace) else None

    def _resume_at_next_record(self) -> int | None:
        """Continue at the next record of the trace, wherever that is; None at its end."""
        if self.at >= len(self.trace):
            return None
        self._take(1)
        return self.code.first_of_block[self.owner]

    def _take(self, count: int) -> None:
        """Consume ``count`` records; what runs now belongs to the last of them."""
        passed = range(self.at, self.at + count)
        self.edge = next((self.edges[position] for position in passed if position in self.edges), None)
        self.at += count
        self.position = self.at - 1
        self.owner = self.trace[self.position]

    def _step(self, number: int) -> int | None:
        """Append a machine block to the path; return the next one."""
        here = self.code.machine_blocks[number]
        self.path.blocks.append(number)
        self.path.owners.append(self.owner)
        self.path.reached.append(self.owner if self.edge is None else self.edge)
        self.edge = None
        self.path.taken.append(0)
        self.path.positions.append(self.position)
        switched = self._switch_branch(here)
        if here.end is End.CALL:
            return self._call(number, here)
        if here.end is End.RETURN:
            return self._return()
        successors = self.code.successors(number)
        if not successors and here.end is End.JUMP:  # a tail call
            entry = self.code.entries.get(here.target)
            called = self._next_record() == entry and entry is not None
            return self._resume_at_next_record() if called else self._return()
        if not successors:
            self.path.taken[-1] = 1
            return self._computed_jump(here.function)
        best = min(successors, key=self._distance)
        if self._distance(best) >= _LOST:
            return self._lost()
        if switched is not None and len(successors) > 1 and self._distance(successors[switched]) < _LOST:
            best = successors[switched]
        self.path.taken[-1] = int(best != number + 1 or here.end is End.JUMP)
        return self._enter(best)

    def _switch_branch(self, here: MachineBlock) -> bool | None:
        """Return whether the branch is taken, if it is one of a traced switch, else None."""
        value = self.values.get(self.at)
        if value is None:
            return None
        if self.switch_at != self.at:
            self.switch, self.switch_at = SwitchResolver(value), self.at
        return self.switch.taken(here)

    def _call(self, number: int, here: MachineBlock) -> int | None:
        blocks = self.code.blocks
        ahead = self.trace[self.at : self.at + _LOOK_AHEAD]
        skipped = next((position for position, block in enumerate(ahead) if blocks[block].entry), None)
        # A direct call may skip records of blocks whose code was merged into one that has run; the callee of
        # a computed call follows at once.
        if skipped is not None and (
            here.target == blocks[ahead[skipped]].function if here.target else skipped == 0
        ):
            self.frames.append((number + 1, self.owner, self.position))
            self._take(skipped + 1)
            return self.code.first_of_block[self.owner]
        return self._enter(number + 1) if number + 1 < len(self.code.machine_blocks) else self._return()

    def _return(self) -> int | None:
        if not self.frames:
            return self._resume_at_next_record()
        number, self.owner, self.position = self.frames.pop()
        return self._enter(number)

    def _computed_jump(self, function: str) -> int | None:
        """Return the target of a computed jump: the next record, if it is in this function."""
        coming = self._next_record()
        if coming is not None and self.code.blocks[coming].function == function:
            return self._resume_at_next_record()
        return self._lost()

    def _lost(self) -> int | None:
        """Resume at the next record after an exception or a jump out of a library."""
        self.path.lost += 1
        coming = self._next_record()
        if coming is not None:
            function = self.code.blocks[coming].function
            while self.frames and self.code.machine_blocks[self.frames[-1][0]].function != function:
                self.frames.pop()
            if self.frames and not self.code.blocks[coming].entry:
                self.frames.pop()
        return self._resume_at_next_record()

    def _enter(self, number: int) -> int:
        """Consume the record of the basic block that begins with a machine block, if it is near."""
        block = self.code.block_of_first.get(number)
        if block is not None:
            ahead = self.trace[self.at : self.at + _LOOK_AHEAD]
            if block in ahead:
                self._take(ahead.index(block) + 1)
        return number

    def _distance(self, number: int) -> int:
        key = (number, self.owner, tuple(self.trace[self.at : self.at + _LOOK_AHEAD]))
        found = self._costs.get(key)
        if found is None:
            found = self._costs[key] = self._search(number, key[2], _DEPTH)
        return found

    def _search(self, number: int, ahead: tuple[int, ...], depth: int) -> int:
        """Return how badly a way by a machine block fits: records skipped, and blocks without a record."""
        code = self.code
        here = code.machine_blocks[number]
        block = code.block_of_first.get(number)
        if block is not None and block in ahead:
            return 10 * ahead.index(block)
        if here.end is End.CALL and here.target in code.entries:
            return 0 if ahead and code.entries[here.target] == ahead[0] else _LOST
        if here.end is End.RETURN:
            leaves = not ahead or code.blocks[ahead[0]].function != here.function or bool(self.frames)
            return 9 if leaves else _LOST - 1
        successors = code.successors(number)
        if not successors:
            return 9
        if depth <= 0:
            return _LOST
        foreign = block is not None and block != self.owner
        onward = min(self._search(successor, ahead, depth - len(successors) ** 2) for successor in successors)
        return min(_LOST, onward + (_FOREIGN if foreign else 1))


def reconstruct_path(code: MachineCode, trace: BlockTrace, limit: int = 4_000_000) -> ExecutedPath:
    """Follow a trace through the machine code for at most ``limit`` machine blocks."""
    return _PathSearch(code, trace, limit).run()
