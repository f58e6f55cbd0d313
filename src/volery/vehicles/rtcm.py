"""RTCM 3 messages in a stream of bytes, as an RTK base station or an NTRIP caster sends them.

A message is 0xD3, ten bits of length, as many bytes, and a CRC-24Q (RTCM 10403).
"""

from __future__ import annotations

from volery.base.errors import UsageError

PREAMBLE = 0xD3
HEAD, CHECK = 3, 3
LARGEST = 720
"""Bytes of a message that fit into the four parts of GPS_RTCM_DATA."""
_POLYNOMIAL = 0x1864CFB


def messages_of(data: bytes) -> list[bytes]:
    """Return the whole messages in *data*.

    Raises:
        UsageError: the bytes are something else, end within a message, or a checksum is wrong.
    """
    found, at = [], 0
    while at < len(data):
        if data[at] != PREAMBLE:
            raise UsageError(
                f"byte {at} of the corrections is 0x{data[at]:02X}, where RTCM 3 has 0xD3; give whole RTCM 3 "
                "messages, as a base station sends them"
            )
        size = HEAD + ((data[at + 1] & 0x03) << 8 | data[at + 2]) + CHECK if at + 2 < len(data) else HEAD
        message = bytes(data[at : at + size])
        if len(message) < size or size == HEAD:
            raise UsageError(
                f"the corrections end within the message at byte {at}; keep it for the next call"
            )
        if crc24q(message[:-CHECK]) != int.from_bytes(message[-CHECK:], "big"):
            raise UsageError(f"the checksum of the message at byte {at} is wrong: it was damaged")
        if size > LARGEST:
            raise UsageError(f"an RTCM message of {size} bytes; MAVLink carries {LARGEST}")
        found.append(message)
        at += size
    return found


def crc24q(data: bytes) -> int:
    """Return the CRC-24Q of *data* (RTCM 10403)."""
    crc = 0
    for octet in data:
        crc ^= octet << 16
        for _ in range(8):
            crc = crc << 1 ^ _POLYNOMIAL if crc & 0x800000 else crc << 1
            crc &= 0xFFFFFF
    return crc
