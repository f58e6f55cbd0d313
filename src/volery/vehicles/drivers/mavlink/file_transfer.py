"""MAVLink FTP as a client: folders are listed, files are read in bursts.

An autopilot sends a burst of some 40 to 120 kB for one request, so that a file is not slowed down by the
delay of a radio; what is lost of it is read again piece by piece.
"""

from __future__ import annotations

import errno
import os
import struct
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from volery.base.errors import Refused, UsageError
from volery.kernel.api import Action
from volery.links.frame import Frame
from volery.vehicles.drivers.mavlink.pending_requests import PendingRequests
from volery.vehicles.services import FileEntry

END, RESET, LIST, OPEN, READ, BURST = 1, 2, 3, 4, 5, 15
ACK, NAK = 128, 129
FAIL_WITH_ERRNO, END_OF_FILE = 2, 6

SIZE, HEADER = 251, 12
PIECE = SIZE - HEADER
"""Bytes of a file in one message."""
MOST_ENTRIES = 100_000
"""Entries of a folder that are listed."""
LARGEST_BURST = 1_000_000
"""Bytes after the requested place that are kept; autopilots send 120 kB at most for one request."""
GAPS_AT_ONCE = 5
"""Pieces that are requested together: ArduPilot keeps five requests."""
_HEAD = struct.Struct("<HBBBBBxI")

_REASONS = {
    1: "it fails, without a reason",
    3: "it takes no request of this size",
    4: "the file is not open any more",
    5: "another program reads a file; it may read one at a time",
    7: "it does not support this operation",
    9: "the file is protected",
    10: "there is no such file or folder",
}


class _Reply(NamedTuple):
    sequence: int
    session: int
    refused: bool
    operation: int
    last: bool
    offset: int
    data: bytes


class FileTransfer:
    """``FileSystem`` of one autopilot on a MAVLink link.

    Args:
        requests: requests in progress.
        name: name of the vehicle, for errors.
        send_to: sends a message to it, given its name and fields.
    """

    def __init__(self, requests: PendingRequests, name: str, send_to: Callable[..., None]) -> None:
        self._requests = requests
        self._name = name
        self._send_to = send_to
        self._sequence = 0
        self._session = 0
        self._size = 0

    def list(self, folder: str) -> list[FileEntry]:
        """See ``FileSystem``."""
        asked = f"list {folder}"
        found: list[FileEntry] = []
        passed, last = 0, b""
        while passed < MOST_ENTRIES:
            reply = self._ask(asked, LIST, self._named(folder), offset=passed)
            if reply is None:
                return found
            entries = [entry for entry in reply.data.split(b"\0") if entry]
            if not entries:
                return found
            if reply.data == last:
                raise Refused(self._name, asked, f"it sends the same entries again, from {passed} on")
            last = reply.data
            passed += len(entries)
            found += [entry for entry in map(_entry, entries) if entry is not None]
        raise Refused(self._name, asked, f"it sends more than {MOST_ENTRIES:,} entries")

    def open(self, path: str) -> int:
        """See ``FileSystem``."""
        reply = self._ask(f"open {path}", OPEN, self._named(path))
        if reply is None or len(reply.data) < 4:
            raise Refused(self._name, f"open {path}", "its answer states no size")
        self._session = reply.session
        self._size = int.from_bytes(reply.data[:4], "little")
        return self._size

    def read(self, path: str, offset: int) -> bytes:
        """See ``FileSystem``."""
        asked = f"read {path} from byte {offset}"
        read = _PartialRead(offset, self._size)

        def gather(send: Action, whole: Callable[[], bool]) -> None:
            self._requests.gather(
                asked,
                send,
                read.take,
                count=lambda: len(read.pieces),
                whole=whole,
                so_far=lambda: f"{len(read.joined())} bytes arrived",
            )

        def request_gaps() -> None:
            for place, size in read.gaps[:GAPS_AT_ONCE]:
                self._request(READ, place, size)

        gather(lambda: self._request(BURST, offset + len(read.joined()), PIECE), lambda: read.ended)
        if read.astray is not None:
            raise Refused(self._name, asked, f"it sends byte {read.astray}, which was not requested")
        if not read.pieces and read.refusal != END_OF_FILE:
            raise Refused(self._name, asked, _reason(read.refusal, b""))
        while read.gaps:
            left = len(read.gaps) - GAPS_AT_ONCE
            gather(request_gaps, partial(read.has_gaps_at_most, max(0, left)))
        return read.joined()

    def close(self) -> None:
        """See ``FileSystem``."""
        self._ask("close the file", END)

    def reset(self) -> None:
        """See ``FileSystem``."""
        self._ask("close files that are open", RESET)

    # -- messages

    def _named(self, path: str) -> bytes:
        octets = path.encode()
        if not octets or len(octets) > PIECE or "\0" in path:
            raise UsageError(f"{self._name}: {path!r} is no path of a file on board: 1 to {PIECE} bytes")
        return octets

    def _request(self, operation: int, offset: int, size: int) -> None:
        self._sequence = self._sequence + 1 & 0xFFFF
        self._put(self._sequence, operation, b"", offset, size)

    def _put(self, sequence: int, operation: int, data: bytes, offset: int, size: int) -> None:
        head = _HEAD.pack(sequence, self._session, operation, size, 0, 0, offset)
        payload = [*head, *data.ljust(PIECE, b"\0")]
        self._send_to("FILE_TRANSFER_PROTOCOL", target_network=0, payload=payload)

    def _ask(self, asked: str, operation: int, data: bytes = b"", offset: int = 0) -> _Reply | None:
        """Return the reply to a request, ``None`` for the end of a file or of a listing."""
        self._sequence = sequence = self._sequence + 1 & 0xFFFF

        def answer(frame: Frame) -> tuple[_Reply | None] | None:
            reply = _reply(frame)
            if reply is None or (reply.sequence, reply.operation) != (sequence + 1 & 0xFFFF, operation):
                return None
            if not reply.refused:
                return (reply,)
            code = _code(reply.data)
            if code == END_OF_FILE:
                return (None,)
            raise Refused(self._name, asked, _reason(code, reply.data))

        unanswered = ": it may not serve its files by MAVLink FTP"
        return self._requests.ask(
            asked,
            lambda: self._put(sequence, operation, data, offset, len(data)),
            answer,
            unanswered=unanswered,
        )[0]


class _PartialRead:
    """The pieces of a file of *size* bytes that have arrived from *offset* on; they may overlap."""

    def __init__(self, offset: int, size: int) -> None:
        self.pieces: dict[int, bytes] = {}
        self.ended = False
        self.refusal = 0
        self.astray: int | None = None
        """Place of a piece that was neither asked for nor follows the others."""
        self._offset, self._size = offset, size
        self._furthest = offset

    def take(self, frame: Frame) -> None:
        """Keep the piece of a file that a frame brings."""
        reply = _reply(frame)
        if reply is None or reply.operation not in (BURST, READ) or reply.offset < self._offset:
            return
        if reply.refused:
            self.ended = True
            self.refusal = _code(reply.data)
        elif reply.data:
            if reply.offset >= min(self._size, self._furthest + LARGEST_BURST):  # a peer may state any place
                self.astray = reply.offset
                self.ended = True
                return
            self._furthest = max(self._furthest, reply.offset + len(reply.data))
            if reply.offset < self._offset + LARGEST_BURST:
                self.pieces[reply.offset] = reply.data
            self.ended = self.ended or reply.last

    def joined(self) -> bytes:
        """Return the bytes up to the first that is missing."""
        joined = bytearray()
        for start in sorted(self.pieces):
            place = self._offset + len(joined)
            if start > place:
                break
            joined += self.pieces[start][place - start :]
        return bytes(joined)

    @property
    def gaps(self) -> list[tuple[int, int]]:
        """Start and size of what is missing before the last piece, at most one message each."""
        missing: list[tuple[int, int]] = []
        place = self._offset
        for start in sorted(self.pieces):
            missing += [(at, min(PIECE, start - at)) for at in range(place, start, PIECE)]
            place = max(place, start + len(self.pieces[start]))
        return missing

    def has_gaps_at_most(self, number: int) -> bool:
        """Return whether at most so many gaps are left."""
        return len(self.gaps) <= number


def _reply(frame: Frame) -> _Reply | None:
    if frame.name != "FILE_TRANSFER_PROTOCOL":
        return None
    payload = bytes(frame.fields["payload"]).ljust(SIZE, b"\0")
    sequence, session, kind, size, operation, last, offset = _HEAD.unpack_from(payload)
    if kind not in (ACK, NAK) or size > PIECE:
        return None
    data = payload[HEADER : HEADER + size]
    return _Reply(sequence, session, kind == NAK, operation, bool(last), offset, data)


def _entry(octets: bytes) -> FileEntry | None:
    """Return an entry of a listing; ``None`` for ``.``, ``..`` and what is neither file nor folder."""
    kind, (octets_of_name, _, size) = octets[:1], octets[1:].partition(b"\t")
    name = octets_of_name.decode("utf-8", "replace")
    if kind not in (b"F", b"D") or name in (".", ".."):
        return None
    return FileEntry(name, int(size) if size.isdigit() else 0, kind == b"D")


def _code(data: bytes) -> int:
    return data[0] if data else 0


def _reason(code: int, data: bytes) -> str:
    if code == FAIL_WITH_ERRNO and len(data) > 1:
        name = errno.errorcode.get(data[1], str(data[1]))
        return f"{os.strerror(data[1])} ({name})"
    return _REASONS.get(code, f"error {code} of MAVLink FTP")
