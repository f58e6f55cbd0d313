"""Values of parameters on their way over the border: a letter for the kind, then the value."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from volery.ros.client_libraries.wire import Reader, Writer


def write(writer: Writer, value: Any) -> None:
    """Append *value*; what C++ has no kind for is written as its text."""
    if isinstance(value, bool):
        writer.text("b").flag(value)
    elif isinstance(value, int):
        writer.text("i").integer(value)
    elif isinstance(value, float):
        writer.text("d").real(value)
    elif isinstance(value, (list, tuple)):
        writer.text("l").integer(len(value))
        for item in value:
            write(writer, item)
    elif isinstance(value, dict):
        writer.text("m").integer(len(value))
        for name, item in value.items():
            write(writer.text(name), item)
    else:
        writer.text("s").text(str(value))


def read(reader: Reader) -> Any:
    """The next value."""
    kind = reader.text()
    if kind == "l":
        return [read(reader) for _ in range(reader.integer())]
    if kind == "m":
        return {reader.text(): read(reader) for _ in range(reader.integer())}
    return {"b": reader.flag, "i": reader.integer, "d": reader.real, "s": reader.text}[kind]()


def names_below(tree: Any, prefix: str = "") -> list[str]:
    """The absolute names of all parameters in a tree, sorted."""
    return sorted(_leaves(tree, prefix))


def _leaves(tree: Any, prefix: str) -> Iterable[str]:
    if not isinstance(tree, dict):
        yield prefix
        return
    for name, inner in tree.items():
        yield from _leaves(inner, f"{prefix}/{name}")
