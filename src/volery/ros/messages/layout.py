"""What a type is made of, for generators of code in other languages: names and order as ROS 1 has them."""

from __future__ import annotations

from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype

from volery.ros.messages.ros1 import definition_store, ros1_name
from volery.ros.messages.store import message_class, message_name

FILLER = "structure_needs_at_least_one_member"
"""The byte that the encoding of a type without fields has."""


class FieldLayout(NamedTuple):
    """A field: exactly one of ``base`` (a number, bool or string) and ``nested`` (a type's name) is given.

    ``length`` is ``None`` for a single value, 0 for a sequence, else the length of an array. ``carried`` is
    False for what ROS 1 has and the encoding has not: a header's ``seq``.
    """

    name: str
    base: str = ""
    nested: str = ""
    length: int | None = None
    carried: bool = True


class Constant(NamedTuple):
    """A constant of a type."""

    name: str
    base: str
    value: Any


class Layout(NamedTuple):
    """A message type: its name here (``package/msg/Name``) and in ROS 1 (``package/Name``), and its parts."""

    name: str
    label: str
    constants: tuple[Constant, ...]
    fields: tuple[FieldLayout, ...]


def ros1_layout(name: str) -> Layout:
    """The layout of a message type, in ROS 1's names. ``UsageError`` if unknown or if ROS 1's is another."""
    full = message_name(name)
    message_class(full)
    constants, fields = definition_store(full).fielddefs[full]
    return Layout(
        full,
        ros1_name(full),
        tuple(Constant(label, base, value) for label, base, value in constants),
        tuple(_field(full, label, what) for label, what in fields if label != FILLER),
    )


def _field(owner: str, name: str, what: Any) -> FieldLayout:
    kind, detail = what
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        inner, count = detail
        return _field(owner, name, inner)._replace(length=count if kind == Nodetype.ARRAY else 0)
    if kind == Nodetype.NAME:
        return FieldLayout(name, nested=str(detail))
    return FieldLayout(name, base=str(detail[0]), carried=(owner, name) != ("std_msgs/msg/Header", "seq"))
