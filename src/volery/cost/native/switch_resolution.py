"""Resolution of a switch: its value is followed through the comparisons that the code generator made of it.

Several paths of such a chain lead to the same block, so the trace of blocks alone does not determine the
path.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from operator import eq, ge, gt, le, lt, ne
from typing import NamedTuple

from volery.cost.native.machine_code import Instruction, MachineBlock

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
        for one in block.instructions:
            self._execute(one)
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
    found = _REGISTER.match(operand)
    if found is None:
        return None
    if found[1]:
        return _Register(found[2], _BITS[found[1]])
    if found[3]:
        return _Register(f"r{found[4]}", _BITS["r" + found[5]])
    if found[7]:
        return _Register(found[7], _BITS[found[6]])
    return _Register(f"{found[8]}x" if found[8] else found[9], 8)


def _amount(operand: str) -> int | None:
    found = _AMOUNT.match(operand)
    return int(found[1]) if found else None


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
