"""How the classes of rclpy spell their fields' types, so that theirs and ours can be compared."""

from __future__ import annotations

from functools import cache
from typing import Any

from rosbags.interfaces import Nodetype

from volery.ros.messages.store import message_name, store

_SPELLED = {"float32": "float", "float64": "double", "bool": "boolean", "byte": "octet", "char": "uint8"}


@cache
def idl_fields(name: str) -> dict[str, str]:
    """The types of a message's fields by their names: ``{"data": "sequence<double>"}``."""
    fields = store().fielddefs[message_name(name)][1]
    return {label: _spell(what) for label, what in fields if label != "structure_needs_at_least_one_member"}


@cache
def nested_types(name: str) -> tuple[str, ...]:
    """The message types that *name* is made of directly."""
    inner = (_inner(what) for _, what in store().fielddefs[message_name(name)][1])
    return tuple(sorted({one for one in inner if one}))


def _inner(what: Any) -> str:
    kind, detail = what
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return _inner(detail[0])
    return str(detail) if kind == Nodetype.NAME else ""


def _spell(what: Any) -> str:
    kind, detail = what
    if kind == Nodetype.NAME:
        return str(detail).replace("/msg/", "/")
    if kind == Nodetype.BASE:
        base, bound = detail
        return f"{base}<{bound}>" if bound else _SPELLED.get(base, base)
    inner, count = detail
    if kind == Nodetype.ARRAY:
        return f"{_spell(inner)}[{count}]"
    return f"sequence<{_spell(inner)}{f', {count}' if count else ''}>"
