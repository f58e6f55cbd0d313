"""Accesses to memory in LLVM's intermediate code: each is told before it is made."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from volery.cost.native.operands import operands

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


def told(lines: Iterator[str], begins: Callable[[str], bool]) -> Iterator[str]:
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
    pointers = [one for one in operands(line.strip()) if one.startswith("ptr ")]
    return _value(pointers[-1].removeprefix("ptr "))


def _ranges(arguments: str) -> Iterator[str]:
    """Of a copy the two, of a filling the one range that it touches."""
    given = list(operands(arguments))
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
