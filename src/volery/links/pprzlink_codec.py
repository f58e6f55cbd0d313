"""pprzlink 2.0 as bytes: frames encoded and parsed.

Format of a frame on the wire::

    0x99 length source destination class|component<<4 number payload... check-A check-B

``length`` counts the whole frame; check-A is the sum of all bytes from ``length`` to the end of the payload,
check-B the sum of the intermediate values of check-A, both modulo 256.

The ``system`` of a ``Frame`` is the source (the id of an aircraft, or 0 for the ground) and its ``component``
the sender's component, 0..15. The class follows from the name of the message, and so does the destination:
telemetry is sent to the ground; a datalink message is sent to the aircraft that its field ``ac_id`` names, or
to all aircraft if it has no such field. A receiver checks ``ac_id``, as the firmware does.
"""

from __future__ import annotations

from itertools import accumulate

from volery.base.errors import UsageError
from volery.links.frame import Frame
from volery.links.link import NonFrameBytes, ReceiveStatistics, WireFormat
from volery.links.mavlink_codec import MavlinkParser
from volery.links.pprzlink_messages import DATALINK, TELEMETRY, message_type, message_type_of

STX = 0x99
HEADER = 6
AROUND = HEADER + 2
AROUND_V1 = 6
"""Bytes around the payload in version 1.0, which has neither destination nor class."""

TO_GROUND = 0
"""Id of the ground, as source and as destination."""
TO_ALL = 255

Octets = bytes | bytearray


def checksum(covered: Octets) -> bytes:
    """Return both check bytes of *covered*, the bytes between STX and the check bytes."""
    return bytes((sum(covered) % 256, sum(accumulate(covered)) % 256))


def encode(frame: Frame, sequence: int = 0) -> bytes:
    """Return *frame* in pprzlink 2.0 wire format. *sequence* is unused: the protocol numbers no frames."""
    del sequence
    kind = message_type(frame.name)
    payload = kind.pack(frame.fields)
    if not 0 <= frame.system <= 255 or not 0 <= frame.component <= 15:
        sender = f"system {frame.system}, component {frame.component}"
        raise UsageError(f"{frame.name} from {sender}: ids are 0 to 255, components 0 to 15")
    if kind.kind == TELEMETRY:
        destination = TO_GROUND
    else:
        destination = int(frame.fields.get("ac_id", TO_ALL)) if kind.kind == DATALINK else TO_ALL
    address = frame.system, destination, kind.kind | frame.component << 4
    body = bytes((len(payload) + AROUND, *address, kind.id)) + payload
    return bytes((STX,)) + body + checksum(body)


def quantised(frame: Frame) -> Frame:
    """Return *frame* as it arrives after encoding and decoding: 32-bit floats, all fields present."""
    kind = message_type(frame.name)
    fields = kind.unpack(kind.pack(frame.fields))
    assert fields is not None, "a packed payload has the length of its message"
    return Frame(frame.name, fields, frame.system, frame.component)


class PprzlinkParser:
    """Splits a stream of bytes, fed in any portions, into pprzlink 2.0 frames.

    Frames of version 1.0 are counted, not returned, because an aircraft that sends version 1.0 cannot decode
    version 2.0. Until the first frame, received bytes are also parsed as MAVLink, so that ``problem`` can
    name it.
    """

    def __init__(self) -> None:
        self.statistics = ReceiveStatistics()
        self._buffer = bytearray()
        self._other = NonFrameBytes(self.statistics)
        self._mavlink = MavlinkParser()
        self._misfit = ""  # name of a message whose length differs from its definition

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames completed by *data*, in order. Never raises."""
        self.statistics.octets += len(data)
        if not self.statistics.frames:
            self._mavlink.feed(data)
        self._buffer += data
        buffer = self._buffer
        frames: list[Frame] = []
        at = 0
        while at < len(buffer):
            if buffer[at] != STX:
                self._other.add(buffer[at])
                at += 1
                continue
            length = buffer[at + 1] if at + 1 < len(buffer) else AROUND_V1
            if at + length > len(buffer):
                break
            at += self._parse(at, length, frames)
        del buffer[:at]
        return frames

    def _parse(self, start: int, length: int, frames: list[Frame]) -> int:
        """Parse a possible frame at *start* and return the number of bytes consumed."""
        body = self._buffer[start + 1 : start + length - 2]
        if length < AROUND_V1 or checksum(body) != self._buffer[start + length - 2 : start + length]:
            self.statistics.corrupt += length >= AROUND_V1
            self._other.add(STX)
            return 1
        frame = self._decode(body)
        if frame is not None:
            self.statistics.frames += 1
            frames.append(frame)
        elif _is_version_1(body):
            self.statistics.frames_v1 += 1
        else:
            self.statistics.unknown += 1
        return length

    def _decode(self, body: bytearray) -> Frame | None:
        """Return the frame between STX and the check bytes, or None if the message is unknown."""
        if len(body) < HEADER - 1:
            return None
        _, source, _, class_and_component, number = body[: HEADER - 1]
        kind = message_type_of(class_and_component & 0x0F, number)
        if kind is None:
            return None
        fields = kind.unpack(bytes(body[HEADER - 1 :]))
        if fields is None:
            self._misfit = kind.name
            return None
        return Frame(kind.name, fields, source, class_and_component >> 4)

    def reset(self) -> None:
        """Drop a half-received frame, because the connection has broken."""
        self._buffer.clear()
        self._mavlink.reset()

    def problem(self) -> str:
        """Return what is wrong with the received bytes; ``""`` if pprzlink 2.0 or nothing was received."""
        received = self.statistics
        if received.frames or not received.octets:
            return ""
        mavlink = self._mavlink.statistics
        if mavlink.frames or mavlink.frames_v1:
            return "MAVLink arrives, not pprzlink: an autopilot of another make"
        if received.frames_v1:
            return "pprzlink 1.0 arrives; build the aircraft with pprzlink 2.0 (PPRZLINK_LIB_VERSION=2.0)"
        text = self._other.only_text()
        if text:
            return text
        if self._misfit:
            cause = f"{self._misfit} has another length there: other message definitions"
        elif received.unknown > 2:
            cause = f"{received.unknown} messages of unknown kind: other message definitions"
        elif received.corrupt > 2:
            cause = f"{received.corrupt} corrupt frames: noise, or the wrong baud rate"
        else:
            cause = "another protocol, or the wrong baud rate"
        return f"{received.octets} bytes arrive but no pprzlink: {cause}"


def _is_version_1(body: bytearray) -> bool:
    """Return whether *body* is a telemetry message of version 1.0: length, sender, number, payload."""
    kind = message_type_of(TELEMETRY, body[2]) if len(body) > 2 else None
    return kind is not None and kind.unpack(bytes(body[3:])) is not None


class _PprzlinkCodec:
    """Encodes and decodes pprzlink 2.0."""

    name = "pprzlink"
    encode = staticmethod(encode)
    parser = PprzlinkParser
    quantised = staticmethod(quantised)


PPRZLINK: WireFormat = _PprzlinkCodec()
