"""Conversion of messages between two definitions of one type: of another year, distribution or ROS 1.

Fields correspond by name, and by their place where two definitions only spell names differently. What the
target lacks is left out, what it has in addition gets its default. A field whose kinds differ (a number and
a string, a fraction and a whole number) does not correspond.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from volery.base.errors import UsageError
from volery.ros.messages import lazy_rosbags as rosbags

HEADER = "std_msgs/msg/Header"
FILLER = "structure_needs_at_least_one_member"
"""Field of one byte in the encoding of a type without fields."""
_WHOLE = {
    "bool": (0, 1),
    "byte": (0, 255),
    "char": (0, 255),
    "octet": (0, 255),
    **{
        f"{sign}int{bits}": (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        for sign in ("", "u")
        for bits in (8, 16, 32, 64)
    },
}
"""Least and greatest value of the kinds of whole numbers."""
Convert = Callable[[Any], Any]
Make = Callable[[str], Any]
"""Returns the class of a message type by its name."""


class Corresponding(NamedTuple):
    """A field of the target: its name, and the source's field and its conversion, if it has one."""

    name: str
    source: str | None
    convert: Convert | None


class Conversion:
    """Converts messages of one type from the definition of one store to that of another.

    Args:
        source: Store with the definition that the messages have.
        target: Store with the other definition.
        name: Name of the type in both.
        make: Returns the target's class of a type.

    Attributes:
        left_out: Fields with a value other than their default that messages had and the target lacks, by
            path. It grows while messages are converted.
        filled: Fields that the target has in addition, by path.
    """

    def __init__(self, source: rosbags.Typestore, target: rosbags.Typestore, name: str, make: Make) -> None:
        self._source, self._target, self._name, self._make = source, target, name, make
        self._nested: dict[str, Conversion] = {}
        self._missing: list[str] = []
        self._own_left_out: dict[str, None] = {}
        theirs = [(label, what) for label, what in source.fielddefs[name][1] if label != FILLER]
        ours = [(label, what) for label, what in target.fielddefs[name][1] if label != FILLER]
        theirs = [their for their in theirs if not self._counts(their[0])]
        self._fields = self._matched(theirs, ours)
        taken = {field.source for field in self._fields}
        self._missing = [label for label, _ in theirs if label not in taken]
        plain = [(label, one.source) for (label, _), one in zip(ours, self._fields, strict=True)]
        in_place = [one for _, one in plain if one] == [label for label, _ in theirs if label in taken]
        self._in_place = in_place and not self._missing

    @cached_property
    def same_bytes(self) -> bool:
        """Whether both definitions encode messages alike, but for a header's ``seq``."""
        theirs, ours = (
            [_plain(what) for label, what in one.fielddefs[self._name][1] if not self._counts(label)]
            for one in (self._source, self._target)
        )
        return theirs == ours and self._in_place and all(one.same_bytes for one in self._nested.values())

    @property
    def left_out(self) -> tuple[str, ...]:
        """Return the fields of messages so far that were not at their default and are lost."""
        inner = [f"{one}" for nested in self._nested.values() for one in nested.left_out]
        return tuple(dict.fromkeys([*self._own_left_out, *inner]))

    @property
    def filled(self) -> tuple[str, ...]:
        """Return the fields that get their default."""
        own = [
            f"{self._label}.{field.name}"
            for field in self._fields
            if field.source is None and not self._counts(field.name)
        ]
        inner = [one for nested in self._nested.values() for one in nested.filled]
        return tuple(dict.fromkeys([*own, *inner]))

    def _counts(self, label: str) -> bool:
        """Return whether a field is a header's ``seq``, which ROS 1 has and ROS 2 has not."""
        return (self._name, label) == (HEADER, "seq")

    @property
    def _label(self) -> str:
        return self._name.rpartition("/")[2]

    def __call__(self, message: Any) -> Any:
        """Return a message of the target's class. Raises ``UsageError`` if a value does not fit it."""
        for label in self._missing:
            value = getattr(message, rosbags.normalize_fieldname(label))
            if not self._is_default(dict(self._source.fielddefs[self._name][1])[label], value):
                self._own_left_out[f"{self._label}.{label}"] = None
        values = {}
        for field in self._fields:
            name = rosbags.normalize_fieldname(field.name)
            if field.source is not None and field.convert is not None:
                value = getattr(message, rosbags.normalize_fieldname(field.source))
                try:
                    values[name] = field.convert(value)
                except (ValueError, TypeError, OverflowError) as error:
                    raise UsageError(f"{self._name}.{field.name}: {value!r} does not fit: {error}") from error
            else:
                values[name] = self._default(dict(self._target.fielddefs[self._name][1])[field.name])
        return self._make(self._name)(**values)

    # -- how fields correspond

    def _matched(self, theirs: list[tuple[str, Any]], ours: list[tuple[str, Any]]) -> list[Corresponding]:
        known = dict(theirs)
        spelled = {_spelling(label): label for label in known}
        rest = [label for label in known if label not in dict(ours)]
        found = []
        for place, (label, what) in enumerate(ours):
            source: str | None = label if label in known else spelled.get(_spelling(label))
            if source not in known and len(theirs) == len(ours) and theirs[place][0] in rest:
                source = theirs[place][0]  # only its name differs
            convert = None if source is None else self._value(known[source], what)
            found.append(Corresponding(label, source if convert else None, convert))
        return found

    def _value(self, theirs: Any, ours: Any) -> Convert | None:
        """Return what converts a field's value; None if the fields do not correspond."""
        (kind, detail), (our_kind, our_detail) = theirs, ours
        lists = (rosbags.Nodetype.ARRAY, rosbags.Nodetype.SEQUENCE)
        if (kind in lists) != (our_kind in lists):
            return None
        if kind not in lists:
            return self._single(theirs, ours)
        item, count = our_detail
        count = count if our_kind == rosbags.Nodetype.ARRAY else 0
        if item[0] == rosbags.Nodetype.BASE and item[1][0] != "string":
            if detail[0][0] != rosbags.Nodetype.BASE or _number(detail[0][1][0], item[1][0]) is None:
                return None
            base = item[1][0]
            return lambda values: _array(values, base, count)
        convert = self._single(detail[0], item)
        return (
            None if convert is None else lambda values: _counted([convert(value) for value in values], count)
        )

    def _single(self, theirs: Any, ours: Any) -> Convert | None:
        (kind, detail), (our_kind, our_detail) = theirs, ours
        if kind != our_kind:
            return None
        if kind == rosbags.Nodetype.BASE:
            return _number(detail[0], our_detail[0])
        if str(detail) != str(our_detail):
            return None
        name = str(detail)
        if name not in self._nested:
            self._nested[name] = Conversion(self._source, self._target, name, self._make)
        return self._nested[name]

    def _is_default(self, what: Any, value: Any) -> bool:
        """Return whether a value of the source says nothing: zero, empty, or a message of such values."""
        kind, detail = what
        if kind == rosbags.Nodetype.NAME:
            return all(
                self._is_default(one, getattr(value, rosbags.normalize_fieldname(label)))
                for label, one in self._source.fielddefs[str(detail)][1]
                if label != FILLER
            )
        if kind == rosbags.Nodetype.ARRAY:
            return all(self._is_default(detail[0], one) for one in value)
        return not value if kind == rosbags.Nodetype.BASE else not len(value)

    def _default(self, what: Any) -> Any:
        kind, detail = what
        if kind == rosbags.Nodetype.NAME:
            fields = self._target.fielddefs[str(detail)][1]
            inner = {
                rosbags.normalize_fieldname(label): self._default(one)
                for label, one in fields
                if label != FILLER
            }
            return self._make(str(detail))(**inner)
        if kind == rosbags.Nodetype.BASE:
            return _zero(detail[0])
        item, count = detail
        count = count if kind == rosbags.Nodetype.ARRAY else 0
        if item[0] == rosbags.Nodetype.BASE and item[1][0] != "string":
            return np.zeros(count, _dtype(item[1][0]))
        return [self._default(item) for _ in range(count)]


def _plain(what: Any) -> Any:
    """Return the type of a field without the bounds of sequences."""
    kind, detail = what
    if kind in (rosbags.Nodetype.ARRAY, rosbags.Nodetype.SEQUENCE):
        return kind, _plain(detail[0]), detail[1] if kind == rosbags.Nodetype.ARRAY else 0
    return detail[0] if kind == rosbags.Nodetype.BASE else detail


def _spelling(label: str) -> str:
    return label.replace("_", "").lower()


def _zero(base: str) -> Any:
    if base == "string":
        return ""
    if base == "bool":
        return False
    return 0 if base in _WHOLE else 0.0


def _dtype(base: str) -> str:
    return base if base not in {"byte", "char", "octet"} else "uint8"


def _number(theirs: str, ours: str) -> Convert | None:
    """Return what converts a number or a string; None if the kinds do not correspond."""
    if theirs == ours or "string" in (theirs, ours):
        return (lambda value: value) if theirs == ours else None
    if ours not in _WHOLE:
        return float
    if theirs not in _WHOLE:
        return None
    if ours == "bool":
        return bool
    least, greatest = _WHOLE[ours]

    def fitting(value: Any) -> int:
        if not least <= int(value) <= greatest:
            raise ValueError(f"not from {least} to {greatest}")
        return int(value)

    return fitting


def _array(values: Any, base: str, count: int) -> Any:
    given = np.asarray(values)
    made = given.astype(_dtype(base))
    if base in _WHOLE and not np.array_equal(made, given):
        raise ValueError(f"not all of them are {base}")
    return _counted(made, count)


def _counted(values: Any, count: int) -> Any:
    if count and len(values) != count:
        raise ValueError(f"{len(values)} values, but the field has {count}")
    return values
