"""Types of fields as ``rosidl_parser.definition`` has them, for ``SLOT_TYPES`` of messages of rclpy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from volery.ros.messages import lazy_rosbags as rosbags
from volery.ros.messages.store import FILLER, SPELLED, store


class AbstractType:
    """Base of all types."""


class AbstractNestableType(AbstractType):
    """A type that an array or a sequence may have."""


class AbstractString(AbstractNestableType):
    """A string."""


class AbstractNestedType(AbstractType):
    """An array or a sequence."""

    value_type: AbstractType


@dataclass(eq=True)
class BasicType(AbstractNestableType):
    """A number or a truth value, by its name in IDL."""

    typename: str


@dataclass(eq=True)
class NamespacedType(AbstractNestableType):
    """A message: the package and the kind, and the name."""

    namespaces: list[str]
    name: str

    def namespaced_name(self) -> tuple[str, ...]:
        """Return package, kind and name."""
        return (*self.namespaces, self.name)


class UnboundedString(AbstractString):
    """A string of any length."""

    def has_maximum_size(self) -> bool:
        """Return False."""
        return False


@dataclass(eq=True)
class BoundedString(AbstractString):
    """A string of limited length."""

    maximum_size: int

    def has_maximum_size(self) -> bool:
        """Return True."""
        return True


@dataclass(eq=True)
class Array(AbstractNestedType):
    """An array of fixed length."""

    value_type: AbstractType
    size: int

    def has_maximum_size(self) -> bool:
        """Return True."""
        return True


class AbstractSequence(AbstractNestedType):
    """A sequence."""


@dataclass(eq=True)
class UnboundedSequence(AbstractSequence):
    """A sequence of any length."""

    value_type: AbstractType

    def has_maximum_size(self) -> bool:
        """Return False."""
        return False


@dataclass(eq=True)
class BoundedSequence(AbstractSequence):
    """A sequence of limited length."""

    value_type: AbstractType
    maximum_size: int

    def has_maximum_size(self) -> bool:
        """Return True."""
        return True


DEFINITION: dict[str, type] = {
    kind.__name__: kind
    for kind in (
        *(AbstractType, AbstractNestableType, AbstractString, AbstractNestedType, AbstractSequence),
        *(BasicType, NamespacedType, UnboundedString, BoundedString),
        *(Array, UnboundedSequence, BoundedSequence),
    )
}
"""Content of ``rosidl_parser.definition``, as far as messages need it."""


def slot_types(full: str) -> tuple[AbstractType, ...]:
    """Return the types of a message's fields in their order."""
    return tuple(_type(what) for label, what in store().fielddefs[full][1] if label != FILLER)


def _type(what: Any) -> AbstractType:
    kind, detail = what
    if kind == rosbags.Nodetype.NAME:
        package, below, name = detail.split("/")
        return NamespacedType([package, below], name)
    if kind == rosbags.Nodetype.BASE:
        base, bound = detail
        if base == "string":
            return BoundedString(bound) if bound else UnboundedString()
        return BasicType(SPELLED.get(base, base))
    inner, count = _type(detail[0]), detail[1]
    if kind == rosbags.Nodetype.ARRAY:
        return Array(inner, count)
    return BoundedSequence(inner, count) if count else UnboundedSequence(inner)
