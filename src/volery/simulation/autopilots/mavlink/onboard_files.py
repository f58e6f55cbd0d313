"""Files and the shell of a simulated autopilot. There are none, and each request is answered so.

The exception is ``@PARAM/param.pck`` of an ArduPilot, its parameters packed into one file, which ground
stations read in place of a list of 1,400 messages. A request without an answer makes a client wait for its
time-out, or for ever.
"""

from __future__ import annotations

import struct
from typing import Any

from volery.simulation.autopilots.autopilot_parameters import INT8, INT16, INT32, Parameters
from volery.simulation.autopilots.mavlink.channel import Peer
from volery.simulation.autopilots.vehicle_state import Vehicle

SESSION_END, SESSION_RESET, LIST, OPEN_READ, READ, CHECKSUM, BURST = 1, 2, 3, 4, 5, 14, 15
ACK, NAK = 128, 129
"""Operations of FILE_TRANSFER_PROTOCOL."""

FAIL, END_OF_FILE, UNKNOWN, NOT_FOUND = 1, 6, 7, 10
"""Error codes of a NAK."""

READS = frozenset({5, 15})
WRITES = frozenset({6, 7, 8, 9, 10, 11, 12, 13})
FTP_SIZE, HEADER = 251, 12
PIECE = FTP_SIZE - HEADER
PACKED = b"@PARAM/param.pck"
_MAGIC = 0x671B
_PACKED_TYPES = {INT8: (1, "<b"), INT16: (2, "<h"), INT32: (3, "<i")}
_PACKED_REAL = (4, "<f")

SHELL, REPLY = 10, 1
"""SERIAL_CONTROL_DEV of the shell, SERIAL_CONTROL_FLAG of an answer."""

SHELL_SIZE = 70
PROMPT = b"nsh> "


def _ftp_reply(asked: list[int], error: int | None) -> list[int]:
    """Return the payload of a reply.

    Args:
        asked: Payload of the request.
        error: Error code of a refusal; ``None``: an acknowledgement.
    """
    number = (asked[0] | asked[1] << 8) + 1 & 0xFFFF
    data = [] if error is None else [error]
    head = [number & 0xFF, number >> 8, asked[2], ACK if error is None else NAK, len(data), asked[3]]
    return [*head, 0, 0, *asked[8:HEADER], *data, *([0] * (FTP_SIZE - HEADER - len(data)))]


def _ftp_error(asked: list[int]) -> int | None:
    """Return the error of an operation on an empty file system."""
    operation = asked[3]
    if operation in (0, SESSION_END, SESSION_RESET):
        return None
    if operation == LIST:
        name = bytes(asked[HEADER : HEADER + asked[4]]).strip(b"/\0")
        return END_OF_FILE if name in (b"", b".") else NOT_FOUND
    if operation in (OPEN_READ, CHECKSUM):
        return NOT_FOUND
    return FAIL if operation in READS | WRITES else UNKNOWN


def packed_parameters(parameters: Parameters) -> bytes:
    """Return ``param.pck`` as AP_Filesystem_Param writes it: names are stated from where they differ."""
    rows, before = [], ""
    for name, kind, value, _ in parameters:
        number, form = _PACKED_TYPES.get(kind, _PACKED_REAL)
        differs = (at for at, (one, other) in enumerate(zip(before, name, strict=False)) if one != other)
        shared = min(next(differs, min(len(before), len(name))), 15, len(name) - 1)
        head = bytes((number, shared | len(name) - shared - 1 << 4))
        rows.append(head + name[shared:].encode() + struct.pack(form, value if form == "<f" else int(value)))
        before = name
    return struct.pack("<HHH", _MAGIC, len(rows), len(rows)) + b"".join(rows)


def on_file_transfer_with_parameters(vehicle: Vehicle, fields: dict[str, Any], sender: Peer) -> None:
    """Handle FILE_TRANSFER_PROTOCOL where the packed parameters can be read; they are the only file."""
    asked = [int(byte) for byte in fields["payload"]]
    asked += [0] * (FTP_SIZE - len(asked))
    operation, offset = asked[3], int.from_bytes(bytes(asked[8:HEADER]), "little")
    name = bytes(asked[HEADER : HEADER + asked[4]]).split(b"?")[0].strip(b"\0").lstrip(b"/")
    if operation == OPEN_READ and name == PACKED:
        size = len(packed_parameters(vehicle.parameters))
        replies = [_data_reply(asked, offset, struct.pack("<I", size))]
    elif operation in (READ, BURST):
        replies = _pieces(asked, offset, packed_parameters(vehicle.parameters))
    else:
        on_file_transfer(vehicle, fields, sender)
        return
    for payload in replies:
        sender.answer("FILE_TRANSFER_PROTOCOL", target_network=0, payload=payload)


def _pieces(asked: list[int], offset: int, content: bytes) -> list[list[int]]:
    """Return the replies to a read, or to a burst up to the end of the file; beyond it a refusal."""
    if offset >= len(content):
        return [_ftp_reply(asked, END_OF_FILE)]
    size = min(asked[4] or PIECE, PIECE)
    end = len(content) if asked[3] == BURST else offset + 1
    starts = range(offset, end, size)
    return [
        _data_reply(asked, start, content[start : start + size], number, start + size >= len(content))
        for number, start in enumerate(starts)
    ]


def _data_reply(asked: list[int], offset: int, data: bytes, number: int = 0, last: bool = False) -> list[int]:
    """Return an acknowledgement with data; *number* counts the replies to one request."""
    sequence = (asked[0] | asked[1] << 8) + 1 + number & 0xFFFF
    head = [sequence & 0xFF, sequence >> 8, asked[2], ACK, len(data), asked[3], int(last), 0]
    return [*head, *offset.to_bytes(4, "little"), *data, *([0] * (PIECE - len(data)))]


def on_file_transfer(_vehicle: Vehicle, fields: dict[str, Any], sender: Peer) -> None:
    """Handle FILE_TRANSFER_PROTOCOL: the directory is empty."""
    asked = [int(byte) for byte in fields["payload"]]
    asked += [0] * (FTP_SIZE - len(asked))
    sender.answer("FILE_TRANSFER_PROTOCOL", target_network=0, payload=_ftp_reply(asked, _ftp_error(asked)))


def on_shell(_vehicle: Vehicle, fields: dict[str, Any], sender: Peer) -> None:
    """Handle SERIAL_CONTROL: the shell has no commands; other devices do not exist."""
    if fields["device"] != SHELL or fields["flags"] & REPLY:
        return
    typed = bytes(int(byte) for byte in fields["data"][: fields["count"]])
    lines = typed.decode("ascii", "replace").splitlines()
    words = [line.split(maxsplit=1)[0] for line in lines if line.strip()]
    reply = b"".join(f"nsh: {word}: command not found\n".encode() for word in words) + PROMPT
    for start in range(0, len(reply), SHELL_SIZE):
        piece = reply[start : start + SHELL_SIZE]
        data = [*piece, *([0] * (SHELL_SIZE - len(piece)))]
        fields = {"device": SHELL, "flags": REPLY, "timeout": 0, "baudrate": 0, "count": len(piece)}
        sender.send("SERIAL_CONTROL", {**fields, "data": data})
