"""Operands of an instruction, in assembly as in LLVM's intermediate code.

What an instruction does to a processor: which operations it takes, what it reads, writes and remembers.

Assembly text as pieces: straight runs of instructions that end in one jump, call or return.

LLVM writes beside each label of which block of its intermediate code it comes (``# %for.body``). Where the
code generator made blocks of its own, split edges for instance, there is no such name.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum

_OPEN, _SHUT = frozenset("([{"), frozenset(")]}")


def split_operands(text: str) -> Iterator[str]:
    """What stands between commas that are in no brackets; nothing for an empty text."""
    depth, start = 0, 0
    for at, sign in enumerate(text):
        if sign in _OPEN:
            depth += 1
        elif sign in _SHUT:
            depth -= 1
        elif sign == "," and depth == 0:
            yield text[start:at].strip()
            start = at + 1
    if text[start:].strip():
        yield text[start:].strip()


OPERATION_CLASSES = (
    "alu", "move", "increment", "shift", "shifted_alu", "multiply", "divide32", "divide64",
    "load", "load_vector", "store", "branch",
    "fp_add", "fp_compare", "fp_multiply", "fp_fma", "fp_divide32", "fp_divide64", "fp_root32", "fp_root64",
    "convert", "transfer", "vector", "vector_move", "vector_multiply", "shuffle",
)  # fmt: skip
"""The classes of operations that a core has figures for (``volery.cost.code_laws``)."""


@dataclass(frozen=True)
class MemoryOperand:
    """What an instruction loads from or stores to, as far as its text tells.

    The ``registers`` of the address; ``place`` is its text without the ``displacement``, empty where it says
    nothing; ``size`` in bytes.
    """

    registers: tuple[str, ...] = ()
    place: str = ""
    displacement: int = 0
    size: int = 8


NO_MEMORY = MemoryOperand()


@dataclass(frozen=True)
class Effect:
    """An instruction, for a core model.

    ``slots`` of the front end; ``loads`` loads of the class ``load`` before the ``operation`` (``times`` of
    it), and a store after it; registers by one name each: ``reads`` for the operation, ``writes`` when it is
    done, ``bumps`` an address register at once.
    """

    slots: float = 1.0
    load: str = ""
    loads: int = 1
    operation: str = ""
    times: int = 1
    store: bool = False
    memory: MemoryOperand = NO_MEMORY
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    bumps: tuple[str, ...] = ()


_FUNCTION = re.compile(r'^("[^"]+"|[\w.$]+):\s+(?:#|//) @')
_LABEL = re.compile(r"^(?:(\.LBB\d+_\d+):|(?:#|//) %bb\.\d+:)(.*)$")
_CAME_FROM = re.compile(r'(?:#|//) %("[^"]+"|[^\s"]+)')
_PLACE = re.compile(r"^\t\.loc\t(\d+) (\d+)")
_FILE = re.compile(r'^\t\.file\t(\d+) (?:"([^"]*)" )?"([^"]*)"')
_ALIGN = re.compile(r"^\t\.p2align\t(\d+)(?:, [^,]*, (\d+))?")
_COMMENT = re.compile(r"\s+(?:#|//) .*$|\s+//.*$")
_DIRECT = re.compile(r"^[.\w$]+(?:@PLT)?$")

_JUMPS = {"jmp", "b"}
_CALLS = {"call", "bl", "blr"}
_RETURNS = {"ret", "ud2", "brk"}


class End(Enum):
    """How a piece ends."""

    FALLS = "falls"
    BRANCH = "branch"
    JUMP = "jump"
    COMPUTED = "computed"
    CALL = "call"
    RETURN = "return"


@dataclass(frozen=True)
class Instruction:
    """One line: its mnemonic, its operands, the source line it stands for (``file:line``, empty if none)."""

    mnemonic: str
    operands: tuple[str, ...]
    source: str


@dataclass
class MachineBlock:
    """A straight run. ``came_from`` is a block's name or ``None``; ``target``: a label or symbol."""

    function: str
    label: str
    came_from: str | None
    instructions: list[Instruction] = field(default_factory=list)
    end: End = End.FALLS
    target: str = ""


def machine_blocks(text: str, bytes_each: int = 0) -> list[MachineBlock]:
    """All pieces of a file of assembly, in its order: what falls through goes on in the next.

    Where all instructions are *bytes_each* long, those that pad the code to an alignment are entered, too.
    """
    found: list[MachineBlock] = []
    files: dict[str, str] = {}
    function, source, offset = "", "", 0
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
        elif place := _PLACE.match(line):
            source = f"{files.get(place[1], '?')}:{place[2]}" if place[2] != "0" else ""
        elif bytes_each and (aligned := _ALIGN.match(line)):
            offset += _pad(found, aligned, offset, bytes_each)
        elif line.startswith("\t") and line[1:2] not in ".#/" and found:
            _enter(found, _instruction(line, source))
            offset += bytes_each
    return found


def _pad(found: list[MachineBlock], aligned: re.Match[str], offset: int, bytes_each: int) -> int:
    """Enter what pads from *offset* on, where it is run through; how many bytes that is."""
    padding = -offset % (1 << int(aligned[1]))
    if padding > int(aligned[2] or padding):
        return 0
    if found and found[-1].end in (End.FALLS, End.BRANCH, End.CALL):
        for _ in range(padding // bytes_each):
            _enter(found, Instruction("nop", (), ""))
    return padding


def _enter(found: list[MachineBlock], one: Instruction) -> None:
    last = found[-1]
    if last.end is not End.FALLS:
        last = MachineBlock(last.function, "", last.came_from)
        found.append(last)
    last.instructions.append(one)
    last.end, last.target = _ending(one)


def _instruction(line: str, source: str) -> Instruction:
    mnemonic, _, rest = _COMMENT.sub("", line).strip().partition("\t")
    if mnemonic in ("lock", "rep", "rep;", "notrack"):
        mnemonic, _, rest = rest.partition("\t")
    prefix, _, after = mnemonic.partition(" ")
    if prefix in ("lock", "rep", "notrack", "data16"):
        mnemonic = after
    return Instruction(mnemonic.strip(), tuple(split_operands(rest)), source)


def _ending(one: Instruction) -> tuple[End, str]:
    name, last = one.mnemonic, one.operands[-1] if one.operands else ""
    if name in _RETURNS:
        return End.RETURN, ""
    if name in _CALLS:
        direct = name != "blr" and _DIRECT.match(last) is not None
        return End.CALL, last.removesuffix("@PLT") if direct else ""
    if name in _JUMPS:
        return (
            (End.JUMP, last.removesuffix("@PLT"))
            if _DIRECT.match(last) and not _register(last)
            else (End.COMPUTED, "")
        )
    if name == "br":
        return End.COMPUTED, ""
    if name.startswith(("j", "b.")) or name in ("cbz", "cbnz", "tbz", "tbnz"):
        return End.BRANCH, last
    return End.FALLS, ""


def _register(operand: str) -> bool:
    return re.fullmatch(r"r[a-ds][xip]|r[sd]i|r\d+", operand) is not None
