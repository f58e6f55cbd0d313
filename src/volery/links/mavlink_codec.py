"""A stream of bytes taken apart into frames. Tolerant: real links carry boot texts, noise, other protocols.

What is not MAVLink 2 is skipped, counted and kept as evidence, so that ``problem`` can say in words what does
arrive.
"""

from __future__ import annotations

import struct

from volery.links.link import Codec, Frame, NonFrameBytes, ReceiveStatistics
from volery.links.mavlink_messages import (
    CHECKSUM,
    HEADER,
    HEADER_V1,
    SIGNATURE_LENGTH,
    SIGNED,
    STX,
    STX_V1,
    MessageType,
    encode,
    message_type_of,
    quantised,
)

_STARTS = frozenset((STX, STX_V1))
_BEFORE, _AFTER = HEADER.size, CHECKSUM.size
_AROUND = _BEFORE + _AFTER
_WHAT_COUNTS = struct.Struct("<xBBxxBBHB")
"""Of ``HEADER``: length, what one must understand, system, component, id low, high."""

Octets = bytes | bytearray


class _Head:
    """What seems to be the header of a frame at *start*. ``length`` is that of the whole; 0: it is none."""

    __slots__ = ("component", "kind", "length", "old", "payload", "start", "system", "trailer")

    def __init__(self, buffer: Octets, start: int) -> None:
        self.start = start
        self.old = buffer[start] == STX_V1
        self.trailer = CHECKSUM.size
        incompatible = 0
        if self.old:
            _, size, _, self.system, self.component, number = HEADER_V1.unpack_from(buffer, start)
            self.payload = start + HEADER_V1.size
        else:
            _, size, incompatible, _, _, self.system, self.component, low, high = HEADER.unpack_from(
                buffer, start
            )
            number = low | high << 16
            self.payload = start + HEADER.size
            self.trailer += SIGNATURE_LENGTH if incompatible & SIGNED else 0
        self.kind: MessageType | None = message_type_of(number)
        self.length: int = self.payload - start + size + self.trailer
        if incompatible & ~SIGNED or (self.kind is not None and size > self.kind.size):
            self.length = 0
        elif self.old and self.kind is None:
            self.length = 0  # of the old protocol only known messages count: noise looks like the others

    def whole(self, buffer: Octets) -> bool:
        """The checksum is right. An unknown message's cannot be told: believe it if a frame follows."""
        end = self.start + self.length
        if self.kind is None:
            return len(buffer) <= end or buffer[end] in _STARTS
        body = end - self.trailer
        checksum: int = CHECKSUM.unpack_from(buffer, body)[0]
        return self.kind.checksum(bytes(buffer[self.start + 1 : body])) == checksum


def _head(buffer: Octets, start: int) -> _Head | None:
    """``None`` while the header is not complete."""
    size = HEADER_V1.size if buffer[start] == STX_V1 else HEADER.size
    return _Head(buffer, start) if len(buffer) - start >= size else None


def whole_frame(data: Octets, start: int) -> int:
    """The length of the whole frame that lies at *start*; 0 if none does."""
    if start >= len(data) or data[start] not in _STARTS:
        return 0
    head = _head(data, start)
    if head is None or not head.length or start + head.length > len(data):
        return 0
    return head.length if head.whole(data) else 0


class MavlinkParser:
    """Feed it bytes in any portions; it returns the frames that they complete."""

    def __init__(self) -> None:
        self.heard = ReceiveStatistics()
        self._rest = b""  # what may become a frame
        self._evidence = NonFrameBytes(self.heard)

    def feed(self, data: bytes) -> list[Frame]:
        """The frames completed by *data*, in order, MAVLink 1 frames among them. Never raises."""
        self.heard.octets += len(data)
        octets = self._rest + data if self._rest else data
        frames: list[Frame] = []
        place, size = 0, len(octets)
        while place < size:
            taken = self._usual(octets, place, frames) or self._unusual(octets, place, frames)
            if not taken:
                break
            place += taken
        self._rest = octets[place:]
        return frames

    def _usual(self, octets: bytes, start: int, frames: list[Frame]) -> int:
        """A whole unsigned MAVLink 2 frame of a known kind, as nearly all are: its length; 0 if none is."""
        if octets[start] != STX or len(octets) - start < _AROUND:
            return 0
        size: int
        size, incompatible, system, component, low, high = _WHAT_COUNTS.unpack_from(octets, start)
        kind = message_type_of(low | high << 16)
        end = start + _BEFORE + size
        if incompatible or kind is None or size > kind.size or end + _AFTER > len(octets):
            return 0
        body = octets[start + 1 : end]
        if kind.checksum(body) != octets[end] | octets[end + 1] << 8:
            return 0
        self.heard.frames += 1
        frames.append(Frame(kind.name, kind.unpack(body[_BEFORE - 1 :]), system, component))
        return size + _AROUND

    def _unusual(self, octets: bytes, start: int, frames: list[Frame]) -> int:
        """Anything else: how many bytes of it are dealt with; 0 while it may become a frame."""
        if octets[start] not in _STARTS:
            self._evidence.note(octets[start])
            return 1
        head = _head(octets, start)
        if head is None or start + head.length > len(octets):
            return 0
        return self._take(octets, head, frames)

    def reset(self) -> None:
        """Forget a half-received frame: the connection behind it is gone."""
        self._rest = b""

    def problem(self) -> str:
        """What is wrong with what arrives, in words; empty if MAVLink 2 does, or nothing at all."""
        heard = self.heard
        if heard.frames or not heard.octets:
            return ""
        if heard.frames_v1:
            return "MAVLink 1 only: set SERIALx_PROTOCOL=2 (ArduPilot) or MAV_PROTO_VER=2 (PX4) for this port"
        text = self._evidence.only_text()
        if text:
            return text
        if heard.corrupt > 2 or heard.unknown > 2:
            return (
                f"{heard.octets} bytes arrive but no whole MAVLink frame ({heard.corrupt} corrupt, "
                f"{heard.unknown} of unknown kind): noise, or another dialect"
            )
        return f"{heard.octets} bytes arrive but no MAVLink: another protocol, or the wrong baud rate"

    def _take(self, octets: bytes, head: _Head, frames: list[Frame]) -> int:
        """How many bytes are dealt with."""
        if not head.length or not head.whole(octets):
            if head.length and head.kind is not None:
                self.heard.corrupt += 1
            self._evidence.note(octets[head.start])
            return 1
        if head.kind is None:
            self.heard.unknown += 1
            return head.length
        if head.old:
            self.heard.frames_v1 += 1
        else:
            self.heard.frames += 1
        payload = octets[head.payload : head.start + head.length - head.trailer]
        frames.append(Frame(head.kind.name, head.kind.unpack(payload), head.system, head.component))
        return head.length


class _Mavlink:
    """MAVLink 2 out, 1 and 2 in."""

    name = "MAVLink"

    def encode(self, frame: Frame, sequence: int) -> bytes:
        """See ``mavlink.encode``."""
        return encode(frame, sequence)

    def parser(self) -> MavlinkParser:
        """See ``MavlinkParser``."""
        return MavlinkParser()

    def quantised(self, frame: Frame) -> Frame:
        """See ``mavlink.quantised``."""
        return quantised(frame)


MAVLINK: Codec = _Mavlink()
