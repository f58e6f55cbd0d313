"""Operands of an instruction, in assembly as in LLVM's intermediate code."""

from __future__ import annotations

from collections.abc import Iterator

_OPEN, _SHUT = frozenset("([{"), frozenset(")]}")


def operands(text: str) -> Iterator[str]:
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
