"""LLVM's intermediate code as text: retargeting, basic blocks, insertion of counters and of trace calls.

Only the beginnings of functions and basic blocks, a block's first ordinary instruction, switches and accesses
to memory are parsed. Everything else is copied. A text transformation works with every LLVM from 17 on; a
pass plug-in would have to be built for each version, and LLVM's coverage passes do not number blocks after
optimisation.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from volery.cost.native.machine_code import NO_LINE, split_operands

COUNTERS = "volery_counters"
LENGTH = "volery_counters_length"
TRACE = "volery_trace"
SWITCH = "volery_switch"
ACCESS, RANGE = "volery_access", "volery_range"
DECLARED = f"declare void @{ACCESS}(ptr, i32)\ndeclare void @{RANGE}(ptr, i64)\n"

_DEFINE = re.compile(r'^define .*?@("[^"]+"|[-\w.$]+)\(')
_LABEL = re.compile(r'^("[^"]+"|[-\w.$]+):')
_TARGET_ATTRIBUTES = re.compile(r'\s*"(?:target-cpu|target-features|tune-cpu)"="[^"]*"')
_BLOCK_HEAD = re.compile(r"^\s+(?:(?:%\S+|%\"[^\"]+\") = (?:phi|landingpad) |#dbg_|cleanup\b|catch |filter )")
_TARGET = re.compile(r'\blabel %("[^"]+"|[-\w.$]+)')
_SWITCH = re.compile(r"^\s+switch i(\d+) ([^,]+), label ")
_LOAD = re.compile(r"^\s+%.+? = load ")
_STORE = re.compile(r"^\s+store ")
_BULK_ACCESS = re.compile(
    r"^\s+(?:tail |musttail |notail )?call void @llvm\.mem(?:cpy|move|set)\.[^(]*\((.*)\)"
)
_EXPRESSION = re.compile(r"(?:getelementptr|inttoptr) .*\)")
_LOCATION = re.compile(r"^!(\d+) = (?:distinct )?!DILocation\((.*)\)$", re.MULTILINE)
_NODE = re.compile(r"^!(\d+) = ", re.MULTILINE)
_DEBUG = re.compile(r",? !dbg !(\d+)")
_LOCAL = re.compile(r'%(?:"[^"]*"|[-\w.$]+)')
_PASSES_ON = re.compile(r"(?:[sz]ext|trunc|fpext|fptrunc|[sui]+tofp|bitcast|insertelement|shufflevector) ")
_MOST_COLUMNS = (1 << 16) - 1
_NAME = re.compile(r'[%@](?:"[^"]*"|[-\w.$]+)|\bnull\b|\bpoison\b|\bundef\b')


@dataclass(frozen=True)
class BasicBlock:
    """A basic block of the optimised code; ``entry``: it is the first one of its function."""

    function: str
    name: str
    entry: bool = False


def is_access(line: str) -> bool:
    """Return whether a line loads or stores."""
    return _LOAD.match(line) is not None or _STORE.match(line) is not None


def with_access_calls(lines: Iterable[str]) -> Iterator[str]:
    """Yield the lines with a call of ``volery_access`` before each access to memory, numbered in order."""
    number = 0
    for line in lines:
        if is_access(line):
            store = _STORE.match(line) is not None
            yield f"  call void @{ACCESS}(ptr {_address(line)}, i32 {2 * number + store})\n"
            number += 1
        elif bulk := _BULK_ACCESS.match(line):
            yield from _range_calls(bulk[1])
        yield line


def _address(line: str) -> str:
    """Return the address of an access: the last operand that is a pointer."""
    pointers = [operand for operand in split_operands(line.strip()) if operand.startswith("ptr ")]
    return _value(pointers[-1].removeprefix("ptr "))


def _range_calls(arguments: str) -> Iterator[str]:
    """Yield a call of ``volery_range`` for each range of a copy (two) or of a fill (one)."""
    given = list(split_operands(arguments))
    length = given[2].split(" ", 1)
    if length[0] != "i64":
        return
    for one in given[:2]:
        if one.startswith("ptr "):
            yield f"  call void @{RANGE}(ptr {_value(one)}, i64 {length[1]})\n"


def _value(operand: str) -> str:
    """Return the name or the constant expression in an operand, without its attributes."""
    expression = _EXPRESSION.search(operand)
    return expression[0] if expression else _NAME.findall(operand)[-1]


def retarget(text: str, triple: str, layout: str) -> str:
    """Return the code for another machine: its triple and data layout, without attributes of a processor."""
    text = re.sub(r'^target datalayout = ".*"$', f'target datalayout = "{layout}"', text, flags=re.MULTILINE)
    text = re.sub(r'^target triple = ".*"$', f'target triple = "{triple}"', text, flags=re.MULTILINE)
    return re.sub(r"= \{\s*\}$", '= { "retargeted" }', _TARGET_ATTRIBUTES.sub("", text), flags=re.MULTILINE)


def basic_blocks(text: str) -> list[BasicBlock]:
    """Return all basic blocks in the order of the text, which is the order of their counters."""
    return [block for _, block in _lines(text) if block is not None]


def critical_edges(text: str) -> dict[int, int]:
    """Return {edge block: source block} for the blocks that LLVM's ``break-crit-edges`` has inserted."""
    numbers: dict[tuple[str, str], int] = {}
    heads: list[tuple[int, str, str]] = []
    here, number = BasicBlock("", ""), -1
    for line, block in _lines(text):
        if block is not None:
            here, number = block, number + 1
            numbers[block.function, block.name] = number
        elif "_crit_edge" in line:
            heads += [
                (number, here.function, name.strip('"'))
                for name in _TARGET.findall(line)
                if name.strip('"').endswith("_crit_edge")
            ]
    return {numbers[function, name]: number for number, function, name in heads}


def access_blocks(text: str) -> list[int]:
    """Return the number of the basic block of each access to memory."""
    found: list[int] = []
    number = -1
    for line, block in _lines(text):
        number += block is not None
        if block is None and is_access(line):
            found.append(number)
    return found


def with_access_columns(text: str) -> str:
    """Return the code with the number of an access in its function, from 1 on, as the column of its location.

    The column also marks what uses a loaded value first, if nothing else does: the code generator can make
    one instruction of both. The lines stay.
    """
    nodes = dict(_LOCATION.findall(text))
    free = max((int(number) for number in _NODE.findall(text)), default=0) + 1
    out: list[str] = []
    added: list[str] = []
    function: list[str] = []
    for line in text.splitlines():
        if line.startswith("define "):
            function = [line]
        elif function:
            function.append(line)
        else:
            out.append(line)
        if line == "}":
            out += _numbered(function, nodes, free + len(added), added)
            function = []
    return "\n".join([*out, *added]) + "\n"


def _numbered(function: list[str], nodes: dict[str, str], free: int, added: list[str]) -> Iterator[str]:
    """Yield the lines of a function with new locations, which are appended to ``added``."""
    subprogram = _DEBUG.search(function[0])
    if subprogram is None:
        yield from function
        return
    uses = Counter(name for line in function for name in _LOCAL.findall(line))
    loaded: dict[str, int] = {}  # by the names of values that are used once, in this block
    number = 0
    for line in function:
        if _LABEL.match(line):
            loaded = {}
        name, _, computed = line.strip().partition(" = ") if line.startswith("  %") else ("", "", line)
        of = next((loaded.pop(used) for used in reversed(_LOCAL.findall(computed)) if used in loaded), 0)
        if is_access(line):
            number += 1
            of = number
        location = _DEBUG.search(line)
        if of == 0 or of > _MOST_COLUMNS or not (location or is_access(line)):
            yield line
            continue
        if name and uses[name] == 2 and (is_access(line) or _PASSES_ON.match(computed)):
            loaded[name] = of
        body = nodes.get(location[1], "") if location else ""
        if not body or "line: 0" in body:
            body = f"line: {NO_LINE}, scope: !{subprogram[1]}"
        body = re.sub(r", column: \d+", "", body).replace(", ", f", column: {of}, ", 1)
        mark = f", !dbg !{free}"
        added.append(f"!{free} = !DILocation({body})")
        free += 1
        yield _DEBUG.sub("", line) + mark


def with_counters(text: str) -> str:
    """Insert one counter of 64 bits per block, in an array that is exported as ``volery_counters``."""
    size = len(basic_blocks(text))

    def count(number: int) -> str:
        place = f"getelementptr inbounds ([{size} x i64], ptr @volery.counts, i64 0, i64 {number})"
        seen, now = f"%volery.seen.{number}", f"%volery.now.{number}"
        return (
            f"  {seen} = load i64, ptr {place}\n  {now} = add i64 {seen}, 1\n  store i64 {now}, ptr {place}\n"
        )

    return _instrumented(text, count) + (
        f"\n@volery.counts = internal global [{size} x i64] zeroinitializer, align 64\n"
        f"@{COUNTERS} = alias [{size} x i64], ptr @volery.counts\n"
        f"@{LENGTH} = constant i64 {size}\n"
    )


def with_trace_calls(text: str) -> str:
    """Insert calls that record the path of a run.

    These are ``volery_trace(number)`` at the beginning of each block, ``volery_switch(value)`` before each
    switch and the calls of ``with_access_calls``.
    """
    traced = _instrumented(text, lambda number: f"  call void @{TRACE}(i32 {number})\n")
    lines = traced.splitlines(keepends=True)
    switches = (one for number, line in enumerate(lines) for one in (_switch_call(number, line), line))
    whole = "".join(with_access_calls(switches))
    return whole + f"\ndeclare void @{TRACE}(i32)\ndeclare void @{SWITCH}(i32)\n{DECLARED}"


def _switch_call(number: int, line: str) -> str:
    """Return the call that records the value of a switch as a number of 32 bits; empty for other lines."""
    switch = _SWITCH.match(line)
    if switch is None:
        return ""
    bits, value = int(switch[1]), switch[2]
    if bits == 32:
        return f"  call void @{SWITCH}(i32 {value})\n"
    as_word, conversion = f"%volery.switch.{number}", "zext" if bits < 32 else "trunc"
    return f"  {as_word} = {conversion} i{bits} {value} to i32\n  call void @{SWITCH}(i32 {as_word})\n"


def _instrumented(text: str, inserted: Callable[[int], str]) -> str:
    """Insert a text before the first ordinary instruction of each block."""
    out: list[str] = []
    number = 0
    waiting = False
    for line, block in _lines(text):
        if waiting and block is None and not _BLOCK_HEAD.match(line):
            out.append(inserted(number - 1))
            waiting = False
        if block is not None:
            number += 1
            waiting = True
        out.append(line + "\n")
    return "".join(out)


def _lines(text: str) -> Iterator[tuple[str, BasicBlock | None]]:
    """Yield each line with the block that it begins, or None.

    A first block without a label begins with its function.
    """
    function, first = "", False
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if defined := _DEFINE.match(line):
            function = defined[1].strip('"')
            first = True
            label = _LABEL.match(lines[number + 1])
            if label is None:
                yield line, BasicBlock(function, "", True)
                first = False
                continue
        elif line == "}":
            function = ""
        elif function and (label := _LABEL.match(line)):
            yield line, BasicBlock(function, label[1].strip('"'), first)
            first = False
            continue
        yield line, None
