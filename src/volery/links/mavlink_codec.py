"""MAVLink as bytes: frames encoded as MAVLink 2, a tolerant parser for MAVLink 1 and 2, and signing.

Real links carry boot texts, noise and other protocols. The parser skips and counts everything that is no
frame, so that ``problem`` can describe what arrives instead.

A MAVLink 2 payload that is longer than the definition known here has extension fields of a newer sender: they
are left out, as the protocol asks. MAVLink 1 has no extension fields.
Source: https://mavlink.io/en/guide/serialization.html

pymavlink computes and checks the signatures. A signed link sends signed frames only, and receives nothing
else but RADIO_STATUS, which the radio at this end sends and cannot sign. A frame is refused if its signature
is wrong or if its time is not later than that of the frame before it (a replay). Signing authenticates; it
does not encrypt. Source: https://mavlink.io/en/guide/message_signing.html
"""

from __future__ import annotations

import stat
import struct
from collections.abc import Callable
from pathlib import Path
from time import time_ns
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from volery.base.errors import UsageError
from volery.links.frame import Frame
from volery.links.link import NonFrameBytes, ReceiveStatistics, WireFormat
from volery.links.mavlink_messages import MavlinkMessageType, message_type, message_type_of

STX = 0xFD
STX_V1 = 0xFE
HEADER = struct.Struct("<BBBBBBBHB")  # STX, length, two flags, sequence, system, component, id low, high
HEADER_V1 = struct.Struct("<BBBBBB")  # STX, length, sequence, system, component, id
CHECKSUM = struct.Struct("<H")
SIGNED = 0x01
SIGNATURE_LENGTH = 13

_STARTS = frozenset((STX, STX_V1))
_BEFORE, _AFTER = HEADER.size, CHECKSUM.size
_AROUND = _BEFORE + _AFTER
_RELEVANT_HEADER = struct.Struct("<xBBxxBBHB")
"""Of ``HEADER``: length, incompatibility flags, system, component, id low, id high."""

Octets = bytes | bytearray


def encode(frame: Frame, sequence: int) -> bytes:
    """Return *frame* in MAVLink 2 wire format.

    Args:
        frame: The message to encode.
        sequence: Number of frames that this sender has sent before; taken modulo 256.
    """
    kind = message_type(frame.name)
    payload = kind.pack(frame.fields).rstrip(b"\0") or b"\0"
    low, high = kind.id & 0xFFFF, kind.id >> 16
    sender = frame.system, frame.component
    header = HEADER.pack(STX, len(payload), 0, 0, sequence % 256, *sender, low, high)
    return header + payload + CHECKSUM.pack(kind.checksum(header[1:] + payload))


def quantised(frame: Frame) -> Frame:
    """Return *frame* as it arrives after encoding and decoding.

    Floats have 32 bits, strings are cut to their field, and all fields are present.
    """
    fields = message_type(frame.name).quantised(frame.fields)
    return frame if fields is frame.fields else Frame(frame.name, fields, frame.system, frame.component)


class _Header:
    """A possible frame header at *start*. ``length`` is that of the whole frame; 0 if there is no header."""

    __slots__ = ("component", "kind", "length", "payload", "start", "system", "trailer", "version_1")

    def __init__(self, buffer: Octets, start: int) -> None:
        self.start = start
        self.version_1 = buffer[start] == STX_V1
        self.trailer = CHECKSUM.size
        incompatible = 0
        if self.version_1:
            _, size, _, self.system, self.component, number = HEADER_V1.unpack_from(buffer, start)
            self.payload = start + HEADER_V1.size
        else:
            _, size, incompatible, _, _, self.system, self.component, low, high = HEADER.unpack_from(
                buffer, start
            )
            number = low | high << 16
            self.payload = start + HEADER.size
            self.trailer += SIGNATURE_LENGTH if incompatible & SIGNED else 0
        self.kind: MavlinkMessageType | None = message_type_of(number)
        self.length: int = self.payload - start + size + self.trailer
        if incompatible & ~SIGNED:
            self.length = 0
        elif self.version_1 and (self.kind is None or size > self.kind.size):
            self.length = 0  # noise often looks like MAVLink 1, so only known messages are accepted

    def valid(self, buffer: Octets) -> bool:
        """Return whether the checksum is right.

        The checksum of an unknown message cannot be computed. Such a frame is accepted if another frame
        follows.
        """
        end = self.start + self.length
        if self.kind is None:
            return len(buffer) <= end or buffer[end] in _STARTS
        body = end - self.trailer
        checksum: int = CHECKSUM.unpack_from(buffer, body)[0]
        return self.kind.checksum(bytes(buffer[self.start + 1 : body])) == checksum


def _header_at(buffer: Octets, start: int) -> _Header | None:
    """Return the header at *start*, or None while it is incomplete."""
    size = HEADER_V1.size if buffer[start] == STX_V1 else HEADER.size
    return _Header(buffer, start) if len(buffer) - start >= size else None


def frame_length(data: Octets, start: int) -> int:
    """Return the length in bytes of the complete, valid frame at *start*, or 0 if there is none."""
    if start >= len(data) or data[start] not in _STARTS:
        return 0
    header = _header_at(data, start)
    if header is None or not header.length or start + header.length > len(data):
        return 0
    return header.length if header.valid(data) else 0


Acceptance = Callable[[bytes, str, int, int], bool]
"""Decides about a frame by its bytes, its message, and the sender's system and component."""


class MavlinkParser:
    """Splits a stream of bytes, fed in any portions, into MAVLink frames.

    Args:
        accepts: Decides which valid frames are received, by their signature; None for all.
    """

    def __init__(self, accepts: Acceptance | None = None) -> None:
        self.statistics = ReceiveStatistics()
        self._accepts = accepts
        self._rest = b""  # may become a frame
        self._other = NonFrameBytes(self.statistics)

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames completed by *data*, in order, including MAVLink 1 frames. Never raises."""
        self.statistics.octets += len(data)
        octets = self._rest + data if self._rest else data
        frames: list[Frame] = []
        at, size = 0, len(octets)
        while at < size:
            taken = 0 if self._accepts else self._parse_usual(octets, at, frames)
            taken = taken or self._parse_other(octets, at, frames)
            if not taken:
                break
            at += taken
        self._rest = octets[at:]
        return frames

    def _parse_usual(self, octets: bytes, start: int, frames: list[Frame]) -> int:
        """Parse a whole unsigned MAVLink 2 frame of a known message, as nearly all are.

        Returns the length of the frame, or 0 if there is no such frame at *start*.
        """
        if octets[start] != STX or len(octets) - start < _AROUND:
            return 0
        size: int
        size, incompatible, system, component, low, high = _RELEVANT_HEADER.unpack_from(octets, start)
        kind = message_type_of(low | high << 16)
        end = start + _BEFORE + size
        if incompatible or kind is None or end + _AFTER > len(octets):
            return 0
        body = octets[start + 1 : end]
        if kind.checksum(body) != octets[end] | octets[end + 1] << 8:
            return 0
        self.statistics.frames += 1
        frames.append(Frame(kind.name, kind.unpack(body[_BEFORE - 1 :]), system, component))
        return size + _AROUND

    def _parse_other(self, octets: bytes, start: int, frames: list[Frame]) -> int:
        """Parse anything else. Returns the bytes consumed, or 0 while they may still become a frame."""
        statistics = self.statistics
        if octets[start] not in _STARTS:
            self._other.add(octets[start])
            return 1
        header = _header_at(octets, start)
        if header is None or start + header.length > len(octets):
            return 0
        if not header.length or not header.valid(octets):
            if header.length and header.kind is not None:
                statistics.corrupt += 1
            self._other.add(octets[start])
            return 1
        if header.kind is None:
            statistics.unknown += 1
            return header.length
        if self._accepts is not None:
            raw = bytes(octets[start : start + header.length])
            if not self._accepts(raw, header.kind.name, header.system, header.component):
                statistics.refused += 1
                return header.length
        elif header.trailer > CHECKSUM.size:
            statistics.signed += 1
        if header.version_1:
            statistics.frames_v1 += 1
        else:
            statistics.frames += 1
        payload = octets[header.payload : start + header.length - header.trailer]
        frames.append(Frame(header.kind.name, header.kind.unpack(payload), header.system, header.component))
        return header.length

    def reset(self) -> None:
        """Drop a half-received frame, because the connection has broken."""
        self._rest = b""

    def problem(self) -> str:
        """Return what is wrong with the received bytes; ``""`` if MAVLink 2 or nothing was received."""
        received = self.statistics
        if received.frames or not received.octets:
            return ""
        if received.refused:
            return f"{received.refused} frames were refused: they are not signed with the key of this link"
        if received.frames_v1:
            return "MAVLink 1 only: set SERIALx_PROTOCOL=2 (ArduPilot) or MAV_PROTO_VER=2 (PX4) for this port"
        text = self._other.only_text()
        if text:
            return text
        if received.corrupt > 2 or received.unknown > 2:
            return (
                f"{received.octets} bytes arrive but no whole MAVLink frame ({received.corrupt} corrupt, "
                f"{received.unknown} of unknown kind): noise, or another dialect"
            )
        return f"{received.octets} bytes arrive but no MAVLink: another protocol, or the wrong baud rate"


class _MavlinkCodec:
    """Encodes MAVLink 2; decodes MAVLink 1 and 2."""

    name = "MAVLink"
    encode = staticmethod(encode)
    parser = MavlinkParser
    quantised = staticmethod(quantised)


MAVLINK: WireFormat = _MavlinkCodec()


KEY_LENGTH = 32
_EPOCH_NS = 1_420_070_400 * 10**9
"""Zero of the times in signatures: 1 January 2015, in Unix time."""
_UNIT_NS = 10_000
_RADIO_STATUS = "RADIO_STATUS"
_LARGEST_KEY_FILE = 4096


def read_key(path: Path) -> bytes:
    """Return the key in a file: 64 hexadecimal digits, as ``openssl rand -hex 32`` prints them.

    Raises:
        UsageError: The file cannot be read, others than its owner can read it, or it holds no key.
    """
    try:
        state = path.stat()
        text = (
            path.read_bytes() if stat.S_ISREG(state.st_mode) and state.st_size <= _LARGEST_KEY_FILE else b""
        )
    except OSError as error:
        raise UsageError(f"cannot read the signing key {path}: {error.strerror or error}") from None
    if state.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise UsageError(f"the signing key {path} can be read or written by others; chmod 600 {path}")
    try:
        key = bytes.fromhex(text.decode("ascii"))
    except ValueError:
        key = b""
    if len(key) != KEY_LENGTH:
        raise UsageError(
            f"{path} holds no signing key: {2 * KEY_LENGTH} hexadecimal digits are one; "
            f"make it with: (umask 077; openssl rand -hex {KEY_LENGTH} > {path})"
        )
    return key


class _Packet:
    """What pymavlink signs: an object with the bytes of a frame."""

    def __init__(self, frame: bytes) -> None:
        self._msgbuf = bytearray(frame)

    def signed(self, owner: Any) -> bytes:
        dialect.MAVLink_message.sign_packet(self, owner)
        return bytes(self._msgbuf)


class SignedMavlink:
    """The codec of one signed link. All parsers of a link share the times of the frames that were received.

    Args:
        key: 32 secret bytes that both ends know.
        link_id: Number of this end's link in its signatures. Programs that share a system id, a component id
            and a vehicle need different ones.
    """

    name = "MAVLink"

    def __init__(self, key: bytes, link_id: int = 0) -> None:
        self._mavlink = dialect.MAVLink(None)
        self._signing = self._mavlink.signing
        self._signing.secret_key = key
        self._signing.link_id = link_id
        self._signing.timestamp = _signature_time()

    def encode(self, frame: Frame, sequence: int) -> bytes:
        """Return *frame* in MAVLink 2 wire format, signed."""
        unsigned = encode(frame, sequence)
        header = bytearray(unsigned[: HEADER.size])
        header[2] |= SIGNED
        body = bytes(header[1:]) + unsigned[HEADER.size : -CHECKSUM.size]
        self._signing.timestamp = max(self._signing.timestamp, _signature_time())
        checksum = CHECKSUM.pack(message_type(frame.name).checksum(body))
        return _Packet(unsigned[:1] + body + checksum).signed(self._mavlink)

    def parser(self) -> MavlinkParser:
        """Return a new parser for one stream of bytes that refuses what is not signed with the key."""
        return MavlinkParser(self._accepts)

    def quantised(self, frame: Frame) -> Frame:
        """Return *frame* as it arrives after encoding and decoding."""
        return quantised(frame)

    def _accepts(self, raw: bytes, name: str, system: int, component: int) -> bool:
        """Return whether a whole frame with a right checksum is to be received."""
        if raw[0] != dialect.PROTOCOL_MARKER_V2 or not raw[2] & SIGNED:
            return name == _RADIO_STATUS
        times = self._signing.stream_timestamps
        stream = raw[-13], system, component
        last = times.get(stream)
        if self._mavlink.check_signature(bytearray(raw), system, component):
            return True
        # pymavlink notes the time before it checks the signature: a forged frame would silence its sender.
        if last is None:
            times.pop(stream, None)
        else:
            times[stream] = last
        return False


def _signature_time() -> int:
    """Return the present in the unit of signatures: 10 microseconds since 2015."""
    return (time_ns() - _EPOCH_NS) // _UNIT_NS
