"""Assembly text as machine blocks: straight runs of instructions that end in one jump, call or return.

LLVM writes beside each label the basic block of its intermediate code that the label comes from
(``# %for.body``). Blocks that the code generator made itself, such as split edges, have no such name. The
modules ``isa_*`` say what an instruction does to a core (``Effect``).
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from enum import Enum

OPERATION_CLASSES = (
    "alu", "move", "increment", "shift", "shifted_alu", "multiply", "divide32", "divide64",
    "load", "load_vector", "store", "branch",
    "fp_add", "fp_compare", "fp_multiply", "fp_fma", "fp_divide32", "fp_divide64", "fp_root32", "fp_root64",
    "convert", "transfer", "vector", "vector_move", "vector_multiply", "shuffle",
    "conditional", "convert_integer", "fp_flags", "vector_shift", "store_vector",
)  # fmt: skip
"""Classes of operations, for which a ``CoreLaw`` has figures."""

SIMILAR = {
    "conditional": "alu", "convert_integer": "convert", "fp_flags": "fp_compare", "vector_shift": "vector",
    "store_vector": "store",
}  # fmt: skip
"""Class whose figures hold for another one where a law does not distinguish them."""

_OPENING, _CLOSING = frozenset("([{"), frozenset(")]}")
_FUNCTION = re.compile(r'^("[^"]+"|[\w.$]+):\s+(?:#|//) @')
_LABEL = re.compile(r"^(?:(\.LBB\d+_\d+):|(?:#|//) %bb\.\d+:)(.*)$")
_CAME_FROM = re.compile(r'(?:#|//) %("[^"]+"|[^\s"]+)')
_LOCATION = re.compile(r"^\t\.loc\t(\d+) (\d+)(?: (\d+))?")
_SPILL = re.compile(r"-byte (?:Folded )?(?:Spill|Reload)")
_CONSTANT = re.compile(r"\.L(?:CPI|JTI)")
_FILE = re.compile(r'^\t\.file\t(\d+) (?:"([^"]*)" )?"([^"]*)"')
_ALIGN = re.compile(r"^\t\.p2align\t(\d+)(?:, [^,]*, (\d+))?")
_COMMENT = re.compile(r"\s+(?:#|//) .*$|\s+//.*$")
_DIRECT = re.compile(r"^[.\w$]+(?:@PLT)?$")

NO_LINE = 1 << 24
"""Line of a location that has a column only."""

_JUMPS = {"jmp", "b"}
_CALLS = {"call", "bl", "blr"}
_RETURNS = {"ret", "ud2", "brk"}


def split_operands(text: str) -> Iterator[str]:
    """Yield the operands of an instruction: the texts between commas outside brackets."""
    depth, start = 0, 0
    for at, character in enumerate(text):
        if character in _OPENING:
            depth += 1
        elif character in _CLOSING:
            depth -= 1
        elif character == "," and depth == 0:
            yield text[start:at].strip()
            start = at + 1
    if text[start:].strip():
        yield text[start:].strip()


@dataclass(frozen=True)
class MemoryOperand:
    """Address of a load or store, as far as the text shows it.

    Attributes:
        registers: Registers of the address.
        place: Text of the address without the displacement; empty where it does not identify an address.
        displacement: Constant part of the address, bytes.
        size: Size of the access, bytes.
    """

    registers: tuple[str, ...] = ()
    place: str = ""
    displacement: int = 0
    size: int = 8


NO_MEMORY = MemoryOperand()


@dataclass(frozen=True)
class Effect:
    """What an instruction does to a core. A register has one name whatever part of it is accessed.

    Attributes:
        slots: Slots of the front end.
        load: Class of the loads before the operation, empty if there are none.
        loads: Number of loads.
        operation: Class of the operation, empty if there is none.
        times: Number of operations.
        store: Class of a store that follows, or empty.
        memory: Address of the loads or the store.
        reads: Registers that the operation reads.
        writes: Registers that are written when the operation is done.
        bumps: Address registers that are written as soon as the address is known.
    """

    slots: float = 1.0
    load: str = ""
    loads: int = 1
    operation: str = ""
    times: int = 1
    store: str = ""
    memory: MemoryOperand = NO_MEMORY
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    bumps: tuple[str, ...] = ()


class End(Enum):
    """How a machine block ends."""

    FALLS = "falls"
    BRANCH = "branch"
    JUMP = "jump"
    COMPUTED = "computed"
    CALL = "call"
    RETURN = "return"


@dataclass(frozen=True)
class Instruction:
    """One line of assembly.

    Attributes:
        mnemonic: Its name.
        operands: Its operands.
        source: Its source line, ``file:line``; empty if there is none.
        access: Number of its access to memory among those of its function in the intermediate code, from 1
            on; 0 if it has none or it is one of the code generator's own.
    """

    mnemonic: str
    operands: tuple[str, ...]
    source: str
    access: int = 0


@dataclass
class MachineBlock:
    """A straight run of instructions.

    Attributes:
        function: Symbol of its function.
        label: Its label, empty if it has none.
        came_from: Name of its basic block in the intermediate code, or None.
        instructions: The instructions.
        end: How it ends.
        target: Label or symbol that it jumps to or calls, empty if it is computed.
    """

    function: str
    label: str
    came_from: str | None
    instructions: list[Instruction] = field(default_factory=list)
    end: End = End.FALLS
    target: str = ""

    def calls_library(self, defined: Container[str]) -> bool:
        """Return whether it calls a function that is not ``defined`` by the program."""
        leaves = self.end in (End.CALL, End.JUMP) and self.target and not self.target.startswith(".L")
        return bool(leaves) and self.target not in defined


def machine_blocks(text: str, bytes_each: int = 0) -> list[MachineBlock]:
    """Parse a file of assembly into machine blocks, in order: a block falls through to the next.

    Args:
        text: The assembly.
        bytes_each: Size of an instruction where all have the same size, else 0. With a size, executed
            padding for alignment is inserted as ``nop`` instructions.
    """
    found: list[MachineBlock] = []
    files: dict[str, str] = {}
    function, source, access, offset = "", "", 0, 0
    for line in text.splitlines():
        if named := _FILE.match(line):
            files[named[1]] = (
                f"{named[2]}/{named[3]}" if named[2] and not named[3].startswith("/") else named[3]
            )
        elif begins := _FUNCTION.match(line):
            function, offset = begins[1].strip('"'), 0
        elif line.startswith(".Lfunc_end"):
            function = ""
        elif not function:
            continue
        elif label := _LABEL.match(line):
            came = _CAME_FROM.search(label[2])
            found.append(MachineBlock(function, label[1] or "", came[1].strip('"') if came else None))
        elif location := _LOCATION.match(line):
            known = 0 < int(location[2]) < NO_LINE
            source = f"{files.get(location[1], '?')}:{location[2]}" if known else ""
            access = int(location[3] or 0)
        elif bytes_each and (aligned := _ALIGN.match(line)):
            offset += _pad(found, aligned, offset, bytes_each)
        elif line.startswith("\t") and line[1:2] not in ".#/" and found:
            own = _SPILL.search(line) or _CONSTANT.search(line)
            _append(found, _instruction(line, source, 0 if own else access))
            offset += bytes_each
    return found


def _pad(found: list[MachineBlock], aligned: re.Match[str], offset: int, bytes_each: int) -> int:
    """Insert the padding at ``offset`` where it is executed; return its size in bytes."""
    padding = -offset % (1 << int(aligned[1]))
    if padding > int(aligned[2] or padding):
        return 0
    if found and found[-1].end in (End.FALLS, End.BRANCH, End.CALL):
        for _ in range(padding // bytes_each):
            _append(found, Instruction("nop", (), ""))
    return padding


def _append(found: list[MachineBlock], one: Instruction) -> None:
    """Append an instruction to the last block, or to a new one if that has ended."""
    last = found[-1]
    if last.end is not End.FALLS:
        last = MachineBlock(last.function, "", last.came_from)
        found.append(last)
    last.instructions.append(one)
    last.end, last.target = _ending(one)


def _instruction(line: str, source: str, access: int) -> Instruction:
    mnemonic, _, rest = _COMMENT.sub("", line).strip().partition("\t")
    if mnemonic in ("lock", "rep", "rep;", "notrack"):
        mnemonic, _, rest = rest.partition("\t")
    prefix, _, after = mnemonic.partition(" ")
    if prefix in ("lock", "rep", "notrack", "data16"):
        mnemonic = after
    return Instruction(mnemonic.strip(), tuple(split_operands(rest)), source, access)


def _ending(one: Instruction) -> tuple[End, str]:
    """Return how a block ends after an instruction, and the target."""
    name, last = one.mnemonic, one.operands[-1] if one.operands else ""
    if name in _RETURNS:
        return End.RETURN, ""
    if name in _CALLS:
        direct = name != "blr" and _DIRECT.match(last) is not None
        return End.CALL, last.removesuffix("@PLT") if direct else ""
    is_register = re.fullmatch(r"r[a-ds][xip]|r[sd]i|r\d+", last) is not None
    if name in _JUMPS and _DIRECT.match(last) and not is_register:
        return End.JUMP, last.removesuffix("@PLT")
    if name in _JUMPS or name == "br":
        return End.COMPUTED, ""
    if name.startswith(("j", "b.")) or name in ("cbz", "cbnz", "tbz", "tbnz"):
        return End.BRANCH, last
    return End.FALLS, ""
