"""Links and codecs: messages to and from one peer, as values.

Within one process frames travel as values; on a wire a codec converts them to bytes and back. This module defines the
interfaces only; the connections and the two codecs (MAVLink, pprzlink) have modules of their own.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, runtime_checkable


class Frame(NamedTuple):
    """A message: its name and fields as the protocol defines them (``HEARTBEAT``, ``custom_mode`` ...).

    ``system`` and ``component`` are the sender's ids. Fields are never changed after sending.
    """

    name: str
    fields: dict[str, Any]
    system: int
    component: int


Receiver = Callable[[Frame], None]


class Link(Protocol):
    """A two-way stream of frames. Never blocks; what arrives is handed over as house code."""

    name: str

    def send(self, frame: Frame) -> None:
        """Send, without waiting for anything. A link that is down drops it."""

    def receive(self, receiver: Receiver) -> None:
        """From now on hand every frame that arrives to *receiver*."""

    def problem(self) -> str:
        """What is wrong with the wire, in words for the user (``only text arrives: ...``); else empty."""

    def close(self) -> None:
        """Let go of sockets and threads."""


@runtime_checkable
class ByteLink(Protocol):
    """A link that is bytes on a wire, and so can carry some that are no frame: a greeting, noise."""

    def send_bytes(self, data: bytes) -> None:
        """Put *data* on the wire as it is."""


_KEPT_LINES = 20


@dataclass
class ReceiveStatistics:
    """What a parser has seen so far. ``lines`` are the last text lines that were no frame."""

    octets: int = 0
    frames: int = 0
    frames_v1: int = 0
    """Of the protocol's older version, which is understood but not spoken."""
    unknown: int = 0
    corrupt: int = 0
    text: int = 0
    garbage: int = 0
    lines: deque[str] = field(default_factory=lambda: deque(maxlen=_KEPT_LINES))


class FrameParser(Protocol):
    """A stream of bytes taken apart into frames."""

    heard: ReceiveStatistics

    def feed(self, data: bytes) -> list[Frame]:
        """The frames completed by *data*, in order. Never raises, whatever arrives."""

    def reset(self) -> None:
        """Forget a half-received frame: the connection behind it is gone."""

    def problem(self) -> str:
        """What is wrong with what arrives, in words; empty if nothing is, or if nothing arrived."""


class Codec(Protocol):
    """A protocol's wire form. Frames that cannot be written raise ``UsageError`` naming message and field."""

    @property
    def name(self) -> str:
        """``MAVLink``, ``pprzlink``: for messages to people."""

    def encode(self, frame: Frame, sequence: int) -> bytes:
        """The frame as bytes; *sequence* counts the frames of one sender, from 0, modulo 256."""

    def parser(self) -> FrameParser:
        """A new parser, for one stream of bytes."""

    def quantised(self, frame: Frame) -> Frame:
        """The frame as it arrives after a trip over the wire: widths of numbers, lengths of strings, all
        fields present.
        """


_PRINTABLE = frozenset(b"\t\r\n") | frozenset(range(0x20, 0x7F))
_LONGEST_LINE = 120


class NonFrameBytes:
    """Sorts the bytes between frames into text and garbage, and notes them in *heard*."""

    def __init__(self, heard: ReceiveStatistics) -> None:
        self._heard = heard
        self._line = bytearray()

    def note(self, octet: int) -> None:
        """A byte that belongs to no frame."""
        if octet not in _PRINTABLE:
            self._heard.garbage += 1
            return
        self._heard.text += 1
        ends = octet in b"\r\n"
        if self._line and (ends or len(self._line) >= _LONGEST_LINE):
            self._heard.lines.append(self._line.decode("ascii"))
            self._line.clear()
        if not ends:
            self._line.append(octet)

    def only_text(self) -> str:
        """``only text arrives: '...'`` if that is so; else empty."""
        if self._heard.text <= 4 * self._heard.garbage:
            return ""
        lines = [line for line in self._heard.lines if line.strip()]
        return f"only text arrives: {lines[0] if lines else self._line.decode('ascii')!r}"
