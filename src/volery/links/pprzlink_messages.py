"""pprzlink message definitions: ids, payload layouts and enumerations.

The definitions are read from ``pprzlink_messages.txt``. Numbers are little-endian and follow one another in
the order of the definition, without gaps. Arrays are tuples; ``char[]`` and ``string`` fields are ``str``. A
field that is not given is zero or empty.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from volery.base.errors import UsageError, choices, did_you_mean

TELEMETRY, DATALINK, GROUND, ALERT, INTERMCU = 1, 2, 3, 4, 5
"""Message classes: aircraft to ground, ground to aircraft, between ground programs, alerts, on board."""

MAX_PAYLOAD = 247
"""Bytes. The length of a frame is sent as one byte and includes eight bytes around the payload."""

_CODES = {
    "char": "s",
    "double": "d",
    "float": "f",
    "int16": "h",
    "int32": "i",
    "int8": "b",
    "uint16": "H",
    "uint32": "I",
    "uint8": "B",
}
_ANY = -1


class PayloadField(NamedTuple):
    """One field. ``length`` is 0 for a single value, the array length, or -1 if a count comes first."""

    name: str
    code: str
    length: int = 0
    words: tuple[str, ...] = ()

    @property
    def text(self) -> bool:
        """Whether the field holds characters, which are represented as one ``str``."""
        return self.code == "s"


class PprzMessageType:
    """One message: its number within its class, and its fields."""

    def __init__(self, kind: int, number: int, name: str, fields: tuple[PayloadField, ...]) -> None:
        self.kind, self.id, self.name = kind, number, name
        self.fields = fields
        self.field_names = tuple(field.name for field in fields)
        self._known = frozenset(self.field_names)
        plain = all(field.length == 0 and not field.text for field in fields)
        self._struct = struct.Struct("<" + "".join(field.code for field in fields)) if plain else None

    def pack(self, fields: Mapping[str, Any]) -> bytes:
        """Return the payload; raise ``UsageError`` naming a field that does not exist or does not fit."""
        if not self._known.issuperset(fields):
            wrong = next(name for name in fields if name not in self._known)
            hint = did_you_mean(wrong, self.field_names)
            raise UsageError(f"{self.name} has no field {wrong!r}{hint}; it has {choices(self.field_names)}")
        try:
            if self._struct is not None:
                return self._struct.pack(*[fields.get(name, 0) for name in self.field_names])
            payload = b"".join(_packed(field, fields.get(field.name)) for field in self.fields)
        except (struct.error, OverflowError, TypeError, ValueError) as error:
            raise UsageError(f"{self.name}: a field does not fit ({error}): {dict(fields)}") from None
        if len(payload) > MAX_PAYLOAD:
            room = f"{len(payload)} bytes, a frame has room for {MAX_PAYLOAD}"
            raise UsageError(f"{self.name}: too long: {room}")
        return payload

    def unpack(self, payload: bytes) -> dict[str, Any] | None:
        """Return the fields, or None if *payload* does not have the length of this message."""
        if self._struct is not None:
            if len(payload) != self._struct.size:
                return None
            return dict(zip(self.field_names, self._struct.unpack(payload), strict=True))
        fields: dict[str, Any] = {}
        at = 0
        for field in self.fields:
            taken = _unpacked(field, payload, at)
            if taken is None:
                return None
            fields[field.name], at = taken
        return fields if at == len(payload) else None

    def words(self, field: str) -> tuple[str, ...]:
        """Return the names of the values of *field*; empty if the field is no enumeration.

        Raises:
            UsageError: The message has no such field.
        """
        for one in self.fields:
            if one.name == field:
                return one.words
        hint = did_you_mean(field, self.field_names)
        raise UsageError(f"{self.name} has no field {field!r}{hint}")


def _packed(field: PayloadField, given: Any) -> bytes:
    if field.text:
        octets = str(given or "").encode(errors="replace")
        if field.length == _ANY:
            return bytes([len(octets)]) + octets
        return octets[: field.length].ljust(field.length, b"\0")
    if field.length == 0:
        return struct.pack(f"<{field.code}", given or 0)
    values = tuple(given or ())
    if field.length == _ANY:
        return struct.pack(f"<B{len(values)}{field.code}", len(values), *values)
    if len(values) > field.length:
        raise ValueError(f"{field.name} has room for {field.length} values")
    values += (0,) * (field.length - len(values))
    return struct.pack(f"<{field.length}{field.code}", *values)


def _unpacked(field: PayloadField, payload: bytes, at: int) -> tuple[Any, int] | None:
    """Return the value and the start of the next field, or None if the payload ends before."""
    count = field.length
    if count == _ANY:
        if at >= len(payload):
            return None
        count, at = payload[at], at + 1
    form = f"<{count}{field.code}" if count or field.length == _ANY else f"<{field.code}"
    end = at + struct.calcsize(form)
    if end > len(payload):
        return None
    values = struct.unpack_from(form, payload, at)
    if field.text:
        return values[0].split(b"\0", 1)[0].decode(errors="replace"), end
    return (values[0] if field.length == 0 else values), end


# -- the definitions


def _field(text: str) -> PayloadField:
    name, kind, *more = text.split()
    words = tuple(more[0][1:].split("|")) if more and more[0].startswith("=") else ()
    if kind == "string":
        return PayloadField(name, "s", _ANY, words)
    base, bracket, inside = kind.partition("[")
    length = int(inside[:-1] or _ANY) if bracket else 0
    if base == "char" and not bracket:
        length = 1
    return PayloadField(name, _CODES[base], length, words)


def parse_definitions(text: str) -> list[PprzMessageType]:
    """Return the messages defined by *text* in the format that ``pprzlink_messages.txt`` describes."""
    found: list[PprzMessageType] = []
    kind = 0
    for line in text.splitlines():
        if line.startswith("==="):
            kind = int(line.split()[2])
        elif line and not line.startswith("#"):
            head, _, listed = line.partition(":")
            number, name = head.split()
            fields = tuple(_field(part) for part in listed.split(",") if part.strip())
            found.append(PprzMessageType(kind, int(number), name, fields))
    return found


_ALL = parse_definitions(files("volery.links").joinpath("pprzlink_messages.txt").read_text(encoding="utf-8"))
_BY_NUMBER = {(one.kind, one.id): one for one in _ALL}
_BY_NAME = {one.name: one for one in _ALL}
assert len(_BY_NUMBER) == len(_BY_NAME) == len(_ALL), "a message is defined twice"


def message_type(name: str) -> PprzMessageType:
    """Return the message type called *name*; raise ``UsageError`` if there is none."""
    found = _BY_NAME.get(name)
    if found is None:
        raise UsageError(f"pprzlink has no message {name!r} here{did_you_mean(name, _BY_NAME)}")
    return found


def message_type_of(kind: int, number: int) -> PprzMessageType | None:
    """Return the message type *number* of class *kind*, or None if there is none."""
    return _BY_NUMBER.get((kind, number))


def message_names() -> list[str]:
    """Return the names of all defined messages, sorted."""
    return sorted(_BY_NAME)


@cache
def entry_name(message: str, field: str, value: int) -> str:
    """Return the name of *value*, or its digits if it has none.

    ``entry_name("ROTORCRAFT_STATUS", "ap_mode", 19)`` is ``GUIDED``.
    """
    words = message_type(message).words(field)
    return words[value] if 0 <= value < len(words) else str(value)


@cache
def entry_value(message: str, field: str, word: str) -> int:
    """Return the value of *word* in the enumeration of a field.

    Raises:
        UsageError: There is no such word; the error lists the valid ones.
    """
    words = message_type(message).words(field)
    if word not in words:
        hint = did_you_mean(word, words)
        raise UsageError(f"{message}.{field} has no {word!r}{hint}; it has {choices(words)}")
    return words.index(word)
