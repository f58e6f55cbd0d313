"""LLVM's intermediate code as text: retargeted, its blocks found, counters and traces inserted.

Only what is needed is understood: where functions and basic blocks begin, where a block's first ordinary
instruction stands, whom it calls. Everything else passes through unread.

Accesses to memory in LLVM's intermediate code: each is told before it is made.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from volery.cost.native.assembly import split_operands

ACCESS, RANGE = "volery_access", "volery_range"
DECLARED = f"declare void @{ACCESS}(ptr, i32)\ndeclare void @{RANGE}(ptr, i64)\n"

_LOAD = re.compile(r"^\s+%.+? = load ")
_STORE = re.compile(r"^\s+store ")
_BLOCK = re.compile(r"^\s+(?:tail |musttail |notail )?call void @llvm\.mem(?:cpy|move|set)\.[^(]*\((.*)\)")
_EXPRESSION = re.compile(r"(?:getelementptr|inttoptr) .*\)")
_NAME = re.compile(r'[%@](?:"[^"]*"|[-\w.$]+)|\bnull\b|\bpoison\b|\bundef\b')


def is_access(line: str) -> bool:
    """Whether it loads or stores."""
    return _LOAD.match(line) is not None or _STORE.match(line) is not None


def with_access_calls(lines: Iterator[str], begins: Callable[[str], bool]) -> Iterator[str]:
    """The lines, each access told before its own; accesses are numbered from where a block *begins*."""
    number = 0
    for line in lines:
        if begins(line):
            number = 0
        if is_access(line):
            store = _STORE.match(line) is not None
            yield f"  call void @{ACCESS}(ptr {_address(line)}, i32 {2 * number + store})\n"
            number += 1
        elif copied := _BLOCK.match(line):
            yield from _ranges(copied[1])
        yield line


def _address(line: str) -> str:
    """What the access points to: the last operand that is a pointer, before its alignment."""
    pointers = [one for one in split_operands(line.strip()) if one.startswith("ptr ")]
    return _value(pointers[-1].removeprefix("ptr "))


def _ranges(arguments: str) -> Iterator[str]:
    """Of a copy the two, of a filling the one range that it touches."""
    given = list(split_operands(arguments))
    length = given[2].split(" ", 1)
    if length[0] != "i64":
        return
    for one in given[:2]:
        if one.startswith("ptr "):
            yield f"  call void @{RANGE}(ptr {_value(one)}, i64 {length[1]})\n"


def _value(operand: str) -> str:
    """A name, or a whole expression, among attributes and orderings."""
    expression = _EXPRESSION.search(operand)
    return expression[0] if expression else _NAME.findall(operand)[-1]


COUNTERS = "volery_counters"
LENGTH = "volery_counters_length"
TRACE = "volery_trace"
SWITCH = "volery_switch"

_DEFINE = re.compile(r'^define .*?@("[^"]+"|[-\w.$]+)\(')
_LABEL = re.compile(r'^("[^"]+"|[-\w.$]+):')
_TARGET_ATTRIBUTES = re.compile(r'\s*"(?:target-cpu|target-features|tune-cpu)"="[^"]*"')
_FIRST = re.compile(r"^\s+(?:(?:%\S+|%\"[^\"]+\") = (?:phi|landingpad) |#dbg_|cleanup\b|catch |filter )")


_TARGET = re.compile(r'\blabel %("[^"]+"|[-\w.$]+)')
_SWITCH = re.compile(r"^\s+switch i(\d+) ([^,]+), label ")


@dataclass(frozen=True)
class BasicBlock:
    """A basic block of the optimised code: its function's symbol and its own name; ``entry``: the first."""

    function: str
    name: str
    entry: bool = False


def retarget(text: str, triple: str, layout: str) -> str:
    """The same code for another machine: its triple and data layout, no leaning towards a processor."""
    text = re.sub(r'^target datalayout = ".*"$', f'target datalayout = "{layout}"', text, flags=re.MULTILINE)
    text = re.sub(r'^target triple = ".*"$', f'target triple = "{triple}"', text, flags=re.MULTILINE)
    return re.sub(r"= \{\s*\}$", '= { "retargeted" }', _TARGET_ATTRIBUTES.sub("", text), flags=re.MULTILINE)


def basic_blocks(text: str) -> list[BasicBlock]:
    """All basic blocks, in the order of the text; a block's counter has its place in this list."""
    return [block for _, block in _lines(text) if block is not None]


def critical_edges(text: str) -> dict[int, int]:
    """The blocks that stand on the way from one block to another (as LLVM's ``break-crit-edges`` makes and
    names them), each with the one it comes from.
    """
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


def access_counts(text: str) -> list[int]:
    """How many accesses to memory each block has."""
    found: list[int] = []
    for line, block in _lines(text):
        if block is not None:
            found.append(0)
        elif found and is_access(line):
            found[-1] += 1
    return found


def with_counters(text: str) -> str:
    """The code with one counter of 64 bits per block, in an array that is exported as ``volery_counters``."""
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
    """The code with a call of ``volery_trace(number)`` at the beginning of each block, one of
    ``volery_switch(value)`` before each switch, and those of ``accesses`` before each access to memory.
    """
    entered = f"  call void @{TRACE}("
    lines = _instrumented(text, lambda number: f"{entered}i32 {number})\n").splitlines(keepends=True)
    switches = (one for number, line in enumerate(lines) for one in (_told(number, line), line))
    whole = "".join(with_access_calls(switches, lambda line: line.startswith(entered)))
    return whole + f"\ndeclare void @{TRACE}(i32)\ndeclare void @{SWITCH}(i32)\n{DECLARED}"


def _told(number: int, line: str) -> str:
    """What tells the value that a switch is about to use, as a number of 32 bits."""
    switch = _SWITCH.match(line)
    if switch is None:
        return ""
    bits, value = int(switch[1]), switch[2]
    if bits == 32:
        return f"  call void @{SWITCH}(i32 {value})\n"
    as_word, way = f"%volery.switch.{number}", "zext" if bits < 32 else "trunc"
    return f"  {as_word} = {way} i{bits} {value} to i32\n  call void @{SWITCH}(i32 {as_word})\n"


def _instrumented(text: str, inserted: Callable[[int], str]) -> str:
    out: list[str] = []
    number = 0
    waiting = False
    for line, block in _lines(text):
        if waiting and block is None and not _FIRST.match(line):
            out.append(inserted(number - 1))
            waiting = False
        if block is not None:
            number += 1
            waiting = True
        out.append(line + "\n")
    return "".join(out)


def _lines(text: str) -> Iterator[tuple[str, BasicBlock | None]]:
    """Each line, with the block that it begins. A first block without a label begins with its function."""
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
