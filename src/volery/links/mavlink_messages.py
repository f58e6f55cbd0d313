"""MAVLink messages that pymavlink's dialects do not have yet, stated as MAVLink's own definitions state them.

How the fields lie on the wire, and the extra byte of the checksum, follow from names and types by MAVLink's
rules (https://mavlink.io/en/guide/serialization.html): larger types first, otherwise in the order stated; the
extra byte is the checksum over the names and types, folded.

MAVLink 2 as bytes: a ``Frame`` to its wire form and back.

Dialect ``ardupilotmega``, which holds ``common``. The message definitions are pymavlink's; packing uses them
directly instead of pymavlink's message objects, which cost three times as much. Arrays are tuples of numbers,
``char[]`` fields are ``str``. A field that is not given is zero or empty, as the protocol says of fields that
an older sender does not know. Signatures are neither written nor checked.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import cache, cached_property
from typing import Any, NamedTuple

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import ardupilotmega as dialect

from volery.base.errors import UsageError, did_you_mean

_CODES: Mapping[str, str] = {
    "uint8_t": "B",
    "int8_t": "b",
    "uint16_t": "H",
    "int16_t": "h",
    "uint32_t": "I",
    "int32_t": "i",
    "uint64_t": "Q",
    "int64_t": "q",
    "float": "f",
    "double": "d",
}


class NewerField(NamedTuple):
    """``length`` is 0 for a single value, else how many."""

    type: str
    name: str
    length: int = 0


class Definition:
    """Has the attributes of pymavlink's definitions that ``links.mavlink`` looks at. No extension fields."""

    def __init__(self, number: int, name: str, *fields: NewerField) -> None:
        self.id = number
        self.msgname = name
        self.fieldnames = [field.name for field in fields]
        self.fieldtypes = [field.type for field in fields]
        ordered = sorted(fields, key=_size, reverse=True)  # stable: equals stay as stated
        self.ordered_fieldnames = [field.name for field in ordered]
        self.array_lengths = [field.length for field in ordered]
        self.unpacker = struct.Struct(
            "<" + "".join(f"{field.length or ''}{_CODES[field.type]}" for field in ordered)
        )
        self.crc_extra = _extra(name, ordered)


def _size(field: NewerField) -> int:
    return struct.calcsize("<" + _CODES[field.type])


def _extra(name: str, ordered: list[NewerField]) -> int:
    stated = f"{name} ".encode()
    for field in ordered:
        stated += f"{field.type} {field.name} ".encode()
        stated += bytes([field.length]) if field.length else b""
    checksum: int = mcrf4xx(stated)
    return (checksum & 0xFF) ^ (checksum >> 8)


EVENT = Definition(
    410,
    "EVENT",
    NewerField("uint8_t", "destination_component"),
    NewerField("uint8_t", "destination_system"),
    NewerField("uint32_t", "id"),
    NewerField("uint32_t", "event_time_boot_ms"),
    NewerField("uint16_t", "sequence"),
    NewerField("uint8_t", "log_levels"),
    NewerField("uint8_t", "arguments", 40),
)
CURRENT_EVENT_SEQUENCE = Definition(
    411, "CURRENT_EVENT_SEQUENCE", NewerField("uint16_t", "sequence"), NewerField("uint8_t", "flags")
)
REQUEST_EVENT = Definition(
    412,
    "REQUEST_EVENT",
    NewerField("uint8_t", "target_system"),
    NewerField("uint8_t", "target_component"),
    NewerField("uint16_t", "first_sequence"),
    NewerField("uint16_t", "last_sequence"),
)
RESPONSE_EVENT_ERROR = Definition(
    413,
    "RESPONSE_EVENT_ERROR",
    NewerField("uint8_t", "target_system"),
    NewerField("uint8_t", "target_component"),
    NewerField("uint16_t", "sequence"),
    NewerField("uint16_t", "sequence_oldest_available"),
    NewerField("uint8_t", "reason"),
)

NEWER = (EVENT, CURRENT_EVENT_SEQUENCE, REQUEST_EVENT, RESPONSE_EVENT_ERROR)


class _Field(NamedTuple):
    name: str
    length: int  # 0 for a single value, else how many
    text: bool


def _naming(names: tuple[str, ...]) -> Callable[..., dict[str, Any]]:
    """What makes a dictionary of values in the order of *names*: code written for them, twice as fast as zip.

    A name may be a word of Python's, so arguments are numbered.
    """
    arguments = [f"value_{number}" for number in range(len(names))]
    items = ", ".join(f"{name!r}: {value}" for name, value in zip(names, arguments, strict=True))
    named: Callable[..., dict[str, Any]] = eval(f"lambda {', '.join(arguments)}: {{{items}}}")
    return named


class MessageType:
    """One message of the dialect: its id and how its fields lie on the wire.

    ``size`` is that of the payload with nothing cut off.
    """

    def __init__(self, definition: Any) -> None:
        self.name: str = definition.msgname
        self.id: int = definition.id
        self.field_names: tuple[str, ...] = tuple(definition.fieldnames)
        self._extra = bytes([definition.crc_extra])
        self._struct: struct.Struct = definition.unpacker
        self.size: int = self._struct.size
        self._fields = tuple(self._laid_out(definition))
        self._names = tuple(field.name for field in self._fields)
        self._known = frozenset(self._names)
        self._plain = all(field.length == 0 for field in self._fields)

    @staticmethod
    def _laid_out(definition: Any) -> list[_Field]:
        texts = {
            name
            for name, kind in zip(definition.fieldnames, definition.fieldtypes, strict=True)
            if kind == "char"
        }
        return [
            _Field(name, length, name in texts)
            for name, length in zip(definition.ordered_fieldnames, definition.array_lengths, strict=True)
        ]

    def pack(self, fields: Mapping[str, Any]) -> bytes:
        """The whole payload. Raises ``UsageError`` naming a field that does not exist or does not fit."""
        if not self._known.issuperset(fields):
            raise self._unknown_field(fields)
        try:
            if self._plain:
                return self._struct.pack(*[fields.get(name, 0) for name in self._names])
            return self._struct.pack(*self._flat(fields))
        except (struct.error, OverflowError, TypeError, ValueError) as error:
            raise UsageError(f"{self.name}: a field does not fit ({error}): {dict(fields)}") from None

    def _flat(self, fields: Mapping[str, Any]) -> list[Any]:
        values: list[Any] = []
        for field in self._fields:
            given = fields.get(field.name)
            if field.text:
                values.append((given or "").encode()[: field.length])
            elif field.length == 0:
                values.append(given or 0)
            else:
                given = tuple(given or ())
                if len(given) > field.length:
                    raise ValueError(f"{field.name} has room for {field.length} values")
                values += given + (0,) * (field.length - len(given))
        return values

    def _unknown_field(self, fields: Mapping[str, Any]) -> UsageError:
        wrong = next(name for name in fields if name not in self._known)
        hint = did_you_mean(wrong, self.field_names)
        return UsageError(f"{self.name} has no field {wrong!r}{hint}; it has {', '.join(self.field_names)}")

    def unpack(self, payload: bytes) -> dict[str, Any]:
        """The fields of a payload, which may be shorter (zeros were cut off) or longer (a newer sender)."""
        if len(payload) != self.size:
            payload = payload[: self.size].ljust(self.size, b"\0")
        values = self._struct.unpack(payload)
        if self._plain:
            return self._named(*values)
        fields: dict[str, Any] = {}
        place = 0
        for field in self._fields:
            if field.text:
                fields[field.name] = values[place].split(b"\0", 1)[0].decode(errors="replace")
                place += 1
            elif field.length == 0:
                fields[field.name] = values[place]
                place += 1
            else:
                fields[field.name] = values[place : place + field.length]
                place += field.length
        return fields

    @cached_property
    def _named(self) -> Callable[..., dict[str, Any]]:
        return _naming(self._names)

    def checksum(self, covered: bytes) -> int:
        """X.25 (CRC-16/MCRF4XX) over everything after STX and the message's own extra byte."""
        crc: int = mcrf4xx(covered + self._extra)
        return crc


_TYPES = {definition.id: MessageType(definition) for definition in (*NEWER, *dialect.mavlink_map.values())}
_BY_NAME = {kind.name: kind for kind in _TYPES.values()}


def message_type(name: str) -> MessageType:
    """The definition of the message called *name*; ``UsageError`` if the dialect has none."""
    kind = _BY_NAME.get(name)
    if kind is None:
        raise UsageError(f"MAVLink has no message {name!r}{did_you_mean(name, _BY_NAME)}")
    return kind


def message_type_of(number: int) -> MessageType | None:
    """The definition of message *number*; ``None`` if the dialect has none."""
    return _TYPES.get(number)


@cache
def constant(name: str) -> int:
    """The value of an enumeration entry, such as ``MAV_CMD_NAV_TAKEOFF``."""
    value = getattr(dialect, name, None)
    if not isinstance(value, int):
        raise UsageError(f"MAVLink has no constant {name!r}")
    return value


@cache
def entry_name(enumeration: str, value: int) -> str:
    """The name of *value* in an enumeration without the enumeration's own: ``("MAV_RESULT", 4)`` is
    ``FAILED``.
    """
    entries = dialect.enums.get(enumeration)
    if entries is None:
        hint = did_you_mean(enumeration, dialect.enums)
        raise UsageError(f"MAVLink has no enumeration {enumeration!r}{hint}")
    entry = entries.get(value)
    if entry is None:
        return str(value)
    return str(entry.name).removeprefix(f"{enumeration}_")
