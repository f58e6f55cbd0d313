"""Types that may cross the border in the operations of a model's interfaces: in Python, in C++, on the wire.

A model writes ``bool``, ``int``, ``float``, ``str``, ``bytes``, ``Position``, and ``T[]`` for many of them.

C++ text that is generated from a model: its interfaces as abstract classes, and the glue of a component.

``interfaces.h`` is what a component's file includes. The glue joins the user's class to the border: it
constructs it from its required ports, in the order of the model, and calls its operations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from volery.base.errors import ModelError, choices
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.model.system import Interface, Signature
from volery.ros.client_libraries.abi_codec import Reader, Writer

_ALTITUDES = (AMSL, Ellipsoidal, AboveHome, AboveGround)
"""In the order of ``volery::Reference``."""


class CppType(NamedTuple):
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


_KINDS: Mapping[str, CppType] = {
    "": CppType("void", _write_nothing, _read_nothing),
    "bool": CppType("bool", Writer.flag, Reader.flag),
    "int": CppType("std::int64_t", Writer.integer, Reader.integer),
    "float": CppType("double", Writer.real, Reader.real),
    "str": CppType("std::string", Writer.text, Reader.text),
    "bytes": CppType("std::vector<std::uint8_t>", Writer.raw, Reader.raw),
    "Position": CppType("volery::Position", _write_position, _read_position),
}


def cpp_type(written: str, where: str) -> CppType:
    """The type that a model writes; ``ModelError`` naming *where* if C++ has no such type."""
    name = written.strip()
    if name.endswith("[]"):
        return _many(cpp_type(name.removesuffix("[]"), where))
    if name not in _KINDS:
        known = choices([one for one in _KINDS if one])
        raise ModelError(f"C++ components know no {name!r}, but {known}, and lists of them", where)
    return _KINDS[name]


def _many(of: CppType) -> CppType:
    def write(writer: Writer, values: Any) -> None:
        writer.integer(len(values))
        for value in values:
            of.write(writer, value)

    def read(reader: Reader) -> list[Any]:
        return [of.read(reader) for _ in range(reader.integer())]

    return CppType(f"std::vector<{of.cpp}>", write, read)


HEADER = "volery/interfaces.h"
DRONE = "Drone"
"""The interface of a vehicle that C++ components may require: ``I_RosDron`` to them."""


@dataclass(frozen=True)
class CppOperation:
    """An operation of an interface with the types of what crosses the border."""

    name: str
    arguments: tuple[tuple[str, CppType], ...]
    returns: CppType

    @property
    def declaration(self) -> str:
        """As a member function."""
        taken = ", ".join(f"{kind.as_argument} {name}" for name, kind in self.arguments)
        return f"{self.returns.cpp} {self.name}({taken})"


def operation(interface: str, signature: Signature) -> CppOperation:
    """*signature* with its types; ``ModelError`` for one that C++ cannot take or give."""
    where = f"interfaces.{interface}.{signature.name}"
    arguments = tuple(
        (one.name, cpp_type(one.type, f"{where}.args.{one.name}")) for one in signature.arguments
    )
    return CppOperation(signature.name, arguments, cpp_type(signature.returns, f"{where}.returns"))


def operations(interface: Interface) -> tuple[CppOperation, ...]:
    """All of them, in the order of the model."""
    return tuple(operation(interface.name, one) for one in interface.operations.values())


@dataclass(frozen=True)
class RequiredPort:
    """A required port: its name, the name of its interface, and whether any number may be connected."""

    port: str
    interface: str
    many: bool = False

    @property
    def cpp(self) -> str:
        """What the constructor takes for it."""
        name = "I_RosDron" if self.interface == DRONE else self.interface
        return f"const std::vector<{name}*>&" if self.many else f"{name}&"


def interfaces_header(interfaces: Iterable[Interface]) -> str:
    """The text of ``interfaces.h``."""
    lines = ["// Generated from the model: its interfaces.", "#pragma once", '#include "volery/types.h"', ""]
    for one in interfaces:
        lines.append(f"class {one.name} {{")
        lines.append("public:")
        lines.append(f"    virtual ~{one.name}() = default;")
        lines += [f"    virtual {found.declaration} = 0;" for found in operations(one)]
        lines += ["};", ""]
    return "\n".join(lines)


def glue(
    class_name: str,
    file: Path,
    requires: Sequence[RequiredPort],
    provided: Sequence[CppOperation],
    interfaces: Mapping[str, Interface],
) -> str:
    """The text that makes *class_name*, defined in *file*, a component."""
    used = dict.fromkeys(one.interface for one in requires if one.interface != DRONE)
    lines = ["// Generated: joins the component's class to the border.", f'#include "{file}"', ""]
    lines += ['#include "volery/glue.h"', f'#include "{HEADER}"', "", "namespace {"]
    for name in used:
        lines += _port_class(interfaces[name])
    lines += [f"volery::Component<{class_name}> component;", ""]
    lines += ["bool const enlisted = [] {"]
    lines += [f"    {line}" for line in _construction(class_name, requires)]
    for number, one in enumerate(provided):
        lines += [f"    {line}" for line in _served(number, one)]
    lines += ["    return true;", "}();", "}  // namespace", ""]
    return "\n".join(lines)


def _port_class(interface: Interface) -> list[str]:
    """The interface as seen by who requires it: each call is a question."""
    name = interface.name
    lines = [f"class {name}_port final : public {name}, public volery::Port {{", "public:"]
    lines.append("    using volery::Port::Port;")
    for one in operations(interface):
        names = "".join(f", {name}" for name, _ in one.arguments)
        lines.append(f"    {one.declaration} override {{")
        lines.append(f'        return call<{one.returns.cpp}>("{one.name}"{names});')
        lines.append("    }")
    return [*lines, "};", ""]


def _construction(class_name: str, requires: Sequence[RequiredPort]) -> list[str]:
    made = []
    for one in requires:
        label = "I_RosDron" if one.interface == DRONE else f"{one.interface}_port"
        known = "I_RosDron" if one.interface == DRONE else one.interface
        many = "many" if one.many else "one"
        made.append(f'volery::{many}<{known}, {label}>("{one.port}")')
    taken = "".join(f", {one.cpp}" for one in requires)
    return [
        "volery::enlist_as(volery::MAKE, [](volery::Reader, volery::Writer&) {",
        f"    volery::check_constructor<{class_name}{taken}>();",
        f"    component.make({', '.join(made)});",
        "});",
        "volery::enlist_as(volery::RUN, [](volery::Reader, volery::Writer&) { component.run(); });",
    ]


def _served(number: int, one: CppOperation) -> list[str]:
    lines = [
        f"volery::enlist_as(volery::OPERATIONS + {number}, "
        "[]([[maybe_unused]] volery::Reader in, [[maybe_unused]] volery::Writer& out) {"
    ]
    lines += [f"    auto const {name} = volery::get<{kind.cpp}>(in);" for name, kind in one.arguments]
    called = f"component->{one.name}({', '.join(name for name, _ in one.arguments)})"
    lines.append(f"    {called};" if one.returns.cpp == "void" else f"    volery::put(out, {called});")
    return [*lines, "});"]
