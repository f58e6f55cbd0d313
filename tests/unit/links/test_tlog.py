from __future__ import annotations

import struct
from pathlib import Path

from pymavlink import mavutil

from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.mavlink_codec import encode
from volery.links.tlog import LoggedFrame, TlogTap, has_links, read_tlog

BEAT = Frame("HEARTBEAT", {"type": 2, "autopilot": 3, "custom_mode": 4, "mavlink_version": 3}, 1, 1)
ARM = Frame("COMMAND_LONG", {"target_system": 1, "command": 400, "param1": 1.0}, 255, 190)


def record(path: Path) -> None:
    kernel = VirtualKernel()
    ours, theirs = in_process_pair(kernel, 5 * MS, "radio")
    tap = TlogTap(kernel, ours, path, epoch_us=1_700_000_000_000_000)
    tap.receive(lambda frame: None)
    theirs.send(BEAT)
    kernel.call_at(S, lambda: tap.send(ARM))
    kernel.run(2 * S)
    tap.close()


def test_both_directions_are_read_back(tmp_path: Path) -> None:
    record(tmp_path / "flight.tlog")
    entries = list(read_tlog(tmp_path / "flight.tlog"))
    assert [
        (entry.at_us - 1_700_000_000_000_000, entry.frame.name, entry.frame.system) for entry in entries
    ] == [
        (5_000, "HEARTBEAT", 1),
        (1_000_000, "COMMAND_LONG", 255),
    ]


def test_other_programs_read_it(tmp_path: Path) -> None:
    record(tmp_path / "flight.tlog")
    log = mavutil.mavlink_connection(str(tmp_path / "flight.tlog"), dialect="ardupilotmega")
    assert [log.recv_msg().get_type() for _ in range(2)] == ["HEARTBEAT", "COMMAND_LONG"]
    log.close()


def test_damage_and_a_cut_end_are_passed_over(tmp_path: Path) -> None:
    good = struct.pack(">Q", 7) + encode(BEAT, 0)
    path = tmp_path / "damaged.tlog"
    path.write_bytes(good + b"\xfd\x09 noise \xfe" + good + good[:-4])
    assert [entry.at_us for entry in read_tlog(path)] == [7, 7]


def test_the_two_lowest_bits_of_our_stamps_are_the_link(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    kernel = VirtualKernel()
    ours, _ = in_process_pair(kernel, 5 * MS, "radio")
    tap = TlogTap(kernel, ours, path, epoch_us=1_700_000_000_000_003, number=2)
    for number in range(5):
        kernel.call_at(number * 7777, lambda: tap.send(ARM))
    kernel.run(S)
    tap.close()
    assert [entry.at_us & 3 for entry in read_tlog(path)] == [2] * 5


def test_links_are_told_from_microseconds_by_the_sequence_of_the_frames() -> None:
    def entries(links: int) -> list[LoggedFrame]:
        found = [LoggedFrame(4 * number, BEAT, number % 256) for number in range(300)]
        if links == 2:
            found += [LoggedFrame(4 * (number + 40) + 1, BEAT, number % 256) for number in range(300)]
        return sorted(found, key=lambda one: one.at_us)

    assert has_links(entries(2))
    assert not has_links(entries(1))
    assert not has_links([LoggedFrame(number * 12345, BEAT, number % 256) for number in range(300)])
