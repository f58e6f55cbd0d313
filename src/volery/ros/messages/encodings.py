"""Messages as bytes: CDR of ROS 2, and the encoding, names and checksums of ROS 1.

CDR is little endian with its four-byte header. Values are those of ROS 2 in both encodings. ROS 1's
``Header`` has a ``seq`` that ROS 2 dropped: it is encoded as 0 (publishers of ROS 1 count it) and dropped
when decoded. A type whose definitions differ (``visualization_msgs/Marker``) is converted field by field;
what ROS 1's definition lacks is left out. The layouts are for code generators.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from copy import copy
from functools import cache
from hashlib import md5
from operator import attrgetter
from threading import RLock
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.ros.messages import lazy_rosbags as rosbags
from volery.ros.messages.cdr_encoder import CDR_HEADER, FORMATS, abridged, encode, encoded
from volery.ros.messages.conversion import FILLER, HEADER, Conversion
from volery.ros.messages.message import DEFAULTS, RosMessage
from volery.ros.messages.store import ROS1_SPELLING, message_class, message_name, service, service_name, store


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


def to_cdr(message: RosMessage) -> bytes:
    """Encode a message; raise ``UsageError`` if a value does not fit its field."""
    if type(message) is not message.of_graph or _has_lists(message.__msgtype__):
        message = message.copy()
    return copied_to_cdr(message)


def copied_to_cdr(message: RosMessage) -> bytes:
    """Encode a message that ``RosMessage.copy`` has returned, without preparing it again."""
    try:
        return bytes(encoded(message))
    except _MISFITS as error:
        raise _misfit(message, error) from error


def abridged_cdr(message: RosMessage) -> tuple[bytearray, int]:
    """Return what ``copied_to_cdr`` does without the content of long arrays, and how many bytes are missing.

    An array is long from ``message.LONG`` bytes on; nothing is missing of a message without one.
    """
    try:
        return abridged(message)
    except _MISFITS as error:
        raise _misfit(message, error) from error


def encoded_size(message: RosMessage) -> int:
    """Return the number of bytes of ``copied_to_cdr``; a value that does not fit raises as there."""
    try:
        data, missing = abridged(message)
    except _MISFITS as error:
        raise _misfit(message, error) from error
    return len(data) + missing


_MISFITS = (struct.error, OverflowError, TypeError, ValueError, AttributeError)
"""What encoding a value that does not fit its field raises."""


def _misfit(message: RosMessage, error: Exception) -> UsageError:
    return UsageError(f"{message.__msgtype__}: {_culprit(message)}: {error}")


@cache
def _fixed_size(name: str) -> int:
    """Return the size of the encoding of a type without strings and sequences; 0 for another type."""
    for _, (kind, detail) in store().fielddefs[name][1]:
        if kind == rosbags.Nodetype.NAME:
            varies = not _fixed_size(str(detail))
        elif kind == rosbags.Nodetype.BASE:
            varies = detail[0] == "string"
        else:
            varies = True
        if varies:
            return 0
    return len(encode(message_class(name)()))


@cache
def _varying(name: str) -> Callable[[Any], tuple[Any, ...]] | None:
    """Return what reads a message's strings and lists of numbers; None for a type with other lists."""
    paths = _varying_paths(name)
    if paths is None:
        return None
    read: Callable[[Any], Any] = attrgetter(*paths)
    return read if len(paths) > 1 else lambda message: (read(message),)


def _varying_paths(name: str, above: str = "") -> list[str] | None:
    """Return the paths of a type's strings and lists of numbers; None if it has other lists."""
    found: list[str] = []
    for label, (kind, detail) in store().fielddefs[name][1]:
        below: list[str] | None = []
        if kind == rosbags.Nodetype.NAME:
            below = _varying_paths(str(detail), f"{above}{label}.")
        elif kind != rosbags.Nodetype.BASE:
            item: Any = detail[0]  # kind and detail of an element
            numbers = item[0] == rosbags.Nodetype.BASE and item[1][0] != "string"
            below = [above + label] if numbers else None
        elif detail[0] == "string":
            below = [above + label]
        if below is None:
            return None
        found += below
    return found


_sizes: dict[tuple[str, tuple[int, ...]], int] = {}
"""Sizes of encodings by type and lengths of strings and lists: nothing else changes a size."""
_REMEMBERED = 4096
"""Sizes that are kept at most: clouds of points differ in length without end."""


def cdr_size(message: RosMessage) -> int:
    """Return the number of bytes that ``copied_to_cdr`` gives; what has a known size is not encoded."""
    name = message.__msgtype__
    fixed = _fixed_size(name)
    if fixed:
        return fixed
    read = _varying(name)
    if read is None:
        return encoded_size(message)
    lengths = [len(one.encode() if isinstance(one, str) else one) for one in read(message)]
    key = name, tuple(lengths)
    size = _sizes.get(key)
    if size is None:
        if len(_sizes) >= _REMEMBERED:
            _sizes.clear()
        size = _sizes[key] = encoded_size(message)
    return size


def _culprit(message: RosMessage) -> str:
    """Describe the first field whose value cannot be encoded."""
    for label, (kind, detail) in store().fielddefs[message.__msgtype__][1]:
        value: Any = getattr(message, label, None)
        if kind == rosbags.Nodetype.NAME:
            if getattr(value, "__msgtype__", None) != detail and not isinstance(value, RosMessage):
                return f"{label} is {value!r}, not a {detail}"
            deeper = _culprit(value)
            if deeper != _UNKNOWN:
                return f"{label}.{deeper}"
        elif kind == rosbags.Nodetype.BASE and not _fits(str(detail[0]), value):
            return f"{label} is {value!r}, not a {detail[0]}"
    return _UNKNOWN


_UNKNOWN = "a value does not fit its field"


def _fits(base: str, value: Any) -> bool:
    if base == "string":
        return isinstance(value, str)
    try:
        struct.pack(f"<{FORMATS[base]}", value)
    except (struct.error, OverflowError, TypeError, KeyError):
        return False
    return True


def _types_for(name: str, size: int) -> rosbags.Typestore:
    """Return the store that decodes a message of `size` bytes.

    rosbags repeats a nested type as often as the bytes say, 2^32 times if they are damaged; no list can have
    more elements than the message has bytes.
    """
    return bounded(store(), size) if _has_lists(name) else store()


def bounded(types: rosbags.Typestore, size: int) -> rosbags.Typestore:
    """Return a store that decodes no list of more than `size` elements."""
    made = copy(types)
    made.max_sequence_length = max(size, 1)
    return made


def from_cdr(name: str, data: bytes | memoryview, *, surplus: bool = False) -> Any:
    """Decode a message of type `name`; raise ``UsageError`` if the bytes are no such message.

    Args:
        name: Type of the message.
        data: Its bytes with their header.
        surplus: Accept bytes behind the message: rclpy's serialization leaves some where lists are empty.
    """
    full = message_name(name)
    codec = _codec(full)
    try:
        if surplus and bytes(data[:2]) == CDR_HEADER[:2]:
            body = memoryview(data)[4:]
            message, _ = codec.deserialize_cdr_le(body, 0, codec.cls, _types_for(full, len(data)))
            return message
        return _types_for(full, len(data)).deserialize_cdr(data, full)
    except (rosbags.SerdeError, struct.error, UnicodeDecodeError, ValueError) as error:
        raise UsageError(f"these {len(data)} bytes are no {full}: {error}") from error


_TIMES = {"builtin_interfaces/msg/Time": "time", "builtin_interfaces/msg/Duration": "duration"}


class Ros1Type(NamedTuple):
    """A message type in ROS 1: ``package/Name``, MD5 sum, full text, whether its first field is a header."""

    name: str
    md5: str
    text: str
    has_header: bool


class Ros1Service(NamedTuple):
    """A service type in ROS 1; ``md5`` is over request and response."""

    name: str
    md5: str
    request: Ros1Type
    response: Ros1Type


@cache
def _noetic() -> rosbags.Typestore:
    """Return the definitions of ROS 1 Noetic; types that it lacks are added on demand."""
    return rosbags.get_typestore(rosbags.Stores.ROS1_NOETIC)


_registering = RLock()
"""A store of rosbags takes types of one thread at a time; on a real graph each task is a thread."""


def definition_store(full: str) -> rosbags.Typestore:
    """Return Noetic's store with type `full`; a type that Noetic lacks has the fields of ROS 2 there."""
    ours, noetic = store(), _noetic()
    with _registering:
        if full not in noetic.fielddefs:
            for _, what in ours.fielddefs[full][1]:
                inner = _nested(what)
                if inner and inner not in _TIMES:
                    definition_store(inner)
            noetic.register({full: ours.fielddefs[full]})
    return noetic


@cache
def _to_noetic(full: str) -> Conversion:
    noetic = definition_store(full)
    return Conversion(store(), noetic, full, noetic.types.__getitem__)


@cache
def _from_noetic(full: str) -> Conversion:
    return Conversion(definition_store(full), store(), full, message_class)


def _nested(what: Any) -> str:
    kind, detail = what
    if kind in (rosbags.Nodetype.ARRAY, rosbags.Nodetype.SEQUENCE):
        return _nested(detail[0])
    return str(detail) if kind == rosbags.Nodetype.NAME else ""


def ros1_name(name: str) -> str:
    """Return a type's name in ROS 1: ``std_msgs/String`` for ``std_msgs/msg/String``; services likewise."""
    package, _, label = name.replace("/msg/", "/").replace("/srv/", "/").partition("/")
    for theirs, ours in ROS1_SPELLING.get(package, {}).items():
        if label == ours:
            return f"{package}/{theirs}"
    return f"{package}/{label}"


def our_name(name: str) -> str:
    """Return the full name of a type of ROS 1, known or not: ``std_msgs/msg/String``."""
    package, _, label = name.partition("/")
    return f"{package}/msg/{ROS1_SPELLING.get(package, {}).get(label, label)}" if label else name


@cache
def ros1_type(name: str) -> Ros1Type:
    """Return a message type in ROS 1; ``UsageError`` if it is unknown."""
    full = message_name(name)
    text, checksum = definition_store(full).generate_msgdef(full, ros_version=1)
    fields = store().fielddefs[full][1]
    return Ros1Type(ros1_name(full), checksum, text, bool(fields) and fields[0][1][1] == HEADER)


@cache
def ros1_service(name: str) -> Ros1Service:
    """Return a service type in ROS 1; ``UsageError`` if it is unknown."""
    kind = service(service_name(name))
    label = ros1_name(kind.name)
    halves = []
    for end, cls in (("Request", kind.request), ("Response", kind.response)):
        halves.append(ros1_type(cls.__msgtype__)._replace(name=f"{label}{end}"))
    texts = _hashed(kind.request.__msgtype__) + _hashed(kind.response.__msgtype__)
    return Ros1Service(label, md5(texts.encode(), usedforsecurity=False).hexdigest(), *halves)


def _hashed(full: str) -> str:
    """Return the text whose MD5 sum is the type's: constants, then fields, nested types as their sums."""
    noetic = definition_store(full)
    constants, fields = noetic.fielddefs[full]
    lines = [f"{kind} {name}={value}" for name, kind, value in constants]
    for name, what in fields:
        if name != "structure_needs_at_least_one_member":
            lines.append(f"{_hashed_type(what)} {name}")
    return "\n".join(lines)


def _hashed_type(what: Any) -> str:
    kind, detail = what
    if kind == rosbags.Nodetype.BASE:
        return str(detail[0])
    if kind == rosbags.Nodetype.NAME:
        return _TIMES.get(detail) or ros1_type(detail).md5
    inner, count = detail
    if inner[0] == rosbags.Nodetype.NAME and inner[1] not in _TIMES:
        return _hashed_type(inner)  # sums carry no brackets
    return f"{_hashed_type(inner)}[{count if kind == rosbags.Nodetype.ARRAY else ''}]"


def to_ros1(message: RosMessage) -> bytes:
    """Encode a message for ROS 1; raise ``UsageError`` if a value does not fit its field."""
    return cdr_to_ros1(message.__msgtype__, to_cdr(message))


def cdr_to_ros1(name: str, data: bytes) -> bytes:
    """Convert CDR bytes of type `name` to ROS 1's."""
    convert = _to_noetic(name)
    if convert.same_bytes:
        return bytes(store().cdr_to_ros1(data, name))
    return bytes(definition_store(name).serialize_ros1(convert(from_cdr(name, data)), name))


def ros1_to_cdr(full: str, data: bytes | memoryview) -> bytes:
    """Convert ROS 1 bytes with the fields of our type `full` to CDR's; ``SerdeError`` if they are none."""
    message_class(full)  # before rosbags compiles its own class into the decoder
    return bytes(_types_for(full, len(data)).ros1_to_cdr(data, full))


def from_ros1(name: str, data: bytes | memoryview) -> Any:
    """Decode ROS 1 bytes as a message of type `name`; raise ``UsageError`` if they are no such message."""
    full = message_name(name)
    convert = _from_noetic(full)
    try:
        if convert.same_bytes:
            return from_cdr(full, ros1_to_cdr(full, data))
        return convert(bounded(definition_store(full), len(data)).deserialize_ros1(data, full))
    except (rosbags.SerdeError, IndexError) as error:
        raise UsageError(f"these {len(data)} bytes are no {full} of ROS 1: {error}") from error


class FieldLayout(NamedTuple):
    """A field: exactly one of ``base`` (a number, bool or string) and ``nested`` (a type's name) is given.

    ``length`` is ``None`` for a single value, 0 for a sequence, else the length of an array. ``carried`` is
    False for what ROS 1 has and the encoding has not: a header's ``seq``. ``default`` is what the definition
    states, or None.
    """

    name: str
    base: str = ""
    nested: str = ""
    length: int | None = None
    carried: bool = True
    default: Any = None


class Constant(NamedTuple):
    """A constant of a type."""

    name: str
    base: str
    value: Any


class MessageLayout(NamedTuple):
    """A message type: full name (``package/msg/Name``), ROS 1 name (``package/Name``), and its parts."""

    name: str
    label: str
    constants: tuple[Constant, ...]
    fields: tuple[FieldLayout, ...]


def ros1_layout(name: str) -> MessageLayout:
    """Return a message type's layout in ROS 1, or ours where it differs; ``UsageError`` if it is unknown."""
    full = message_name(name)
    message_class(full)
    return _layout(full, definition_store(full) if _to_noetic(full).same_bytes else store())


def ros2_layout(name: str) -> MessageLayout:
    """Return a message type's layout in ROS 2; ``UsageError`` if it is unknown."""
    full = message_name(name)
    message_class(full)
    found = _layout(full, store())
    fields = tuple(field._replace(default=DEFAULTS.get((full, field.name))) for field in found.fields)
    return found._replace(fields=fields)


def _layout(full: str, of: rosbags.Typestore) -> MessageLayout:
    constants, fields = of.fielddefs[full]
    return MessageLayout(
        full,
        ros1_name(full),
        tuple(Constant(label, base, value) for label, base, value in constants),
        tuple(_field(full, label, what) for label, what in fields if label != FILLER),
    )


def _field(owner: str, name: str, what: Any) -> FieldLayout:
    kind, detail = what
    if kind in (rosbags.Nodetype.ARRAY, rosbags.Nodetype.SEQUENCE):
        inner, count = detail
        return _field(owner, name, inner)._replace(length=count if kind == rosbags.Nodetype.ARRAY else 0)
    if kind == rosbags.Nodetype.NAME:
        return FieldLayout(name, nested=str(detail))
    return FieldLayout(name, base=str(detail[0]), carried=(owner, name) != (HEADER, "seq"))
