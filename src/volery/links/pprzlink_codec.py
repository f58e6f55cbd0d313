"""pprzlink 2.0 as bytes: a ``Frame`` to its wire form and back.

On the wire::

    0x99 length source destination class|component<<4 number payload... check-A check-B

``length`` counts the whole frame; check-A is the sum of all bytes from ``length`` to the end of the payload,
check-B the sum of its values on the way, both modulo 256.

A ``Frame`` says ``name`` and ``fields`` of a message; ``system`` is the source (an aircraft's id, or 0 for
the ground) and ``component`` the sender's component, 0..15. The class follows from the name. So does the
destination: telemetry goes to the ground; a datalink message goes to the aircraft that its field ``ac_id``
names, or to all where it has none. A receiver looks at ``ac_id``, as the firmware does.
"""

from __future__ import annotations

from itertools import accumulate

from volery.base.errors import UsageError
from volery.links.link import Codec, Frame, NonFrameBytes, ReceiveStatistics
from volery.links.mavlink_codec import MavlinkParser
from volery.links.pprzlink_messages import DATALINK, TELEMETRY, MessageType, message_type, message_type_of

STX = 0x99
HEADER = 6
AROUND = HEADER + 2
AROUND_V1 = 6
"""Bytes around the payload in version 1.0: it has neither destination nor class."""

TO_GROUND = 0
"""The ground's id, as source and as destination."""
TO_ALL = 255

Octets = bytes | bytearray


def checksum(covered: Octets) -> bytes:
    """Both check bytes of what lies between STX and them."""
    return bytes((sum(covered) % 256, sum(accumulate(covered)) % 256))


def encode(frame: Frame, sequence: int = 0) -> bytes:
    """The frame in pprzlink 2.0 wire form, which does not count frames."""
    del sequence
    kind = message_type(frame.name)
    payload = kind.pack(frame.fields)
    if not 0 <= frame.system <= 255 or not 0 <= frame.component <= 15:
        sender = f"system {frame.system}, component {frame.component}"
        raise UsageError(f"{frame.name} from {sender}: ids are 0 to 255, components 0 to 15")
    address = frame.system, _destination(kind, frame), kind.kind | frame.component << 4
    body = bytes((len(payload) + AROUND, *address, kind.id)) + payload
    return bytes((STX,)) + body + checksum(body)


def _destination(kind: MessageType, frame: Frame) -> int:
    if kind.kind == TELEMETRY:
        return TO_GROUND
    return int(frame.fields.get("ac_id", TO_ALL)) if kind.kind == DATALINK else TO_ALL


def quantised(frame: Frame) -> Frame:
    """The frame as it arrives after a trip over the wire: 32-bit floats, all fields present."""
    kind = message_type(frame.name)
    fields = kind.unpack(kind.pack(frame.fields))
    assert fields is not None, "what was packed has its own length"
    return Frame(frame.name, fields, frame.system, frame.component)


class PprzlinkParser:
    """Feed it bytes in any portions; it returns the frames that they complete.

    Frames of version 1.0 are counted, not returned: an aircraft that speaks it would not understand ours.
    Until a first frame has come, it listens for MAVLink as well, in order to say so.
    """

    def __init__(self) -> None:
        self.heard = ReceiveStatistics()
        self._buffer = bytearray()
        self._evidence = NonFrameBytes(self.heard)
        self._mavlink = MavlinkParser()
        self._misfit = ""  # a message that has another length than here

    def feed(self, data: bytes) -> list[Frame]:
        """The frames completed by *data*, in order. Never raises."""
        self.heard.octets += len(data)
        if not self.heard.frames:
            self._mavlink.feed(data)
        self._buffer += data
        buffer = self._buffer
        frames: list[Frame] = []
        place = 0
        while place < len(buffer):
            if buffer[place] != STX:
                self._evidence.note(buffer[place])
                place += 1
                continue
            length = buffer[place + 1] if place + 1 < len(buffer) else AROUND_V1
            if place + length > len(buffer):
                break
            place += self._take(place, length, frames)
        del buffer[:place]
        return frames

    def _take(self, start: int, length: int, frames: list[Frame]) -> int:
        """How many bytes from *start* on are dealt with."""
        body = self._buffer[start + 1 : start + length - 2]
        if length < AROUND_V1 or checksum(body) != self._buffer[start + length - 2 : start + length]:
            self.heard.corrupt += length >= AROUND_V1
            self._evidence.note(STX)
            return 1
        frame = self._frame(body)
        if frame is not None:
            self.heard.frames += 1
            frames.append(frame)
        elif _is_old(body):
            self.heard.frames_v1 += 1
        else:
            self.heard.unknown += 1
        return length

    def _frame(self, body: bytearray) -> Frame | None:
        """What lies between STX and the check bytes, if it is a message that is known here."""
        if len(body) < HEADER - 1:
            return None
        _, source, _, sort, number = body[: HEADER - 1]
        kind = message_type_of(sort & 0x0F, number)
        if kind is None:
            return None
        fields = kind.unpack(bytes(body[HEADER - 1 :]))
        if fields is None:
            self._misfit = kind.name
            return None
        return Frame(kind.name, fields, source, sort >> 4)

    def reset(self) -> None:
        """Forget a half-received frame: the connection behind it is gone."""
        self._buffer.clear()
        self._mavlink.reset()

    def problem(self) -> str:
        """What is wrong with what arrives, in words; empty if pprzlink 2.0 does, or nothing at all."""
        heard = self.heard
        if heard.frames or not heard.octets:
            return ""
        spoken = self._mavlink.heard
        if spoken.frames or spoken.frames_v1:
            return "MAVLink arrives, not pprzlink: an autopilot of another make"
        if heard.frames_v1:
            return "pprzlink 1.0 arrives; build the aircraft with pprzlink 2.0 (PPRZLINK_LIB_VERSION=2.0)"
        text = self._evidence.only_text()
        if text:
            return text
        return f"{heard.octets} bytes arrive but no pprzlink: {self._likely()}"

    def _likely(self) -> str:
        if self._misfit:
            return f"{self._misfit} has another length there: other message definitions"
        if self.heard.unknown > 2:
            return f"{self.heard.unknown} messages of unknown kind: other message definitions"
        if self.heard.corrupt > 2:
            return f"{self.heard.corrupt} corrupt frames: noise, or the wrong baud rate"
        return "another protocol, or the wrong baud rate"


def _is_old(body: bytearray) -> bool:
    """A telemetry message of version 1.0: length, sender, number, payload."""
    kind = message_type_of(TELEMETRY, body[2]) if len(body) > 2 else None
    return kind is not None and kind.unpack(bytes(body[3:])) is not None


class _Pprzlink:
    """pprzlink 2.0 both ways."""

    name = "pprzlink"

    def encode(self, frame: Frame, sequence: int) -> bytes:
        """See ``encode``."""
        return encode(frame, sequence)

    def parser(self) -> PprzlinkParser:
        """See ``PprzlinkParser``."""
        return PprzlinkParser()

    def quantised(self, frame: Frame) -> Frame:
        """See ``quantised``."""
        return quantised(frame)


PPRZLINK: Codec = _Pprzlink()
