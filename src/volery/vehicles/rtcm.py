"""RTCM 3 messages in a stream of bytes, as an RTK base station or an NTRIP caster sends them.

A message is 0xD3, ten bits of length, as many bytes, and a CRC-24Q (RTCM 10403). MAVLink carries it in parts.
"""

from __future__ import annotations

from typing import Any

from volery.base.errors import UsageError

PREAMBLE = 0xD3
HEAD, CHECK = 3, 3
CORRECTION_PART, CORRECTION_PARTS = 180, 4
"""Bytes in one GPS_RTCM_DATA, and the greatest number of parts of one RTCM message."""
LARGEST = CORRECTION_PART * CORRECTION_PARTS
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


def correction_parts(message: bytes, sequence: int) -> list[dict[str, Any]]:
    """Return one RTCM message as the fields of GPS_RTCM_DATA.

    Bit 0 of the flags states that there are several parts, bits 1 and 2 number them, bits 3 to 7 number the
    messages. A receiver knows the last part by its length: one that is full is followed by an empty one.

    Args:
        message: at most 720 bytes.
        sequence: number of the message, 0 to 31.
    """
    if len(message) <= CORRECTION_PART:
        whole = list(message.ljust(CORRECTION_PART, b"\0"))
        return [{"flags": sequence << 3, "len": len(message), "data": whole}]
    pieces = [message[at : at + CORRECTION_PART] for at in range(0, len(message), CORRECTION_PART)]
    if len(pieces[-1]) == CORRECTION_PART and len(pieces) < CORRECTION_PARTS:
        pieces.append(b"")
    return [
        {
            "flags": 1 | number << 1 | sequence << 3,
            "len": len(piece),
            "data": list(piece.ljust(CORRECTION_PART, b"\0")),
        }
        for number, piece in enumerate(pieces)
    ]
