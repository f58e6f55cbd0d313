"""How questions of C++ code and their answers are written: what ``<volery/border.h>`` reads and writes.

Numbers take eight bytes, little endian; texts and bytes their length and themselves.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Protocol, Self

_INTEGER = struct.Struct("<q")
_REAL = struct.Struct("<d")


class Reader:
    """Takes values from the front."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def integer(self) -> int:
        """A signed number of 64 bits."""
        value: int = _INTEGER.unpack_from(self._data, self._at)[0]
        self._at += 8
        return value

    def flag(self) -> bool:
        """True or false."""
        return self.integer() != 0

    def real(self) -> float:
        """A floating-point number."""
        value: float = _REAL.unpack_from(self._data, self._at)[0]
        self._at += 8
        return value

    def raw(self) -> bytes:
        """Bytes."""
        start = self._at + 8
        self._at = start + self.integer()
        return self._data[start : self._at]

    def text(self) -> str:
        """Text; what is no UTF-8 in it is shown as such."""
        return self.raw().decode(errors="replace")


class Writer:
    """Appends values."""

    def __init__(self) -> None:
        self.data = bytearray()

    def integer(self, value: int) -> Self:
        """A signed number of 64 bits."""
        self.data += _INTEGER.pack(value)
        return self

    def flag(self, value: bool) -> Self:
        """True or false."""
        return self.integer(value)

    def real(self, value: float) -> Self:
        """A floating-point number."""
        self.data += _REAL.pack(value)
        return self

    def raw(self, value: bytes) -> Self:
        """Bytes."""
        self.data += _INTEGER.pack(len(value)) + value
        return self

    def text(self, value: str) -> Self:
        """Text."""
        return self.raw(value.encode())

    def done(self) -> bytes:
        """All of it."""
        return bytes(self.data)


class CppFiber(Protocol):
    """A flow of control of C++ code that has asked something and waits for the answer."""

    def call(self, callable_number: int, argument: bytes = b"") -> bytes:
        """Run one of its callables on its own stack, below what asked; returns what it returned.

        Raises what the code raised.
        """


RequestHandler = Callable[[CppFiber, Reader], bytes]
"""Does what is asked, as the task that asks; it may block and it may ``call`` back."""

RequestHandlers = Mapping[str, RequestHandler]
"""By the question's name."""
