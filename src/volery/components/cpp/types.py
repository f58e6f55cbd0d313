"""Types that may cross the border in the operations of a model's interfaces: in Python, in C++, on the wire.

A model writes ``bool``, ``int``, ``float``, ``str``, ``bytes``, ``Position``, and ``T[]`` for many of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from volery.base.errors import ModelError, choices
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.ros.client_libraries.wire import Reader, Writer

_ALTITUDES = (AMSL, Ellipsoidal, AboveHome, AboveGround)
"""In the order of ``volery::Reference``."""


class Kind(NamedTuple):
    """A type: its name in C++, and how a value of it is written and read."""

    cpp: str
    write: Callable[[Writer, Any], object]
    read: Callable[[Reader], Any]

    @property
    def as_argument(self) -> str:
        """As C++ takes it: what is small by value, the rest by reference."""
        return self.cpp if self.cpp in _SMALL else f"const {self.cpp}&"


_SMALL = ("bool", "std::int64_t", "double")


def _write_position(writer: Writer, value: Position) -> None:
    writer.real(value.latitude).real(value.longitude).real(value.altitude.metres)
    writer.integer(_ALTITUDES.index(type(value.altitude)))


def _read_position(reader: Reader) -> Position:
    latitude, longitude, metres = reader.real(), reader.real(), reader.real()
    return Position(latitude, longitude, _ALTITUDES[reader.integer()](metres))


def _write_nothing(writer: Writer, value: object) -> None:
    """An operation that returns nothing."""


def _read_nothing(reader: Reader) -> None:
    """See ``_write_nothing``."""


_KINDS: Mapping[str, Kind] = {
    "": Kind("void", _write_nothing, _read_nothing),
    "bool": Kind("bool", Writer.flag, Reader.flag),
    "int": Kind("std::int64_t", Writer.integer, Reader.integer),
    "float": Kind("double", Writer.real, Reader.real),
    "str": Kind("std::string", Writer.text, Reader.text),
    "bytes": Kind("std::vector<std::uint8_t>", Writer.raw, Reader.raw),
    "Position": Kind("volery::Position", _write_position, _read_position),
}


def kind_of(written: str, where: str) -> Kind:
    """The type that a model writes; ``ModelError`` naming *where* if C++ has no such type."""
    name = written.strip()
    if name.endswith("[]"):
        return _many(kind_of(name.removesuffix("[]"), where))
    if name not in _KINDS:
        known = choices([one for one in _KINDS if one])
        raise ModelError(f"C++ components know no {name!r}, but {known}, and lists of them", where)
    return _KINDS[name]


def _many(of: Kind) -> Kind:
    def write(writer: Writer, values: Any) -> None:
        writer.integer(len(values))
        for value in values:
            of.write(writer, value)

    def read(reader: Reader) -> list[Any]:
        return [of.read(reader) for _ in range(reader.integer())]

    return Kind(f"std::vector<{of.cpp}>", write, read)
