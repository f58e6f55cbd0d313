"""MAVLink messages that pymavlink's dialects do not have yet, stated as MAVLink's own definitions state them.

How the fields lie on the wire, and the extra byte of the checksum, follow from names and types by MAVLink's
rules (https://mavlink.io/en/guide/serialization.html): larger types first, otherwise in the order stated; the
extra byte is the checksum over the names and types, folded.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import NamedTuple

from fastcrc.crc16 import mcrf4xx

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


class Field(NamedTuple):
    """``length`` is 0 for a single value, else how many."""

    type: str
    name: str
    length: int = 0


class Definition:
    """Has the attributes of pymavlink's definitions that ``links.mavlink`` looks at. No extension fields."""

    def __init__(self, number: int, name: str, *fields: Field) -> None:
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


def _size(field: Field) -> int:
    return struct.calcsize("<" + _CODES[field.type])


def _extra(name: str, ordered: list[Field]) -> int:
    stated = f"{name} ".encode()
    for field in ordered:
        stated += f"{field.type} {field.name} ".encode()
        stated += bytes([field.length]) if field.length else b""
    checksum: int = mcrf4xx(stated)
    return (checksum & 0xFF) ^ (checksum >> 8)


EVENT = Definition(
    410,
    "EVENT",
    Field("uint8_t", "destination_component"),
    Field("uint8_t", "destination_system"),
    Field("uint32_t", "id"),
    Field("uint32_t", "event_time_boot_ms"),
    Field("uint16_t", "sequence"),
    Field("uint8_t", "log_levels"),
    Field("uint8_t", "arguments", 40),
)
CURRENT_EVENT_SEQUENCE = Definition(
    411, "CURRENT_EVENT_SEQUENCE", Field("uint16_t", "sequence"), Field("uint8_t", "flags")
)
REQUEST_EVENT = Definition(
    412,
    "REQUEST_EVENT",
    Field("uint8_t", "target_system"),
    Field("uint8_t", "target_component"),
    Field("uint16_t", "first_sequence"),
    Field("uint16_t", "last_sequence"),
)
RESPONSE_EVENT_ERROR = Definition(
    413,
    "RESPONSE_EVENT_ERROR",
    Field("uint8_t", "target_system"),
    Field("uint8_t", "target_component"),
    Field("uint16_t", "sequence"),
    Field("uint16_t", "sequence_oldest_available"),
    Field("uint8_t", "reason"),
)

NEWER = (EVENT, CURRENT_EVENT_SEQUENCE, REQUEST_EVENT, RESPONSE_EVENT_ERROR)
