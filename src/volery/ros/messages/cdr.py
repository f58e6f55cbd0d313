"""Messages as bytes in ROS 2's encoding: CDR, little endian, with its four-byte header."""

from __future__ import annotations

import struct
from functools import cache
from typing import Any

from volery.base.errors import UsageError
from volery.ros.messages import lazy_rosbags as rosbags
from volery.ros.messages.message import Message
from volery.ros.messages.store import message_class, message_name, store

_HEADER = b"\x00\x01\x00\x00"


@cache
def _codec(name: str) -> rosbags.Msgdef[object]:
    message_class(name)
    return store().get_msgdef(name)


@cache
def _has_lists(name: str) -> bool:
    """Return whether the type contains lists or arrays, which must be converted before encoding."""
    for _, (kind, detail) in store().fielddefs[name][1]:
        if kind in (rosbags.Nodetype.ARRAY, rosbags.Nodetype.SEQUENCE):
            return True
        if kind == rosbags.Nodetype.NAME and _has_lists(str(detail)):
            return True
    return False


def to_cdr(message: Message) -> bytes:
    """Encode a message; raise ``UsageError`` if a value does not fit its field."""
    if _has_lists(message.__msgtype__):
        message = message.copy()
    return copied_to_cdr(message)


def copied_to_cdr(message: Message) -> bytes:
    """Encode a message that ``Message.copy`` has returned, without preparing it again."""
    name = message.__msgtype__
    codec = _codec(name)
    try:
        raw = bytearray(4 + codec.getsize_cdr(0, message, store()))
        raw[0:4] = _HEADER
        codec.serialize_cdr_le(memoryview(raw)[4:], 0, message, store())
    except (struct.error, rosbags.SerdeError, TypeError, ValueError, AttributeError) as error:
        raise UsageError(f"{name}: {_culprit(message)}: {error}") from error
    return bytes(raw)


def cdr_size(message: Message) -> int:
    """Return the number of bytes that ``to_cdr`` would give."""
    codec = _codec(message.__msgtype__)
    if codec.size_cdr:
        return 4 + codec.size_cdr
    return 4 + codec.getsize_cdr(0, message, store())


def _culprit(message: Message) -> str:
    """Describe the first field whose value cannot be encoded."""
    for label, (kind, detail) in store().fielddefs[message.__msgtype__][1]:
        value: Any = getattr(message, label, None)
        if kind == rosbags.Nodetype.NAME:
            if getattr(value, "__msgtype__", None) != detail and not isinstance(value, Message):
                return f"{label} is {value!r}, not a {detail}"
            deeper = _culprit(value)
            if deeper != _UNKNOWN:
                return f"{label}.{deeper}"
        elif kind == rosbags.Nodetype.BASE and not _fits(str(detail[0]), value):
            return f"{label} is {value!r}, not a {detail[0]}"
    return _UNKNOWN


_UNKNOWN = "a value does not fit its field"
_FORMATS = {
    "bool": "?", "byte": "B", "char": "B", "octet": "B", "int8": "b", "uint8": "B", "int16": "h",
    "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip


def _fits(base: str, value: Any) -> bool:
    if base == "string":
        return isinstance(value, str)
    try:
        struct.pack(f"<{_FORMATS[base]}", value)
    except (struct.error, OverflowError, TypeError, KeyError):
        return False
    return True


def from_cdr(name: str, data: bytes | memoryview) -> Any:
    """Decode a message of type `name`; raise ``UsageError`` if the bytes are no such message."""
    full = message_name(name)
    _codec(full)
    try:
        return store().deserialize_cdr(data, full)
    except rosbags.SerdeError as error:
        raise UsageError(f"these {len(data)} bytes are no {full}: {error}") from error
