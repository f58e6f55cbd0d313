"""Encoding of messages in CDR by Python code that is written once for each type.

rosbags encodes field by field, a call for each number. Here numbers that follow each other, through nested
messages, are one call of ``struct``. Where they begin depends on the strings before them, so each run of
numbers has eight layouts, one for each position modulo 8; the length of what has been encoded selects it.
Decoding is rosbags'.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from typing import Any

from volery.ros.messages import lazy_rosbags as rosbags
from volery.ros.messages.message import LONG, may_be_long
from volery.ros.messages.store import message_class, store

CDR_HEADER = b"\x00\x01\x00\x00"
"""Little endian; positions count from its end."""

FORMATS = {
    "bool": "?", "byte": "b", "char": "B", "octet": "B", "int8": "b", "uint8": "B", "int16": "h",
    "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
"""Codes of ``struct`` of the primitive types that are numbers; a ``byte`` is signed, as in rosbags."""

Append = Callable[[Any, bytearray], int]
"""Appends a message without a header; returns how many bytes of long arrays it has left out."""


def encode(message: Any) -> bytes:
    """Return the CDR bytes of a message whose lists are arrays, as ``Message.copy`` makes them.

    Raises:
        AttributeError, OverflowError, TypeError, struct.error: a value does not fit its field.
    """
    return bytes(encoded(message))


def encoded(message: Any) -> bytearray:
    """Return the CDR bytes as ``encode`` does, without the copy that makes them immutable."""
    out = bytearray(CDR_HEADER)
    appender(message.__msgtype__)(message, out)
    return out


def abridged(message: Any) -> tuple[bytearray, int]:
    """Return the CDR bytes without the content of long arrays, and how many bytes are missing.

    Nothing is missing of a message without an array of ``LONG`` bytes. Errors as of ``encode``.
    """
    out = bytearray(CDR_HEADER)
    return out, _abridging(message.__msgtype__)(message, out)


@cache
def _abridging(name: str) -> Append:
    return appender(name, abridging=True)


@cache
def appender(name: str, abridging: bool = False) -> Append:
    """Return the function that appends a message of type `name`, if *abridging* without long arrays."""
    message_class(name)
    writing = _AppendingSource(abridging)
    writing.fields(name, "message")
    writing.end_run()
    lines = ["missing = 0", *writing.lines, "return missing"]
    source = "\n    ".join(["def append(message, out):", *lines])
    exec(compile(source, f"<CDR of {name}>", "exec"), writing.names)
    made: Append = writing.names["append"]
    return made


@cache
def _layouts(codes: str) -> tuple[Callable[..., bytes], ...]:
    """Return what packs numbers, by the length of what is encoded before them modulo 8."""
    found = []
    for length in range(8):
        at, layout = length - len(CDR_HEADER), "<"
        for code in codes:
            width = struct.calcsize(f"<{code}")
            layout += "x" * (-at % width) + code
            at += -at % width + width
        found.append(struct.Struct(layout).pack)
    return tuple(found)


class _AppendingSource:
    """Source of one appending function, with a run of numbers that is not written yet."""

    def __init__(self, abridging: bool) -> None:
        self._abridging = abridging
        self.lines: list[str] = []
        self.names: dict[str, Any] = {}
        self._codes = ""
        self._values: list[str] = []

    def fields(self, name: str, variable: str) -> None:
        """Write the fields of a type; `variable` has the message."""
        for label, what in store().fielddefs[name][1]:
            self._field(what, f"{variable}.{rosbags.normalize_fieldname(label)}")

    def end_run(self) -> None:
        """Write the numbers that wait."""
        if self._codes:
            self.lines.append(f"out += {self._packing(self._codes)}({', '.join(self._values)})")
        self._codes, self._values = "", []

    def _packing(self, codes: str) -> str:
        """Return the expression of what packs numbers at the end of ``out``."""
        self.names[f"pack_{codes.replace('?', 'o')}"] = _layouts(codes)
        return f"pack_{codes.replace('?', 'o')}[len(out) & 7]"

    def _assigned(self, expression: str) -> str:
        variable = f"value_{len(self.lines)}"
        self.lines.append(f"{variable} = {expression}")
        return variable

    def _number(self, code: str, expression: str) -> None:
        self._codes += code
        self._values.append(expression)

    def _field(self, what: Any, expression: str) -> None:
        kind, detail = what
        if kind == rosbags.Nodetype.NAME:
            self.fields(str(detail), self._assigned(expression))
        elif kind != rosbags.Nodetype.BASE:
            inner, length = detail
            counted = kind == rosbags.Nodetype.SEQUENCE
            self._list(inner, self._assigned(expression), 0 if counted else int(length))
        elif detail[0] == "string":
            text = self._assigned(f"{expression}.encode()")
            self._number("I", f"len({text}) + 1")
            self.end_run()
            self.lines.append(f"out += {text} + b'\\0'")
        else:
            self._number(FORMATS[str(detail[0])], expression)

    def _list(self, inner: Any, values: str, length: int) -> None:
        """Write a sequence (length 0), which its count precedes, or an array."""
        if not length:
            self._number("I", f"len({values})")
        self.end_run()
        kind, detail = inner
        if kind == rosbags.Nodetype.NAME:
            self.names[f"append_{values}"] = appender(str(detail), self._abridging)
            self.lines.append(f"for item in {values}: missing += append_{values}(item, out)")
        elif detail[0] == "string":
            self.lines += [
                f"for item in {values}:",
                "    text = item.encode()",
                f"    out += {self._packing('I')}(len(text) + 1) + text + b'\\0'",
            ]
        else:
            code = FORMATS[str(detail[0])]
            width = struct.calcsize(f"<{code}")
            if width > 1:
                self.lines.append(f"if len({values}): out += bytes((4 - len(out)) % {width})")
            if self._abridging and may_be_long(str(detail[0]), length):
                self.lines += [
                    f"size = {values}.nbytes",
                    f"if size >= {LONG}:",
                    "    out += bytes(size & 7)  # what follows is aligned as behind the array",
                    "    missing += size & ~7",
                    f"else: out += {values}.data",
                ]
            else:
                self.lines.append(f"out += {values}.data")
