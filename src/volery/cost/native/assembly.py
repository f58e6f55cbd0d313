"""Assembly text as pieces: straight runs of instructions that end in one jump, call or return.

LLVM writes beside each label of which block of its intermediate code it comes (``# %for.body``). Where the
code generator made blocks of its own, split edges for instance, there is no such name.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from enum import Enum

from volery.cost.native.operands import operands

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
class Piece:
    """A straight run. ``came_from`` is a block's name or ``None``; ``target``: a label or symbol."""

    function: str
    label: str
    came_from: str | None
    instructions: list[Instruction] = field(default_factory=list)
    end: End = End.FALLS
    target: str = ""


def pieces(text: str, bytes_each: int = 0) -> list[Piece]:
    """All pieces of a file of assembly, in its order: what falls through goes on in the next.

    Where all instructions are *bytes_each* long, those that pad the code to an alignment are entered, too.
    """
    found: list[Piece] = []
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
            found.append(Piece(function, label[1] or "", came[1].strip('"') if came else None))
        elif place := _PLACE.match(line):
            source = f"{files.get(place[1], '?')}:{place[2]}" if place[2] != "0" else ""
        elif bytes_each and (aligned := _ALIGN.match(line)):
            offset += _pad(found, aligned, offset, bytes_each)
        elif line.startswith("\t") and line[1:2] not in ".#/" and found:
            _enter(found, _instruction(line, source))
            offset += bytes_each
    return found


def _pad(found: list[Piece], aligned: re.Match[str], offset: int, bytes_each: int) -> int:
    """Enter what pads from *offset* on, where it is run through; how many bytes that is."""
    padding = -offset % (1 << int(aligned[1]))
    if padding > int(aligned[2] or padding):
        return 0
    if found and found[-1].end in (End.FALLS, End.BRANCH, End.CALL):
        for _ in range(padding // bytes_each):
            _enter(found, Instruction("nop", (), ""))
    return padding


def _enter(found: list[Piece], one: Instruction) -> None:
    last = found[-1]
    if last.end is not End.FALLS:
        last = Piece(last.function, "", last.came_from)
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
    return Instruction(mnemonic.strip(), tuple(operands(rest)), source)


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
