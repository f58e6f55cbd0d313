"""What generated headers of messages have in common: types, constants, and visits of the parts."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from volery.ros.messages.encodings import Constant, MessageLayout

SHARED_INCLUDE = Path(__file__).parents[1] / "include"
"""Headers that all C++ components may include."""
NOT_OFFERED = "// volery: "
"""Beginning of the text of a header that is not offered; the rest says so, and what to do instead."""
BASES = {
    "bool": "std::uint8_t", "byte": "std::int8_t", "char": "std::uint8_t", "octet": "std::uint8_t",
    "int8": "std::int8_t", "uint8": "std::uint8_t", "int16": "std::int16_t", "uint16": "std::uint16_t",
    "int32": "std::int32_t", "uint32": "std::uint32_t", "int64": "std::int64_t", "uint64": "std::uint64_t",
    "float32": "float", "float64": "double", "string": "std::string",
}  # fmt: skip
"""Types of fields in ROS 1."""
_INCLUDED = re.compile(r'^#include "([^"]+)"', re.MULTILINE)


def with_ours(includes: Sequence[str], folder: Path) -> list[str]:
    """Return *includes* and, of the headers in *folder* and of the shared ones, what they include in turn."""
    found = dict.fromkeys(includes)
    waiting = list(includes)
    while waiting:
        name = waiting.pop()
        ours = next((one for one in (folder / name, SHARED_INCLUDE / name) if one.is_file()), None)
        if ours is not None:
            further = [name for name in _INCLUDED.findall(ours.read_text()) if name not in found]
            found.update(dict.fromkeys(further))
            waiting += further
    return list(found)


def refusal(name: str, remedy: str) -> str:
    """Return the text of a header that is not offered."""
    return f"{NOT_OFFERED}<{name}> is not offered: {remedy}\n"


def constant_lines(layout: MessageLayout, bases: Callable[[str], str]) -> list[str]:
    """Return the constants of a message as members; *bases* gives the type of a number."""
    return [f"    {_constant(constant, bases)}" for constant in layout.constants]


def _constant(one: Constant, bases: Callable[[str], str]) -> str:
    if one.base == "string":
        return f"static inline const std::string {one.name} = {text_literal(str(one.value))};"
    value = str(one.value).lower() if isinstance(one.value, bool) else one.value
    kind = bases(one.base)
    return f"static constexpr {kind} {one.name} = static_cast<{kind}>({value});"


def text_literal(text: str) -> str:
    """Return a text as a literal of C++."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'


def visit_lines(layout: MessageLayout) -> list[str]:
    """Return the members by which a message is encoded, decoded and printed, and its name."""
    lines = ["    template <class Visitor, class Message>"]
    lines += ["    static void each_([[maybe_unused]] Visitor& visit, [[maybe_unused]] Message& message) {"]
    lines += [
        f'        visit("{field.name}", message.{field.name});' for field in layout.fields if field.carried
    ]
    if not any(field.carried for field in layout.fields):
        lines += ["        visit.nothing();"]
    return [*lines, "    }", f'    static const char* name_() {{ return "{layout.name}"; }}']
