"""Encoding of requests of C++ code and of their replies, as ``<volery/abi.h>`` reads and writes them.

A number takes eight bytes, little endian; a text or a byte string takes its length and its bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Protocol, Self

_INTEGER = struct.Struct("<q")
_PAIR = struct.Struct("<qq")
_REAL = struct.Struct("<d")


class Reader:
    """Reads values in their order."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def integer(self) -> int:
        """Read a signed integer of 64 bits."""
        value: int = _INTEGER.unpack_from(self._data, self._at)[0]
        self._at += 8
        return value

    def flag(self) -> bool:
        """Read a boolean."""
        return self.integer() != 0

    def real(self) -> float:
        """Read a floating-point number."""
        value: float = _REAL.unpack_from(self._data, self._at)[0]
        self._at += 8
        return value

    def raw(self) -> bytes:
        """Read a byte string."""
        start = self._at + 8
        self._at = start + self.integer()
        return self._data[start : self._at]

    def text(self) -> str:
        """Read a text; bytes that are not UTF-8 become replacement characters."""
        return self.raw().decode(errors="replace")


class Writer:
    """Appends values."""

    def __init__(self) -> None:
        self.data = bytearray()

    def integer(self, value: int) -> Self:
        """Append a signed integer of 64 bits."""
        self.data += _INTEGER.pack(value)
        return self

    def flag(self, value: bool) -> Self:
        """Append a boolean."""
        return self.integer(value)

    def real(self, value: float) -> Self:
        """Append a floating-point number."""
        self.data += _REAL.pack(value)
        return self

    def raw(self, value: bytes) -> Self:
        """Append a byte string."""
        self.data += _INTEGER.pack(len(value)) + value
        return self

    def text(self, value: str) -> Self:
        """Append a text."""
        return self.raw(value.encode())

    def done(self) -> bytes:
        """Return all appended values."""
        return bytes(self.data)


def pair(one: int, other: int) -> bytes:
    """Return two integers as ``Writer`` writes them, for what is written with each message."""
    return _PAIR.pack(one, other)


class CppFiber(Protocol):
    """A fiber of C++ code that has made a request and waits for the reply."""

    def call(self, callable_number: int, argument: bytes = b"") -> bytes:
        """Run a callable of the code on the stack of the fiber and return its result.

        Raises the error that the callable raised.
        """

    def call_beside(self, callable_number: int) -> bytes:
        """Run a callable on another fiber of the same code, in another task."""


RequestHandler = Callable[[CppFiber, Reader], bytes]
"""Handles a request in the requesting task; it may block and may ``call`` the fiber."""

RequestHandlers = Mapping[str, RequestHandler]
"""Request handlers by the name of the request."""
