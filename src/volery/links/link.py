"""Interfaces of links and codecs, and the statistics that a frame parser keeps.

Within one process frames travel as values; on a wire a codec converts them to bytes and back. The connections
and the two codecs (MAVLink, pprzlink) have modules of their own.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from volery.links.frame import Frame

_KEPT_LINES = 20
_PRINTABLE = frozenset(b"\t\r\n") | frozenset(range(0x20, 0x7F))
_LONGEST_LINE = 120


Receiver = Callable[[Frame], None]


class Link(Protocol):
    """A two-way stream of frames. No method blocks; receivers are called as framework callbacks."""

    name: str

    def send(self, frame: Frame) -> None:
        """Send *frame* without waiting. A link that is down drops the frame."""

    def receive(self, receiver: Receiver) -> None:
        """Call *receiver* with every frame that arrives from now on."""

    def problem(self) -> str:
        """Return what is wrong with the connection, for the user (``only text arrives: ...``), or ``""``."""

    def close(self) -> None:
        """Release sockets and threads."""


@runtime_checkable
class ByteLink(Protocol):
    """A link over bytes, which can also carry bytes that are no frame: a greeting, noise."""

    def send_bytes(self, data: bytes) -> None:
        """Send *data* as it is."""


@runtime_checkable
class FillingLink(Protocol):
    """A link that fills up while the other side reads more slowly than this one sends."""

    def has_room(self) -> bool:
        """Return whether more can be sent now; else a sender of long answers waits, or frames are dropped."""


@runtime_checkable
class SelectiveLink(Protocol):
    """A link whose receiver states which messages it uses, so that the sender need not make the others.

    It spares a simulation the telemetry that is not read. A sender may still send what is not wanted.
    """

    def select(self, wanted: Callable[[str], bool]) -> None:
        """State which messages this end uses, by name.

        The sender calls the function each time it has received a frame: what an end uses changes with what it
        requests.
        """

    def is_wanted(self, name: str) -> bool:
        """Return whether the other end uses the message called *name*."""


# -- codecs


@dataclass
class ReceiveStatistics:
    """Counts of what a parser has received. ``lines`` holds the last text lines that were no frame."""

    octets: int = 0
    frames: int = 0
    frames_v1: int = 0
    """Frames of the older protocol version, which is decoded but never sent."""
    unknown: int = 0
    refused: int = 0
    """Frames whose signature is missing, wrong or replayed, on a signed link."""
    signed: int = 0
    """Signed frames on a link without a key; their sender ignores what is not signed."""
    corrupt: int = 0
    text: int = 0
    garbage: int = 0
    lines: deque[str] = field(default_factory=lambda: deque(maxlen=_KEPT_LINES))


class FrameParser(Protocol):
    """Splits a stream of bytes into frames."""

    statistics: ReceiveStatistics

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames completed by *data*, in order. Never raises, whatever *data* contains."""

    def reset(self) -> None:
        """Drop a half-received frame, because the connection has broken."""

    def problem(self) -> str:
        """Return what is wrong with the received bytes; ``""`` if nothing is, or if nothing was received."""


class WireFormat(Protocol):
    """Wire format of one protocol."""

    @property
    def name(self) -> str:
        """Name of the protocol for messages to the user: ``MAVLink``, ``pprzlink``."""

    def encode(self, frame: Frame, sequence: int) -> bytes:
        """Return *frame* as bytes.

        Args:
            frame: The message to encode.
            sequence: Number of frames that this sender has sent before, modulo 256.

        Raises:
            UsageError: A field does not exist or does not fit; the error names message and field.
        """

    def parser(self) -> FrameParser:
        """Return a new parser for one stream of bytes."""

    def quantised(self, frame: Frame) -> Frame:
        """Return *frame* as it arrives after encoding and decoding.

        Floats have wire precision, strings are cut to their field, and all fields are present.
        """


class NonFrameBytes:
    """Sorts the bytes between frames into text and garbage and counts them in *statistics*."""

    def __init__(self, statistics: ReceiveStatistics) -> None:
        self._statistics = statistics
        self._line = bytearray()

    def add(self, octet: int) -> None:
        """Record one byte that belongs to no frame."""
        if octet not in _PRINTABLE:
            self._statistics.garbage += 1
            return
        self._statistics.text += 1
        ends = octet in b"\r\n"
        if self._line and (ends or len(self._line) >= _LONGEST_LINE):
            self._statistics.lines.append(self._line.decode("ascii"))
            self._line.clear()
        if not ends:
            self._line.append(octet)

    def only_text(self) -> str:
        """Return ``only text arrives: '...'`` if at least 80 % of the bytes are text, else ``""``."""
        if self._statistics.text <= 4 * self._statistics.garbage:
            return ""
        lines = [line for line in self._statistics.lines if line.strip()]
        return f"only text arrives: {lines[0] if lines else self._line.decode('ascii')!r}"
