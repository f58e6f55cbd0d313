"""MAVLink FTP with a peer that lies: nothing grows without a bound, and the error says what it does."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import pytest

from volery.base.errors import Refused
from volery.links.frame import Frame
from volery.vehicles.drivers.mavlink import file_transfer
from volery.vehicles.drivers.mavlink.file_transfer import ACK, BURST, LIST, OPEN, READ, FileTransfer

HEAD = struct.Struct("<HBBBBBxI")
Reply = Callable[[int, int], tuple[bytes, int]]
"""Takes an operation and its offset; returns data and the offset that is stated with it."""


class Peer:
    """Answers each request at once, in the place of the link and of what waits for answers."""

    def __init__(self, reply: Reply) -> None:
        self._reply = reply
        self._answer = Frame("HEARTBEAT", {}, 1, 1)
        self.asked = 0

    def send_to(self, name: str, **fields: Any) -> None:
        sequence, session, operation, _, _, _, offset = HEAD.unpack_from(bytes(fields["payload"]))
        data, place = self._reply(operation, offset)
        last = int(operation == BURST)
        head = HEAD.pack(sequence + 1, session, ACK, len(data), operation, last, place)
        self._answer = Frame(name, {"payload": [*head, *data.ljust(239, b"\0")]}, 1, 1)
        self.asked += 1

    def ask(self, asked: str, send: Callable[[], None], answer: Callable[[Frame], Any], **_: Any) -> Any:
        send()
        return answer(self._answer)

    def gather(
        self, asked: str, send: Callable[[], None], take: Callable[[Frame], None], **more: Any
    ) -> None:
        for _ in range(10):
            send()
            take(self._answer)
            if more["whole"]():
                return
        raise TimeoutError(asked)


def transfer(reply: Reply) -> tuple[Peer, FileTransfer]:
    peer = Peer(reply)
    return peer, FileTransfer(peer, "it", peer.send_to)  # type: ignore[arg-type]


def test_a_listing_without_end_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_transfer, "MOST_ENTRIES", 1000)

    def endless(operation: int, offset: int) -> tuple[bytes, int]:
        assert operation == LIST
        return b"".join(b"Fa%d\t1\0" % number for number in range(offset, offset + 12)), offset

    peer, files = transfer(endless)
    with pytest.raises(Refused, match="more than 1,000 entries"):
        files.list("/")
    assert peer.asked < 100


def test_a_listing_that_repeats_itself_is_refused_at_once() -> None:
    peer, files = transfer(lambda operation, offset: (b"Da\0", offset))
    with pytest.raises(Refused, match="the same entries again, from 1 on"):
        files.list("/")
    assert peer.asked == 2


def test_a_piece_far_behind_the_requested_place_ends_the_transfer() -> None:
    def far(operation: int, offset: int) -> tuple[bytes, int]:
        if operation == OPEN:
            return struct.pack("<I", 0xFFFFFFFF), 0
        return b"x" * 100, 0xFFFFFF00 if operation == BURST else offset

    peer, files = transfer(far)
    assert files.open("/big") == 0xFFFFFFFF
    with pytest.raises(Refused, match="byte 4294967040, which was not requested"):
        files.read("/big", 0)
    assert peer.asked == 2


def test_a_piece_behind_the_announced_size_ends_the_transfer() -> None:
    def behind(operation: int, offset: int) -> tuple[bytes, int]:
        if operation == OPEN:
            return struct.pack("<I", 10), 0
        assert operation in (BURST, READ)
        return b"x" * 10, 500_000

    _, files = transfer(behind)
    files.open("/small")
    with pytest.raises(Refused, match="byte 500000"):
        files.read("/small", 0)
