"""MAVLink FTP as recorded of ArduCopter 4.5 and PX4 1.14 in their simulators on 23 November 2026."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from rigs.station import TARGET, Station
from volery.base.frames import LocalFrame
from volery.base.time import MS
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.simulation.autopilots import ardupilot, px4

ACK, NAK = 128, 129
END, RESET, LIST, OPEN, READ, CREATE, CHECKSUM, BURST = 1, 2, 3, 4, 5, 6, 14, 15
_HEAD = struct.Struct("<HBBBBBxI")


class Bench(Station):
    """A vehicle of either firmware with two logs, and a ground station."""

    home = LocalFrame(47.3977, 8.5456, 488.0)

    def __init__(self, name: str) -> None:
        self.name = name
        self.firmware: Any = {"ardupilot": ardupilot.FIRMWARE, "px4": px4.FIRMWARE}[name]
        super().__init__()
        self.beat()
        self.run(1.0)
        self._sequence = 100

    def ask(
        self, operation: int, data: bytes = b"", offset: int = 0, size: int | None = None, session: int = 0
    ) -> tuple[int, bytes]:
        """Return kind and data of the reply to a request."""
        return self.replies(operation, data, offset, size, session)[0][-2:]

    def replies(
        self, operation: int, data: bytes = b"", offset: int = 0, size: int | None = None, session: int = 0
    ) -> list[tuple[int, int, int, bytes]]:
        """Return offset, completeness, kind and data of all replies; their sequence numbers count up."""
        self._sequence += 1
        before = len(self.of("FILE_TRANSFER_PROTOCOL"))
        size = len(data) if size is None else size
        head = _HEAD.pack(self._sequence, session, operation, size, 0, 0, offset)
        payload = [*head, *data.ljust(239, b"\0")]
        self.send("FILE_TRANSFER_PROTOCOL", **TARGET, target_network=0, payload=payload)
        self.run(0.5)
        return self.heard_since(before, operation)

    def heard_since(self, before: int, operation: int) -> list[tuple[int, int, int, bytes]]:
        """Return the same of what was heard after so many replies."""
        found = []
        for number, one in enumerate(self.of("FILE_TRANSFER_PROTOCOL")[before:]):
            octets = bytes(one.fields["payload"])
            sequence, _, kind, length, asked, complete, place = _HEAD.unpack_from(octets)
            assert (sequence, asked) == (self._sequence + 1 + number, operation)
            found.append((place, complete, kind, octets[12 : 12 + length]))
        assert found
        return found


@pytest.fixture(params=["ardupilot", "px4"])
def rig(request: Any) -> Bench:
    return Bench(request.param)


REFUSED: dict[str, tuple[tuple[Any, ...], dict[str, int | None]]] = {
    "list a missing folder": ((LIST, b"/fs/microsd"), {"ardupilot": 10, "px4": 10}),
    "list from beyond the end": ((LIST, b"/", 99), {"ardupilot": 6, "px4": 6}),
    "list without a name": ((LIST, b""), {"ardupilot": 3, "px4": None}),
    "list a relative name": ((LIST, b"logging"), {"ardupilot": 10, "px4": 10}),
    "open a missing file": ((OPEN, b"/nothing"), {"ardupilot": 10, "px4": 10}),
    "read before opening": ((READ, b"", 0, 80), {"ardupilot": 10, "px4": 4}),
    "end a session that there is not": ((END,), {"ardupilot": None, "px4": 4}),
    "reset": ((RESET,), {"ardupilot": None, "px4": None}),
    "an unknown operation": ((77,), {"ardupilot": 1, "px4": 7}),
    "too long a request": ((LIST, b"/", 0, 250), {"ardupilot": 3, "px4": 3}),
    "write (the originals do)": ((CREATE, b"/new"), {"ardupilot": 1, "px4": 1}),
}


@pytest.mark.parametrize("case", REFUSED)
def test_codes_of_refusals(case: str, rig: Bench) -> None:
    request, codes = REFUSED[case]
    code = codes[rig.name]
    kind, data = rig.ask(*request)
    if code is None:
        assert kind == ACK
    else:
        assert (kind, data) == (NAK, bytes((code,)))


LISTED = {
    "ardupilot": (b"D.\0\0D..\0\0", b"logs", b"D.\0\0D..\0\0F00000001.BIN\t%d\0\0FLASTLOG.TXT\t3\0\0"),
    "px4": (b"S\0S\0", b"log", b"S\0S\0D2026-01-01\0"),
}


def logged(rig: Bench, size: int) -> bytes:
    """Give the vehicle a log of so many bytes; return its path."""
    from volery.simulation.autopilots.onboard_log import FlightLog

    log = FlightLog(12_000_000_000, True, (47.0, 8.0, 400.0), 0.0, ())
    log.encoded = bytes(number % 251 for number in range(size))
    rig.vehicle.logs.append(log)
    return b"/logs/00000001.BIN" if rig.name == "ardupilot" else b"/log/2026-01-01/00_00_12.ulg"


def test_folders_are_listed_in_the_form_of_each(rig: Bench) -> None:
    dots, folder, inside = LISTED[rig.name]
    assert rig.ask(LIST, b"/") == (ACK, dots)
    logged(rig, 700)
    end = b"\0\0" if rig.name == "ardupilot" else b"\0"
    assert rig.ask(LIST, b"/") == (ACK, dots + b"D" + folder + end)
    assert rig.ask(LIST, b"/", 2) == (ACK, b"D" + folder + end)
    assert rig.ask(LIST, b"/" + folder) == (ACK, inside % 700 if b"%d" in inside else inside)


def test_a_file_is_read_by_pieces_and_to_its_end(rig: Bench) -> None:
    path = logged(rig, 700)
    assert rig.ask(OPEN, path) == (ACK, (700).to_bytes(4, "little"))
    assert rig.ask(OPEN, path) == (NAK, bytes((1 if rig.name == "ardupilot" else 5,)))
    assert rig.ask(READ, b"", 5, 10) == (ACK, bytes(range(5, 15)))
    assert rig.ask(READ, b"", 690, 80) == (ACK, bytes(number % 251 for number in range(690, 700)))
    assert rig.ask(READ, b"", 700, 80) == (NAK, b"\x06")
    assert rig.ask(READ, b"", 0, 80, session=1) == (NAK, b"\x04")
    burst = rig.replies(BURST, b"", 100, 239)
    assert [(place, complete, kind, len(data)) for place, complete, kind, data in burst] == [
        (100, 0, ACK, 239),
        (339, 0, ACK, 239),
        (578, 0, ACK, 122),
        (700, 0, NAK, 1),
    ]
    assert rig.ask(END) == (ACK, b"")
    kind, data = rig.ask(CHECKSUM, path)
    assert (kind, len(data)) == (ACK, 4)


def test_a_burst_ends_after_so_many_replies(rig: Bench) -> None:
    path = logged(rig, 200_000)
    rig.ask(OPEN, path)
    burst = rig.replies(BURST, b"", 0, 239)
    assert len(burst) == (500 if rig.name == "ardupilot" else 168)
    assert [complete for _, complete, _, _ in burst] == [*[0] * (len(burst) - 1), 1]


class Filling:
    """The vehicle's end of a link that is full while ``room`` is 0; each message takes one of it."""

    name = "slow"

    def __init__(self, end: Any) -> None:
        self._end = end
        self.room = 0
        self.receive, self.problem, self.close = end.receive, end.problem, end.close

    def has_room(self) -> bool:
        return self.room > 0

    def send(self, frame: Frame) -> None:
        if frame.name == "FILE_TRANSFER_PROTOCOL":
            self.room -= 1
        self._end.send(frame)


def test_a_burst_waits_while_the_link_is_full(rig: Bench) -> None:
    path = logged(rig, 2390)
    ours, theirs = in_process_pair(rig.kernel, MS, "slow")
    slow = Filling(theirs)
    rig.autopilot.connect(slow)
    ours.receive(rig._hear)
    rig.link = ours
    rig.ask(OPEN, path)
    slow.room = 4
    burst = rig.replies(BURST, b"", 0, 239)
    assert [place for place, *_ in burst] == [0, 239, 478, 717]
    slow.room = 100
    rig.run(0.5)
    whole = rig.heard_since(1, BURST)
    assert [place for place, *_ in whole] == [*range(0, 2390, 239), 2390]


def test_a_number_counts_within_its_session_only(rig: Bench) -> None:
    path = logged(rig, 700)
    rig.ask(OPEN, path, session=1)
    rig.ask(END, session=0 if rig.name == "px4" else 1)
    rig._sequence -= 1
    assert rig.ask(OPEN, path, session=2) == (ACK, (700).to_bytes(4, "little"))


def test_a_file_that_nobody_reads_gives_way(rig: Bench) -> None:
    path = logged(rig, 700)
    rig.ask(OPEN, path)
    rig.run(4.0)
    later = rig.ask(OPEN, path, session=1)
    assert later == ((ACK, (700).to_bytes(4, "little")) if rig.name == "ardupilot" else (NAK, b"\x05"))


def test_a_request_that_is_sent_again_is_answered_as_before(rig: Bench) -> None:
    path = logged(rig, 700)
    first = rig.ask(OPEN, path)
    rig._sequence -= 1
    assert rig.ask(OPEN, path) == first
