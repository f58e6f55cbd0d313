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
from typing import Any, get_args

from volery.trace.events import Event, Published

PACKAGE = "volery_msgs"
LITTLE_ENDIAN_CDR = 0x0100  # the bytes 00 01 00 00, read as a little-endian uint32

_ROS_TYPE = {"Ns": "int64", "float": "float64", "int": "int32", "bool": "bool"}
_STRUCT_CODE = {"Ns": "q", "float": "d", "int": "i", "bool": "?"}
_WIDTH = {"Ns": 8, "float": 8, "int": 4, "bool": 1}
_REMEMBERED = 4096  # combinations of strings per type of event; with more, they hardly repeat

OWN_EVENTS: tuple[type[Any], ...] = tuple(kind for kind in get_args(Event) if kind is not Published)
"""The events that are written as messages of ``volery_msgs``; a ``Published`` event is a message already."""


_make: Callable[[type[Any], tuple[Any, ...]], Any] = (
    tuple.__new__
)  # as the constructor of a named tuple, but faster


def type_name(kind: type[Any]) -> str:
    """Return the message type of an event: ``volery_msgs/msg/Slice``."""
    return f"{PACKAGE}/msg/{kind.__name__}"


def _annotation(kind: type[Any], name: str) -> str:
    """Return an annotation as it is written: ``Ns`` and ``int`` are the same type, encoded differently."""
    written = kind.__annotations__[name]
    return str(getattr(written, "__forward_arg__", written))


def _getter(indexes: tuple[int, ...]) -> Callable[[Any], tuple[Any, ...]]:
    """Return an ``itemgetter`` that returns a tuple for a single index, too."""
    if len(indexes) == 1:
        index = indexes[0]
        return lambda event: (event[index],)
    return itemgetter(*indexes)


class Codec:
    """Encoder and decoder of events of one kind.

    ``codes`` are the ``struct`` codes of the encapsulation header and the numbers, ``fixed`` their size in
    bytes; the strings follow as ``tail``, of which ``tails`` is the cache. ``numbers`` and ``words`` get the
    numbers and the strings of an event.
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
        width = sum(_WIDTH[annotations[index]] for index in numbers)
        self.kind = kind
        self.codes = "I" + "".join(_STRUCT_CODE[annotations[index]] for index in numbers) + "x" * (-width % 4)
        self.fixed = struct.calcsize(f"<{self.codes}")
        self.numbers = _getter(tuple(numbers))
        self.words = _getter(tuple(words))
        self.definition = "".join(
            f"{_ROS_TYPE.get(annotations[index], 'string')} {kind._fields[index]}\n" for index in order
        )
        self._unpack = struct.Struct(f"<{self.codes}").unpack_from
        self._in_order = _getter(tuple(order.index(index) for index in range(len(order))))
        self.tails: dict[tuple[str, ...], bytes] = {}
        self._strings: dict[bytes, tuple[str, ...]] = {}

    def tail(self, words: tuple[str, ...]) -> bytes:
        """Return the CDR bytes of the strings *words*."""
        known = self.tails.get(words)
        if known is None:
            if len(self.tails) >= _REMEMBERED:
                self.tails.clear()
            known = self.tails[words] = _encode_words(words)
        return known

    def encode(self, event: Any) -> bytes:
        """Return the CDR bytes of *event*."""
        head = struct.pack(f"<{self.codes}", LITTLE_ENDIAN_CDR, *self.numbers(event))
        return head + self.tail(self.words(event))

    def decode(self, data: bytes) -> Any:
        """Return the event in *data*.

        Raises:
            ValueError, struct.error: there is none.
        """
        header, *numbers = self._unpack(data)
        if header != LITTLE_ENDIAN_CDR:
            raise ValueError(f"not little-endian CDR: {data[:4].hex()}")
        tail = data[self.fixed :]
        strings = self._strings.get(tail)
        if strings is None:
            if len(self._strings) >= _REMEMBERED:
                self._strings.clear()
            strings = self._strings[tail] = _decode_words(tail)
        return _make(self.kind, self._in_order((*numbers, *strings)))


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
