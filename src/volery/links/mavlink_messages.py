"""MAVLink message definitions, and conventions above single messages that both ends of a link implement.

The dialect is ``ardupilotmega``, which includes ``common``. Definitions are pymavlink's, plus the few
messages that pymavlink does not have yet. Payloads are packed from the definitions directly, because
pymavlink's message objects cost three times as much. Arrays are tuples of numbers; ``char[]`` fields are
``str``. A field that is not given is zero or empty, as the protocol prescribes for fields that an older
sender does not know.

Conventions: status texts longer than 50 characters are sent in chunks; some firmwares send integer parameters
as the bytes of a float; telemetry streams have a period per message.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from operator import itemgetter
from typing import Any, NamedTuple

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import ardupilotmega as dialect

from volery.base.errors import UsageError, did_you_mean
from volery.base.time import Ns
from volery.kernel.api import Handle, Kernel

# -- messages that pymavlink lacks

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
    "char": "s",
}


class FieldDefinition(NamedTuple):
    """One field of a message definition. ``length`` is 0 for a single value, else the array length."""

    type: str
    name: str
    length: int = 0


class MessageDefinition:
    """A message definition with the attributes of pymavlink's that ``MavlinkMessageType`` reads.

    Field order on the wire and the extra byte of the checksum follow from names and types by MAVLink's rules
    (https://mavlink.io/en/guide/serialization.html): larger types first, otherwise in the order given; the
    extra byte is the folded checksum over names and types. Extension fields are not supported.
    """

    def __init__(self, number: int, name: str, *fields: FieldDefinition) -> None:
        self.id = number
        self.msgname = name
        self.fieldnames = [field.name for field in fields]
        self.fieldtypes = [field.type for field in fields]
        # The sort is stable: fields of equal size keep their order.
        ordered = sorted(fields, key=lambda field: struct.calcsize("<" + _CODES[field.type]), reverse=True)
        self.ordered_fieldnames = [field.name for field in ordered]
        self.array_lengths = [field.length for field in ordered]
        self.unpacker = struct.Struct(
            "<" + "".join(f"{field.length or ''}{_CODES[field.type]}" for field in ordered)
        )
        self.crc_extra = _crc_extra(name, ordered)


def _crc_extra(name: str, ordered: list[FieldDefinition]) -> int:
    text = f"{name} ".encode()
    for field in ordered:
        text += f"{field.type} {field.name} ".encode()
        text += bytes([field.length]) if field.length else b""
    checksum: int = mcrf4xx(text)
    return (checksum & 0xFF) ^ (checksum >> 8)


NEWER_MESSAGES = (
    MessageDefinition(
        397,
        "COMPONENT_METADATA",
        FieldDefinition("uint32_t", "time_boot_ms"),
        FieldDefinition("uint32_t", "file_crc"),
        FieldDefinition("char", "uri", 100),
    ),
    MessageDefinition(
        410,
        "EVENT",
        FieldDefinition("uint8_t", "destination_component"),
        FieldDefinition("uint8_t", "destination_system"),
        FieldDefinition("uint32_t", "id"),
        FieldDefinition("uint32_t", "event_time_boot_ms"),
        FieldDefinition("uint16_t", "sequence"),
        FieldDefinition("uint8_t", "log_levels"),
        FieldDefinition("uint8_t", "arguments", 40),
    ),
    MessageDefinition(
        411,
        "CURRENT_EVENT_SEQUENCE",
        FieldDefinition("uint16_t", "sequence"),
        FieldDefinition("uint8_t", "flags"),
    ),
    MessageDefinition(
        412,
        "REQUEST_EVENT",
        FieldDefinition("uint8_t", "target_system"),
        FieldDefinition("uint8_t", "target_component"),
        FieldDefinition("uint16_t", "first_sequence"),
        FieldDefinition("uint16_t", "last_sequence"),
    ),
    MessageDefinition(
        413,
        "RESPONSE_EVENT_ERROR",
        FieldDefinition("uint8_t", "target_system"),
        FieldDefinition("uint8_t", "target_component"),
        FieldDefinition("uint16_t", "sequence"),
        FieldDefinition("uint16_t", "sequence_oldest_available"),
        FieldDefinition("uint8_t", "reason"),
    ),
    MessageDefinition(
        435,
        "AVAILABLE_MODES",
        FieldDefinition("uint8_t", "number_modes"),
        FieldDefinition("uint8_t", "mode_index"),
        FieldDefinition("uint8_t", "standard_mode"),
        FieldDefinition("uint32_t", "custom_mode"),
        FieldDefinition("uint32_t", "properties"),
        FieldDefinition("char", "mode_name", 35),
    ),
    MessageDefinition(
        436,
        "CURRENT_MODE",
        FieldDefinition("uint8_t", "standard_mode"),
        FieldDefinition("uint32_t", "custom_mode"),
        FieldDefinition("uint32_t", "intended_custom_mode"),
    ),
)
"""Messages of MAVLink's ``common`` dialect that pymavlink does not define yet."""

NEWER_FIELDS: Mapping[str, tuple[FieldDefinition, ...]] = {
    "MISSION_ACK": (FieldDefinition("uint32_t", "opaque_id"),),
    "MISSION_COUNT": (FieldDefinition("uint32_t", "opaque_id"),),
    "MISSION_CURRENT": (
        FieldDefinition("uint32_t", "mission_id"),
        FieldDefinition("uint32_t", "fence_id"),
        FieldDefinition("uint32_t", "rally_points_id"),
    ),
}
"""Extension fields, single values, that pymavlink's definition of a message does not have yet."""


# -- message types


class _Field(NamedTuple):
    name: str
    length: int  # 0 for a single value, else the array length
    text: bool


def _dict_maker(names: tuple[str, ...]) -> Callable[..., dict[str, Any]]:
    """Return a function that makes a dictionary of its arguments, with *names* as keys.

    The generated code is twice as fast as ``zip``. Arguments are numbered because a field name may be a
    Python keyword.
    """
    arguments = [f"value_{number}" for number in range(len(names))]
    items = ", ".join(f"{name!r}: {value}" for name, value in zip(names, arguments, strict=True))
    made: Callable[..., dict[str, Any]] = eval(f"lambda {', '.join(arguments)}: {{{items}}}", {})
    return made


class MavlinkMessageType:
    """One message of the dialect: its id and the layout of its payload.

    ``size`` is the payload length in bytes before trailing zeros are cut off.
    """

    def __init__(self, definition: Any) -> None:
        self.name: str = definition.msgname
        self.id: int = definition.id
        known = set(definition.fieldnames)
        newer = [field for field in NEWER_FIELDS.get(self.name, ()) if field.name not in known]
        self.field_names: tuple[str, ...] = (*definition.fieldnames, *(field.name for field in newer))
        self._extra = bytes([definition.crc_extra])
        codes = "".join(_CODES[field.type] for field in newer)
        self._struct: struct.Struct = struct.Struct(definition.unpacker.format + codes)
        self.size: int = self._struct.size
        types = dict(zip(definition.fieldnames, definition.fieldtypes, strict=True))
        types |= {field.name: field.type for field in newer}
        self._fields = tuple(
            _Field(name, length, types[name] == "char")
            for name, length in (
                *zip(definition.ordered_fieldnames, definition.array_lengths, strict=True),
                *((field.name, 0) for field in newer),
            )
        )
        self._names = tuple(field.name for field in self._fields)
        self._known = frozenset(self._names)
        self._plain = all(field.length == 0 for field in self._fields)
        self._whole = self._plain and not any("float" in kind or "double" in kind for kind in types.values())
        several = self._plain and len(self._names) > 1
        self._values: Callable[[Any], tuple[Any, ...]] | None = itemgetter(*self._names) if several else None
        self._make_dict: Callable[..., dict[str, Any]] | None = None  # made when the first one is decoded

    def pack(self, fields: Mapping[str, Any]) -> bytes:
        """Return the whole payload.

        Raises:
            UsageError: A field does not exist or does not fit; the error names it.
        """
        if self._values is not None and len(fields) == len(self._names):
            try:
                return self._struct.pack(*self._values(fields))
            except (KeyError, struct.error, OverflowError, TypeError):
                pass  # the field is found below
        if not self._known.issuperset(fields):
            wrong = next(name for name in fields if name not in self._known)
            hint = did_you_mean(wrong, self.field_names)
            listed = ", ".join(self.field_names)
            raise UsageError(f"{self.name} has no field {wrong!r}{hint}; it has {listed}")
        try:
            if self._plain:
                return self._struct.pack(*[fields.get(name, 0) for name in self._names])
            return self._struct.pack(*self._flat_values(fields))
        except (struct.error, OverflowError, TypeError, ValueError) as error:
            raise UsageError(f"{self.name}: a field does not fit ({error}): {dict(fields)}") from None

    def quantised(self, fields: dict[str, Any]) -> dict[str, Any]:
        """Return *fields* as they are after packing and unpacking; the same object where nothing changes.

        Raises:
            UsageError: A field does not exist or does not fit; the error names it.
        """
        payload = self.pack(fields)
        if (
            self._whole
            and len(fields) == len(self._names)
            and all(type(field) is int for field in fields.values())
        ):
            return fields
        return self.unpack(payload)

    def _flat_values(self, fields: Mapping[str, Any]) -> list[Any]:
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

    def unpack(self, payload: bytes) -> dict[str, Any]:
        """Return the fields of *payload*.

        The payload may be shorter than ``size`` (trailing zeros were cut off) or longer (a newer sender).
        """
        if len(payload) != self.size:
            payload = payload[: self.size].ljust(self.size, b"\0")
        values = self._struct.unpack(payload)
        if self._plain:
            if self._make_dict is None:
                self._make_dict = _dict_maker(self._names)
            return self._make_dict(*values)
        fields: dict[str, Any] = {}
        at = 0
        for field in self._fields:
            if field.text:
                fields[field.name] = values[at].split(b"\0", 1)[0].decode(errors="replace")
                at += 1
            elif field.length == 0:
                fields[field.name] = values[at]
                at += 1
            else:
                fields[field.name] = values[at : at + field.length]
                at += field.length
        return fields

    def checksum(self, covered: bytes) -> int:
        """Return the CRC-16/MCRF4XX over *covered* (all after STX) and the extra byte of this message."""
        crc: int = mcrf4xx(covered + self._extra)
        return crc


_TYPES = {
    definition.id: MavlinkMessageType(definition)
    for definition in (*NEWER_MESSAGES, *dialect.mavlink_map.values())
}
_BY_NAME = {kind.name: kind for kind in _TYPES.values()}


def message_type(name: str) -> MavlinkMessageType:
    """Return the message type called *name*; raise ``UsageError`` if the dialect has none."""
    kind = _BY_NAME.get(name)
    if kind is None:
        raise UsageError(f"MAVLink has no message {name!r}{did_you_mean(name, _BY_NAME)}")
    return kind


def message_type_of(number: int) -> MavlinkMessageType | None:
    """Return the message type with id *number*, or None if the dialect has none."""
    return _TYPES.get(number)


# -- enumerations


@cache
def constant(name: str) -> int:
    """Return the value of an enumeration entry such as ``MAV_CMD_NAV_TAKEOFF``."""
    value = getattr(dialect, name, None)
    if not isinstance(value, int):
        raise UsageError(f"MAVLink has no constant {name!r}")
    return value


_LIST_OF = {
    constant(f"MAV_CMD_NAV_{name}"): constant(f"MAV_MISSION_TYPE_{kind}")
    for name, kind in (
        ("FENCE_RETURN_POINT", "FENCE"),
        ("FENCE_POLYGON_VERTEX_INCLUSION", "FENCE"),
        ("FENCE_POLYGON_VERTEX_EXCLUSION", "FENCE"),
        ("FENCE_CIRCLE_INCLUSION", "FENCE"),
        ("FENCE_CIRCLE_EXCLUSION", "FENCE"),
        ("RALLY_POINT", "RALLY"),
    )
}


def mission_type(fields: Mapping[str, Any]) -> int:
    """Return the MAV_MISSION_TYPE of a message of a plan.

    PX4 1.14 sends the items of its fence and its rally points without it: they are recognised by their
    command.
    """
    stated: int = fields.get("mission_type", 0)
    return stated or _LIST_OF.get(fields.get("command", 0), 0)


@cache
def entry_name(enumeration: str, value: int) -> str:
    """Return the name of *value* without the prefix: ``entry_name("MAV_RESULT", 4)`` is ``FAILED``.

    An unknown value is returned as its digits. Raises ``UsageError`` for an unknown enumeration.
    """
    entries = dialect.enums.get(enumeration)
    if entries is None:
        hint = did_you_mean(enumeration, dialect.enums)
        raise UsageError(f"MAVLink has no enumeration {enumeration!r}{hint}")
    entry = entries.get(value)
    if entry is None:
        return str(value)
    return str(entry.name).removeprefix(f"{enumeration}_")


# -- status texts

CHUNK = 50

OnText = Callable[[int, str], None]
"""Called with severity and text."""


def status_text_chunks(severity: int, text: str, number: int) -> list[dict[str, Any]]:
    """Return the fields of the STATUSTEXT messages that carry *text*.

    Args:
        severity: MAV_SEVERITY.
        text: Text of any length.
        number: Id that distinguishes the chunks of this text from those of others; 0 for a single chunk.
    """
    return [
        {"severity": severity, "text": text[start : start + CHUNK], "id": number, "chunk_seq": sequence}
        for sequence, start in enumerate(range(0, max(1, len(text)), CHUNK))
    ]


class StatusTextAssembler:
    """Joins chunks to texts. A text whose last chunk is lost is reported when the next text begins."""

    def __init__(self, on_text: OnText) -> None:
        self._on_text = on_text
        self._number = 0
        self._severity = 0
        self._parts: dict[int, str] = {}

    def add(self, fields: Mapping[str, Any]) -> None:
        """Add a STATUSTEXT. Its ``id`` is 0 for a whole text; the chunks of one text share another id."""
        number: int = fields["id"]
        if self._parts and number != self._number:
            self._report()
        if number == 0:
            self._on_text(fields["severity"], fields["text"])
            return
        self._number = number
        self._severity = fields["severity"]
        self._parts[fields["chunk_seq"]] = fields["text"]
        if len(fields["text"]) < CHUNK:
            self._report()

    def _report(self) -> None:
        parts = self._parts
        text = "".join(parts.get(number, " ... ") for number in range(max(parts) + 1))
        self._parts = {}
        self._on_text(self._severity, text)


# -- parameter values

REAL32 = 9
"""MAV_PARAM_TYPE."""

_REAL, _SIGNED, _UNSIGNED = struct.Struct("<f"), struct.Struct("<i"), struct.Struct("<I")


def to_bytewise(kind: int, value: float) -> float:
    """Return a parameter value in MAVLink's "bytewise" encoding, which PX4 uses.

    The result is the float whose bytes are those of the integer. ArduPilot sends the number itself instead.

    Args:
        kind: MAV_PARAM_TYPE; a value of type REAL32 is returned unchanged.
        value: The number.
    """
    if kind == REAL32:
        return value
    number: float = _REAL.unpack(_UNSIGNED.pack(int(value) & 0xFFFF_FFFF))[0]
    return number


def from_bytewise(kind: int, value: float) -> float:
    """Return the number that ``to_bytewise`` encoded."""
    if kind == REAL32:
        return value
    return float(_SIGNED.unpack(_REAL.pack(value))[0])


# -- telemetry streams

Burst = Callable[[Sequence[str]], None]
"""Sends the named messages, in that order."""


class MessageStreams:
    """Telemetry streams of one link: a period for each message; messages of one period are sent in one burst.

    Requests are stored while the autopilot boots; nothing is sent before ``start``. A burst that the receiver
    uses nothing of is suspended, until ``resume`` finds that it does.

    Args:
        kernel: Clock of the streams.
        order: Names of messages in their order within a burst.
        burst: Sends the messages of one burst.
        wanted: Returns whether the receiver uses a message; ``None``: all.
        least: Shortest period in ns.
    """

    def __init__(
        self,
        kernel: Kernel,
        order: Sequence[str],
        burst: Burst,
        *,
        wanted: Callable[[str], bool] | None = None,
        least: Ns = 1,
    ) -> None:
        self._kernel = kernel
        self._least = least
        self._rank = {name: rank for rank, name in enumerate(order)}
        self._burst = burst
        self._wanted = wanted
        self._periods: dict[str, Ns] = {}
        self._names: dict[Ns, tuple[str, ...]] = {}
        self._used: dict[Ns, Sequence[str]] = {}
        """What the receiver uses of each burst, as it was found last."""
        self._handles: dict[Ns, Handle] = {}
        self._suspended: dict[Ns, Ns] = {}
        """Period of each suspended burst, and when it was sent first."""
        self._started = False

    def period(self, name: str) -> Ns:
        """Return the period of a message in ns; 0 if it is not streamed."""
        return self._periods.get(name, 0)

    def set(self, names: Sequence[str], period: Ns) -> None:
        """Stream messages with a new period; the first burst is sent one period from now.

        Args:
            names: Names of the messages.
            period: Period in ns; 0 stops the messages.
        """
        for name in names:
            self._periods.pop(name, None)
            if period > 0:
                self._periods[name] = max(period, self._least)
        self._regroup()

    def start(self) -> None:
        """Start the requested streams, because the autopilot has booted."""
        self._started = True
        self._regroup()

    def stop(self) -> None:
        """Stop all streams and forget the requests."""
        self._started = False
        self._periods.clear()
        self._regroup()

    def _regroup(self) -> None:
        groups: dict[Ns, list[str]] = {}
        for name, period in self._periods.items():
            groups.setdefault(period, []).append(name)
        last = len(self._rank)
        self._names = {
            period: tuple(sorted(names, key=lambda name: self._rank.get(name, last)))
            for period, names in groups.items()
        }
        for period in [period for period in self._handles if period not in groups]:
            self._handles.pop(period).cancel()
            self._suspended.pop(period, None)
        if self._started:
            for period in groups:
                if period not in self._handles:
                    self._start_group(period)
        self.resume()

    def _start_group(self, period: Ns) -> None:
        first = self._kernel.now()

        def due() -> None:
            if self._kernel.now() > first:
                self._send(period, first)

        self._handles[period] = self._kernel.every(period, due)

    def _send(self, period: Ns, first: Ns) -> None:
        """Send what the receiver uses of a burst; suspend the burst if that is nothing."""
        names = self._used[period]
        if names:
            self._burst(names)
        else:
            self._handles[period].cancel()
            self._suspended[period] = first

    def resume(self) -> None:
        """Find out what the receiver uses now, and resume, in phase, the bursts of which it is something."""
        wanted = self._wanted
        if wanted is None:
            self._used.update(self._names)
            return
        for period, names in self._names.items():
            self._used[period] = [name for name in names if wanted(name)]
        for period in [period for period in self._suspended if self._used[period]]:
            self._resume_group(period, self._suspended.pop(period))

    def _resume_group(self, period: Ns, first: Ns) -> None:
        now = self._kernel.now()

        def begin() -> None:
            self._handles[period] = self._kernel.every(period, lambda: self._send(period, first))

        self._handles[period] = self._kernel.call_at(now + period - (now - first) % period, begin)


# -- x and y of mission items

GLOBAL_FRAMES = frozenset({0, 3, 5, 6, 10, 11})
"""MAV_FRAMEs with latitude and longitude."""
_NO_PLACE_FRAME = 2
"""MAV_FRAME_MISSION."""
_PER_DEGREE, _PER_METRE = 10_000_000, 10_000


@cache
def item_scale(command: int, frame: int) -> int:
    """Return the units of x and y of a MISSION_ITEM_INT per unit of parameters 5 and 6.

    Latitude and longitude are sent in 1e-7 degrees, local coordinates in 1e-4 m. A command without a place,
    by ``hasLocation`` of MAVLink's definitions, or in MAV_FRAME_MISSION has other parameters there, which are
    sent as they are. A command that the definitions do not have counts as one with a place.
    """
    entry = dialect.enums["MAV_CMD"].get(command)
    if frame == _NO_PLACE_FRAME or (entry is not None and not getattr(entry, "has_location", True)):
        return 1
    return _PER_DEGREE if frame in GLOBAL_FRAMES else _PER_METRE


def has_global_place(command: int, frame: int) -> bool:
    """Return whether parameters 5 and 6 of an item are latitude and longitude."""
    return item_scale(command, frame) == _PER_DEGREE
