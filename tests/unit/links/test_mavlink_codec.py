from __future__ import annotations

import pytest
from pymavlink.dialects.v10 import ardupilotmega as dialect_v1
from pymavlink.dialects.v20 import ardupilotmega as dialect

from volery.links.frame import Frame
from volery.links.mavlink_codec import (
    CHECKSUM,
    HEADER,
    SIGNED,
    MavlinkParser,
    SignedMavlink,
    _Packet,
    encode,
    frame_length,
    quantised,
)
from volery.links.mavlink_messages import MavlinkMessageType, message_type

BEAT = encode(Frame("HEARTBEAT", {"type": 2, "autopilot": 3, "base_mode": 81, "mavlink_version": 3}, 1, 1), 0)
BOOT = b"\n\nInit ArduCopter V4.5.6 (7ce11b41)\n\nFree RAM: 131072\nBooting 0/0\n"


def old_beat() -> bytes:
    sender = dialect_v1.MAVLink(None, srcSystem=1, srcComponent=1)
    return bytes(dialect_v1.MAVLink_heartbeat_message(2, 3, 81, 0, 4, 3).pack(sender))


def test_the_text_of_a_booting_autopilot_is_skipped_and_kept() -> None:
    parser = MavlinkParser()
    assert [frame.name for frame in parser.feed(BOOT + BEAT + b"Init Gyro" + BEAT)] == ["HEARTBEAT"] * 2
    assert "Init ArduCopter V4.5.6 (7ce11b41)" in parser.statistics.lines
    assert parser.problem() == ""


def test_frames_come_whole_however_the_bytes_are_cut() -> None:
    parser = MavlinkParser()
    frames = [frame for octet in BOOT + BEAT + BEAT for frame in parser.feed(bytes([octet]))]
    assert [frame.fields["base_mode"] for frame in frames] == [81, 81]


def test_a_turned_bit_costs_one_frame() -> None:
    broken = bytearray(BEAT)
    broken[12] ^= 4
    parser = MavlinkParser()
    assert len(parser.feed(bytes(broken) + BEAT)) == 1
    assert parser.statistics.corrupt == 1


def test_a_signature_is_passed_over() -> None:
    signing = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    signing.signing.secret_key = b"k" * 32
    signing.signing.sign_outgoing = True
    signing.signing.timestamp = 1
    signed = bytes(dialect.MAVLink_heartbeat_message(2, 3, 81, 0, 4, 3).pack(signing))
    assert len(signed) > len(BEAT)
    assert [frame.name for frame in MavlinkParser().feed(signed + BEAT)] == ["HEARTBEAT"] * 2


def test_a_message_that_the_dialect_lacks_is_counted() -> None:
    header = HEADER.pack(0xFD, 3, 0, 0, 0, 1, 1, 0xFFF0, 0)
    parser = MavlinkParser()
    assert [frame.name for frame in parser.feed(header + b"abc" + CHECKSUM.pack(7) + BEAT)] == ["HEARTBEAT"]
    assert parser.statistics.unknown == 1


def test_mavlink_1_is_read_and_named_as_the_problem_until_mavlink_2_comes() -> None:
    parser = MavlinkParser()
    (frame,) = parser.feed(old_beat())
    assert (frame.name, frame.fields["autopilot"], frame.system) == ("HEARTBEAT", 3, 1)
    assert "MAVLink 1 only: set SERIALx_PROTOCOL=2" in parser.problem()
    parser.feed(BEAT)
    assert parser.problem() == ""


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", ""),
        (b"SSH-2.0-OpenSSH_9.6\r\n", "only text arrives: 'SSH-2.0-OpenSSH_9.6'"),
        (b"login: ", "only text arrives: 'login: '"),
        (bytes(range(128, 200)) * 3, "216 bytes arrive but no MAVLink"),
        (b"".join(BEAT[:-1] + b"\x00" for _ in range(5)) + b"\0" * 300, "no whole MAVLink frame (5 corrupt"),
    ],
)
def test_problem_describes_the_received_bytes(data: bytes, expected: str) -> None:
    parser = MavlinkParser()
    assert parser.feed(data) == []
    assert expected in parser.problem()
    assert bool(expected) == bool(parser.problem())


def test_a_broken_connection_leaves_no_half_frame() -> None:
    parser = MavlinkParser()
    parser.feed(BEAT[:10])
    parser.reset()
    assert len(parser.feed(BEAT)) == 1


UNKNOWN_V1 = bytes((0xFE, 3, 0, 1, 1, 145))
"""The header of a MAVLink 1 frame of a message that the dialect lacks."""


def test_noise_that_looks_like_mavlink_1_is_no_frame() -> None:
    parser = MavlinkParser()
    noise = UNKNOWN_V1 + bytes(11) + bytes((0xFE, 0xFE, 0, 1, 1, 145)) + bytes(11)
    assert len(parser.feed(noise + BEAT)) == 1
    received = parser.statistics
    assert (received.unknown, received.garbage, received.octets) == (0, len(noise), len(noise) + len(BEAT))


def test_six_bytes_decide_about_a_header_of_mavlink_1() -> None:
    parser = MavlinkParser()
    parser.feed(UNKNOWN_V1[:-1])
    assert parser.statistics.garbage == 0
    parser.feed(UNKNOWN_V1[-1:])
    assert parser.statistics.garbage == len(UNKNOWN_V1)


@pytest.mark.parametrize("before", [0, 1, 8, 300])
def test_the_length_of_a_frame_anywhere_in_the_data(before: int) -> None:
    for frame in (BEAT, old_beat()):
        data = bytes(before) + frame
        assert frame_length(data + BEAT, before) == len(frame)
        assert frame_length(data, before) == len(frame)
        assert frame_length(data[:-1], before) == 0
        assert frame_length(data[:-1] + b"\0", before) == 0
        assert frame_length(data, before + 1) == 0


def test_a_frame_or_two_of_an_unknown_kind_are_chance_and_three_another_dialect() -> None:
    parser = MavlinkParser()
    parser.statistics.octets = 90
    for unknown, said in ((2, "no MAVLink: another protocol"), (3, "3 of unknown kind")):
        parser.statistics.unknown = unknown
        assert said in parser.problem()


def test_a_quantised_frame_is_what_arrives():
    sent = Frame("STATUSTEXT", {"severity": 4, "text": "x" * 60}, 7, 3)
    assert quantised(sent) == MavlinkParser().feed(encode(sent, 5))[0]
    assert quantised(sent).fields["text"] == "x" * 50
    third = quantised(Frame("ATTITUDE", {"roll": 1 / 3}, 1, 1)).fields
    assert third["roll"] != 1 / 3
    assert third["roll"] == pytest.approx(1 / 3)
    assert third["yaw"] == 0.0


def with_extension_fields(kind: MavlinkMessageType, extra: bytes, flags: int = 0) -> bytes:
    """Return a frame of *kind* as a sender with a newer definition sends it; without its signature."""
    payload = bytes(1 + number % 100 for number in range(kind.size)) + extra
    low, high = kind.id & 0xFFFF, kind.id >> 16
    header = HEADER.pack(0xFD, len(payload), flags, 0, 9, 1, 1, low, high)
    return header + payload + CHECKSUM.pack(kind.checksum(header[1:] + payload))


@pytest.mark.parametrize("signed", [False, True])
def test_every_message_is_read_where_a_newer_sender_adds_fields(signed: bool) -> None:
    theirs, ours = SignedMavlink(b"k" * 32), SignedMavlink(b"k" * 32)
    parser = ours.parser() if signed else MavlinkParser()
    for kind in (message_type(one.msgname) for one in dialect.mavlink_map.values()):
        known = kind.unpack(bytes(1 + number % 100 for number in range(kind.size)))
        for extra in (b"\1", b"\0\0\7\0", bytes(range(1, 256 - kind.size))):
            if not extra or kind.size + len(extra) > 255:
                continue
            frame = with_extension_fields(kind, extra, SIGNED if signed else 0)
            frame = _Packet(frame).signed(theirs._mavlink) if signed else frame
            assert frame_length(frame, 0) == len(frame)
            (found,) = parser.feed(frame)
            assert (found.name, found.fields) == (kind.name, known), kind.name
    assert parser.statistics.garbage == 0


def test_mavlink_1_has_no_extension_fields() -> None:
    payload = bytes(range(1, 11))  # a heartbeat has nine bytes
    covered = bytes((10, 0, 1, 1, 0)) + payload
    frame = b"\xfe" + covered + CHECKSUM.pack(message_type("HEARTBEAT").checksum(covered))
    assert frame_length(frame, 0) == 0
    assert len(MavlinkParser().feed(frame + BEAT)) == 1
