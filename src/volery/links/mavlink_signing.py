"""MAVLink 2 signing: frames that only owners of a key can make.

pymavlink computes and checks the signatures. A signed link sends signed frames only, and receives nothing
else but RADIO_STATUS, which the radio at this end sends and cannot sign. A frame is refused if its signature
is wrong or if its time is not later than that of the frame before it (a replay). Signing authenticates; it
does not encrypt. Source: https://mavlink.io/en/guide/message_signing.html
"""

from __future__ import annotations

import stat
from pathlib import Path
from time import time_ns
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from volery.base.errors import UsageError
from volery.links.link import Frame
from volery.links.mavlink_codec import (
    CHECKSUM,
    HEADER,
    SIGNED,
    MavlinkParser,
    encode,
    quantised,
)
from volery.links.mavlink_messages import message_type

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
