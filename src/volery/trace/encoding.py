"""Events as ROS 2 messages: definitions (``ros2msg`` text) and CDR bytes, both generated from the events.

A message has its numbers first, widest first, and its strings last, so that one precompiled ``struct`` packs
all numbers and every string is aligned as CDR requires (strings are 4-aligned; each is padded to 4). The
strings of events repeat, so their bytes are cached.

Encoding: OMG DDS-XTypes 1.3, plain CDR version 1, little endian (encapsulation identifier 00 01).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from operator import itemgetter
from typing import Any, NamedTuple, get_args

from volery.trace.events import Event, Omitted, Published, VehicleState

PACKAGE = "volery_msgs"
LITTLE_ENDIAN_CDR = 0x0100  # the bytes 00 01 00 00, read as a little-endian uint32

_ROS_TYPE = {"Ns": "int64", "float": "float64", "int": "int32", "bool": "bool"}
_STRUCT_CODE = {"Ns": "q", "float": "d", "int": "i", "bool": "?"}
_WIDTH = {"Ns": 8, "float": 8, "int": 4, "bool": 1}
_TIMES = (("received", "sent"), ("end", "start"), ("finished", "released"), ("at", "at"))
"""The fields for the log time and the publish time of an event."""
_SUBJECTS: dict[type[Any], tuple[str, ...]] = {VehicleState: ("vehicle",), Omitted: ("topic",)}
"""Fields of an event that decide its channel."""
_REMEMBERED = 4096  # combinations of strings per type of event; with more, they hardly repeat

OWN_EVENTS: tuple[type[Any], ...] = tuple(kind for kind in get_args(Event) if kind is not Published)
"""The events that are written as messages of ``volery_msgs``; a ``Published`` event is a message already."""


_make: Callable[[type[Any], tuple[Any, ...]], Any] = (
    tuple.__new__
)  # as the constructor of a named tuple, but faster


class EventLayout(NamedTuple):
    """Where a message has the fields of an event; fields are given by their indexes.

    Log time is the field ``log``, or ``publish`` where ``log`` is negative. The fields ``subject`` decide the
    channel. ``data`` is the field with the message's bytes; where it is -1, they are made: the ``numbers`` by
    ``codes``, the ``struct`` codes q, d, i and ?, padded to 4 bytes, then the strings ``words``.
    """

    log: int
    publish: int
    subject: tuple[int, ...]
    codes: str = ""
    numbers: tuple[int, ...] = ()
    words: tuple[int, ...] = ()
    data: int = -1


PUBLISHED = EventLayout(
    log=Published._fields.index("at"),
    publish=Published._fields.index("at"),
    subject=tuple(Published._fields.index(name) for name in ("topic", "type", "publisher")),
    data=Published._fields.index("data"),
)
"""The layout of ``Published`` events."""


def type_name(kind: type[Any]) -> str:
    """Return the message type of an event: ``volery_msgs/msg/Slice``."""
    return f"{PACKAGE}/msg/{kind.__name__}"


def fields(indexes: tuple[int, ...]) -> Callable[[Any], tuple[Any, ...]]:
    """Return the function that gets these fields of an event as a tuple."""
    if len(indexes) > 1:
        return itemgetter(*indexes)
    if not indexes:
        return lambda event: ()
    index = indexes[0]
    return lambda event: (event[index],)


def _annotation(kind: type[Any], name: str) -> str:
    """Return an annotation as it is written: ``Ns`` and ``int`` are the same type, encoded differently."""
    written = kind.__annotations__[name]
    return str(getattr(written, "__forward_arg__", written))


def _times(kind: type[Any]) -> tuple[int, int]:
    """Return the indexes of the fields for the log time and the publish time."""
    for log, publish in _TIMES:
        if log in kind._fields:
            return kind._fields.index(log), kind._fields.index(publish)
    raise TypeError(f"{kind.__name__} has no field for its time")


class EventCodec:
    """Encoder and decoder of events of one kind, with their ``layout`` and message ``definition``.

    ``encode`` returns the CDR bytes of an event.
    """

    def __init__(self, kind: type[Any]) -> None:
        annotations = [_annotation(kind, name) for name in kind._fields]
        numbers = [index for index, annotation in enumerate(annotations) if annotation in _WIDTH]
        numbers.sort(key=lambda index: -_WIDTH[annotations[index]])
        words = [index for index, annotation in enumerate(annotations) if annotation == "str"]
        order = numbers + words
        if len(order) != len(annotations):
            raise TypeError(
                f"{kind.__name__} has a field that is neither a number nor a string: {annotations}"
            )
        log, publish = _times(kind)
        self.kind = kind
        self.layout = EventLayout(
            log,
            publish,
            subject=tuple(kind._fields.index(one) for one in _SUBJECTS.get(kind, ())),
            codes="".join(_STRUCT_CODE[annotations[index]] for index in numbers),
            numbers=tuple(numbers),
            words=tuple(words),
        )
        self.definition = "".join(
            f"{_ROS_TYPE.get(annotations[index], 'string')} {kind._fields[index]}\n" for index in order
        )
        self.encode: Callable[[Any], bytes] = encoder(self.layout)
        self._head = struct.Struct(_head(self.layout))
        self._in_order = fields(tuple(order.index(index) for index in range(len(order))))
        self._strings: dict[bytes, tuple[str, ...]] = {}

    def decode(self, data: bytes) -> Any:
        """Return the event in *data*.

        Raises:
            ValueError, struct.error: there is none.
        """
        header, *numbers = self._head.unpack_from(data)
        if header != LITTLE_ENDIAN_CDR:
            raise ValueError(f"not little-endian CDR: {data[:4].hex()}")
        tail = data[self._head.size :]
        strings = self._strings.get(tail)
        if strings is None:
            if len(self._strings) >= _REMEMBERED:
                self._strings.clear()
            strings = self._strings[tail] = _decode_words(tail)
        return _make(self.kind, self._in_order((*numbers, *strings)))


def encoder(layout: EventLayout) -> Callable[[Any], bytes]:
    """Return the function that returns the CDR bytes of an event, by a layout without ``data``."""
    pack = struct.Struct(_head(layout)).pack
    numbers, words = fields(layout.numbers), fields(layout.words)
    tails: dict[tuple[str, ...], bytes] = {}

    def encode(event: Any) -> bytes:
        strings = words(event)
        tail = tails.get(strings)
        if tail is None:
            if len(tails) >= _REMEMBERED:
                tails.clear()
            tail = tails[strings] = _encode_words(strings)
        return pack(LITTLE_ENDIAN_CDR, *numbers(event)) + tail

    return encode


def _head(layout: EventLayout) -> str:
    """Return the format of the encapsulation header and the numbers, padded to 4 bytes."""
    return f"<I{layout.codes}{-struct.calcsize(f'<{layout.codes}') % 4}x"


def _encode_words(words: tuple[str, ...]) -> bytes:
    parts = []
    for word in words:
        raw = word.encode("utf-8", "replace") + b"\0"
        parts.append(struct.pack("<I", len(raw)) + raw + b"\0" * (-len(raw) % 4))
    return b"".join(parts)


def _decode_words(data: bytes) -> tuple[str, ...]:
    words = []
    at = 0
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at)
        raw = data[at + 4 : at + 4 + length]
        if len(raw) != length or raw[-1:] != b"\0":
            raise ValueError("a string is cut short")
        words.append(raw[:-1].decode())
        at += 4 + length + (-length % 4)
    return tuple(words)
