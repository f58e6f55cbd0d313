"""MAVLink FTP of one vehicle: folders are listed, files are read one by one or as a burst.

The files are read only: what would write is refused, where the originals write. Listings, bursts and
refusals are as recorded of ArduPilot 4.5 and PX4 1.14. A request without an answer makes a client wait for
its time-out, or for ever.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from volery.base.time import MS, Ns
from volery.kernel.api import Handle
from volery.simulation.autopilots.mavlink.channel import Peer
from volery.simulation.autopilots.onboard_log import FlightLog
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

NONE, END, RESET, LIST, OPEN, READ, CHECKSUM, BURST = 0, 1, 2, 3, 4, 5, 14, 15
WRITES = frozenset(range(6, 14))
ACK, NAK = 128, 129
"""Operations of FILE_TRANSFER_PROTOCOL."""

FAIL, BAD_SIZE, NO_SESSION, SESSION_TAKEN, END_OF_FILE, UNKNOWN, NOT_FOUND = 1, 3, 4, 5, 6, 7, 10
"""Error codes of a NAK."""

SIZE, HEADER = 251, 12
PIECE = SIZE - HEADER
AT_ONCE = 50
"""Replies of a burst that are sent at once."""
PERIOD: Ns = 10 * MS
"""Time between them and the next ones."""
_HEAD = struct.Struct("<HBBBBBxI")

Content = Callable[[], bytes]
Encode = Callable[[FlightLog], bytes]


class FilePolicy(NamedTuple):
    """What differs between firmwares."""

    files: Callable[[AutopilotVehicle, Encode], Mapping[str, Content]]
    """Return the files by their paths from the root, given how a log is encoded."""
    relative: bool
    """Whether a path may lack its first slash; an empty one then is no name of a folder."""
    entry_end: bytes
    """What ends an entry of a listing."""
    dots: tuple[bytes, bytes]
    """The entries of the folder itself and of its parent."""
    burst: int
    """Replies to one request for a burst."""
    unopened: int
    """Error code of reading before a file was opened."""
    taken: int
    """Error code of opening a second file."""
    unknown: int
    """Error code of an operation that there is not."""
    own_session: bool
    """Whether sessions are numbered by the autopilot, from 0, and cannot be ended twice."""
    expires: Ns
    """Time without a request after which a file gives way to the next that is opened; 0 for never."""


@dataclass(frozen=True)
class _Request:
    sequence: int
    session: int
    operation: int
    size: int
    offset: int
    data: bytes


class _RefusedError(Exception):
    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class FileService:
    """File system of one vehicle, with one open file, as in the originals.

    Args:
        vehicle: The vehicle.
        policy: What differs between firmwares.
        encode: Returns a log of the vehicle as a file.
    """

    def __init__(self, vehicle: AutopilotVehicle, policy: FilePolicy, encode: Encode) -> None:
        self._vehicle = vehicle
        self._policy = policy
        self._encode = encode
        self._open: bytes | None = None
        self._session = 0
        self._asked_at: Ns = 0
        self._timer: Handle | None = None
        self._last: tuple[tuple[Peer, int, int, int], list[int]] | None = None

    def on_request(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle FILE_TRANSFER_PROTOCOL; a request that is sent again is answered as before.

        Clients number their requests modulo 256, some anew in each session.
        """
        octets = bytes(int(byte) for byte in fields["payload"]).ljust(SIZE, b"\0")
        sequence, session, operation, size, _, _, offset = _HEAD.unpack_from(octets)
        asked = _Request(sequence, session, operation, size, offset, octets[HEADER : HEADER + size])
        said = peer, sequence, session, operation
        if self._last is not None and self._last[0] == said:
            self._send(peer, self._last[1])
            return
        self._last = None
        self._stop()
        now = self._vehicle.kernel.now()
        idle, self._asked_at = now - self._asked_at, now
        if operation == OPEN and self._policy.expires and idle > self._policy.expires:
            self._open = None  # who opened it has gone without an END, or it was lost
        try:
            if size > PIECE:
                raise _RefusedError(BAD_SIZE)
            if operation == BURST:
                self._check_open(session)
                self._burst(peer, asked, offset, 0)
                return
            data, code = self._answer(asked), None
        except _RefusedError as error:
            data, code = bytes((error.code,)), error.code
        payload = self._payload(asked, data, refused=code is not None)
        self._last = (said, payload) if len(data) <= 4 else None
        self._send(peer, payload)

    # -- operations

    def _answer(self, asked: _Request) -> bytes:
        operation = asked.operation
        if operation == LIST:
            return self._list(asked)
        if operation == OPEN:
            return self._opened(asked)
        if operation == READ:
            file = self._check_open(asked.session)
            if asked.offset >= len(file):
                raise _RefusedError(END_OF_FILE)
            return file[asked.offset : asked.offset + asked.size]
        if operation == CHECKSUM:
            return struct.pack("<I", checksum(self._content(asked)))
        if operation in (END, RESET):
            if operation == END and self._policy.own_session:
                self._check_open(asked.session)
            self._open = None
        elif operation != NONE:
            raise _RefusedError(FAIL if operation in WRITES else self._policy.unknown)
        return b""

    def _check_open(self, session: int) -> bytes:
        if self._open is None:
            raise _RefusedError(self._policy.unopened)
        if session != self._session:
            raise _RefusedError(NO_SESSION)
        return self._open

    def _files(self) -> Mapping[str, Content]:
        return self._policy.files(self._vehicle, self._encode)

    def _path(self, asked: _Request) -> str:
        path = asked.data.split(b"\0")[0].split(b"?")[0].decode("utf-8", "replace")
        if self._policy.relative:
            if not path:
                raise _RefusedError(BAD_SIZE)
        elif path and not path.startswith("/"):
            raise _RefusedError(NOT_FOUND)
        return path.strip("/")

    def _content(self, asked: _Request) -> bytes:
        content = self._files().get(self._path(asked))
        if content is None:
            raise _RefusedError(NOT_FOUND)
        return content()

    def _opened(self, asked: _Request) -> bytes:
        if self._open is not None:
            raise _RefusedError(self._policy.taken)
        self._open = self._content(asked)
        self._session = 0 if self._policy.own_session else asked.session
        return struct.pack("<I", len(self._open))

    def _list(self, asked: _Request) -> bytes:
        """Return the entries of a folder from the one that the offset counts to, as many as fit."""
        path = self._path(asked)
        start = f"{path}/" if path else ""
        entries: dict[str, bytes] = {}
        files = self._files()
        for name, content in files.items():
            if not name.startswith(start):
                continue
            first, _, rest = name.removeprefix(start).partition("/")
            if not path and first.startswith("@"):
                continue  # reached by its name only
            entries[first] = f"D{first}".encode() if rest else f"F{first}\t{len(content())}".encode()
        if not entries and path:
            raise _RefusedError(NOT_FOUND)
        rest_of = [*self._policy.dots, *(entries[name] for name in sorted(entries))][asked.offset :]
        if not rest_of:
            raise _RefusedError(END_OF_FILE)
        data = b""
        for entry in rest_of:
            if len(data) + len(entry) + len(self._policy.entry_end) > PIECE:
                break
            data += entry + self._policy.entry_end
        return data

    def _burst(self, peer: Peer, asked: _Request, place: int, sent: int) -> None:
        """Send what is due of a burst: up to the end of the file, or of as many replies as are in one.

        As ArduPilot does, it waits while the link is full: a client that reads slowly asks again meanwhile.
        """
        file, size = self._open, asked.size or PIECE
        if file is None:
            return
        for _ in range(AT_ONCE):
            if not peer.channel.has_room():
                break
            if place >= len(file):
                self._send(peer, self._payload(asked, bytes((END_OF_FILE,)), sent, place, refused=True))
                return
            last = sent + 1 == self._policy.burst
            piece = file[place : place + size]
            self._send(peer, self._payload(asked, piece, sent, place, last=last))
            if last:
                return
            place, sent = place + len(piece), sent + 1
        kernel = self._vehicle.kernel
        self._timer = kernel.call_at(kernel.now() + PERIOD, lambda: self._burst(peer, asked, place, sent))

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    # -- replies

    def _payload(
        self,
        asked: _Request,
        data: bytes,
        number: int = 0,
        offset: int | None = None,
        *,
        refused: bool = False,
        last: bool = False,
    ) -> list[int]:
        """Return a reply; *number* counts those to one request, *last* is the end of a burst."""
        session = self._session if asked.operation == OPEN and not refused else asked.session
        sequence = asked.sequence + 1 + number & 0xFFFF
        kind = NAK if refused else ACK
        place = asked.offset if offset is None else offset
        head = _HEAD.pack(sequence, session, kind, len(data), asked.operation, last, place)
        return [*head, *data.ljust(PIECE, b"\0")]

    @staticmethod
    def _send(peer: Peer, payload: list[int]) -> None:
        peer.answer("FILE_TRANSFER_PROTOCOL", target_network=0, payload=payload)


def checksum(content: bytes) -> int:
    """Return the CRC-32 of MAVLink FTP: it begins at 0 and is not inverted at its end."""
    return zlib.crc32(content, 0xFFFFFFFF) ^ 0xFFFFFFFF
