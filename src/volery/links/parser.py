"""A stream of bytes taken apart into frames. Tolerant: real links carry boot texts, noise and other
protocols.

What is not MAVLink 2 is skipped, counted and kept as evidence, so that ``problem`` can say in words what
does arrive.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from volery.links.link import Frame
from volery.links.mavlink import (
    CHECKSUM,
    HEADER,
    HEADER_V1,
    SIGNATURE_LENGTH,
    SIGNED,
    STX,
    STX_V1,
    message_type_of,
)

_PRINTABLE = frozenset(b"\t\r\n") | frozenset(range(0x20, 0x7F))
_KEPT_LINES = 20
_LONGEST_LINE = 120


@dataclass
class Heard:
    """What a parser has seen so far. ``lines`` are the last text lines that were no MAVLink."""

    octets: int = 0
    frames: int = 0
    frames_v1: int = 0
    unknown: int = 0
    corrupt: int = 0
    text: int = 0
    garbage: int = 0
    lines: deque[str] = field(default_factory=lambda: deque(maxlen=_KEPT_LINES))


class Parser:
    """Feed it bytes in any portions; it returns the frames that they complete."""

    def __init__(self) -> None:
        self.heard = Heard()
        self._buffer = bytearray()
        self._line = bytearray()

    def feed(self, data: bytes) -> list[Frame]:
        """The frames completed by *data*, in order; MAVLink 1 frames among them. Never raises."""
        self.heard.octets += len(data)
        self._buffer += data
        frames: list[Frame] = []
        while self._buffer:
            self._skip(self._before_start())
            if not self._buffer:
                break
            length = self._frame_length()
            if length == 0:
                self._skip(1)
            elif length > len(self._buffer):
                break
            else:
                self._take(length, frames)
        return frames

    def reset(self) -> None:
        """Forget a half-received frame: the connection behind it is gone."""
        self._buffer.clear()

    def problem(self) -> str:
        """What is wrong with what arrives, in words; empty if MAVLink 2 does, or nothing at all."""
        heard = self.heard
        if heard.frames or not heard.octets:
            return ""
        if heard.frames_v1:
            return "MAVLink 1 only: set SERIALx_PROTOCOL=2 (ArduPilot) or MAV_PROTO_VER=2 (PX4) for this port"
        if heard.unknown or heard.corrupt:
            return (
                f"MAVLink-like frames arrive, but none is whole or known ({heard.corrupt} corrupt, "
                f"{heard.unknown} of unknown kind): noise, or another dialect"
            )
        if heard.text > 4 * heard.garbage:
            return f"only text arrives: {self._sample()!r}"
        return f"{heard.octets} bytes arrive but no MAVLink: another protocol, or the wrong baud rate"

    def _sample(self) -> str:
        lines = [line for line in self.heard.lines if line.strip()]
        return lines[0] if lines else self._line.decode("ascii", errors="replace")[:_LONGEST_LINE]

    def _before_start(self) -> int:
        starts = [at for at in (self._buffer.find(STX), self._buffer.find(STX_V1)) if at >= 0]
        return min(starts, default=len(self._buffer))

    def _frame_length(self) -> int:
        """Bytes of the frame that seems to start here; 0 if none does; more than there are if unknown yet."""
        buffer = self._buffer
        if buffer[0] == STX_V1:
            return self._frame_length_v1()
        if len(buffer) < HEADER.size:
            return len(buffer) + 1
        payload, incompatible = buffer[1], buffer[2]
        kind = message_type_of(_sender(buffer, old=False)[2])
        if incompatible & ~SIGNED or (kind is not None and payload > kind.size):
            return 0
        signature = SIGNATURE_LENGTH if incompatible & SIGNED else 0
        return HEADER.size + payload + CHECKSUM.size + signature

    def _frame_length_v1(self) -> int:
        """As above. Of the old protocol only known messages count: noise looks like the others."""
        buffer = self._buffer
        if len(buffer) < HEADER_V1.size:
            return len(buffer) + 1
        kind = message_type_of(_sender(buffer, old=True)[2])
        if kind is None or buffer[1] > kind.size:
            return 0
        return HEADER_V1.size + buffer[1] + CHECKSUM.size

    def _take(self, length: int, frames: list[Frame]) -> None:
        raw = bytes(self._buffer[:length])
        old = raw[0] == STX_V1
        signature = 0 if old or not raw[2] & SIGNED else SIGNATURE_LENGTH
        header = HEADER_V1.size if old else HEADER.size
        system, component, number = _sender(raw, old)
        kind = message_type_of(number)
        end = length - CHECKSUM.size - signature
        if kind is None:
            self._unknown(length)
            return
        if kind.checksum(raw[1:end]) != CHECKSUM.unpack_from(raw, end)[0]:
            self.heard.corrupt += 1
            self._skip(1)
            return
        if old:
            self.heard.frames_v1 += 1
        else:
            self.heard.frames += 1
        frames.append(Frame(kind.name, kind.unpack(raw[header:end]), system, component))
        del self._buffer[:length]

    def _unknown(self, length: int) -> None:
        """Of a message that the dialect lacks the checksum is unknown, too: believe it if a frame follows."""
        if len(self._buffer) > length and self._buffer[length] not in {STX, STX_V1}:
            self._skip(1)
            return
        self.heard.unknown += 1
        del self._buffer[:length]

    def _skip(self, count: int) -> None:
        if not count:
            return
        for octet in self._buffer[:count]:
            self._classify(octet)
        del self._buffer[:count]

    def _classify(self, octet: int) -> None:
        if octet not in _PRINTABLE:
            self.heard.garbage += 1
            return
        self.heard.text += 1
        if octet in b"\r\n" or len(self._line) >= _LONGEST_LINE:
            if self._line:
                self.heard.lines.append(self._line.decode("ascii"))
            self._line.clear()
        if octet not in b"\r\n":
            self._line.append(octet)


def _sender(raw: bytes | bytearray, old: bool) -> tuple[int, int, int]:
    """System, component and message number."""
    if old:
        *_, system, component, number = HEADER_V1.unpack_from(raw)
        return system, component, number
    *_, system, component, low, high = HEADER.unpack_from(raw)
    return system, component, low | high << 16
