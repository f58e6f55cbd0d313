from __future__ import annotations

import math

import pytest

from volery.base.errors import UsageError
from volery.links.frame import Frame
from volery.links.mavlink_codec import encode as mavlink
from volery.links.pprzlink_codec import PPRZLINK, PprzlinkParser, checksum, encode, quantised
from volery.links.pprzlink_messages import entry_name, entry_value, message_type, parse_definitions

ALIVE = bytes.fromhex("99 0C 07 00 01 02 03 00 01 02 1C C4")
"""The example of the protocol's own documentation: ALIVE of aircraft 7 with md5sum [0, 1, 2]."""

SETPOINT = Frame("GUIDED_SETPOINT_NED", {"ac_id": 7, "flags": 0x60, "x": 1.5, "z": -0.5, "yaw": 0.25}, 0, 0)


def old(message: str, **fields: object) -> bytes:
    """In version 1.0: without destination and class."""
    kind = message_type(message)
    payload = kind.pack(fields)
    body = bytes((len(payload) + 6, 7, kind.id)) + payload
    return b"\x99" + body + checksum(body)


def test_the_example_of_the_documentation_both_ways() -> None:
    frame = Frame("ALIVE", {"md5sum": (0, 1, 2)}, 7, 0)
    assert encode(frame) == ALIVE
    assert PPRZLINK.parser().feed(ALIVE) == [frame]


def test_a_datalink_message_is_addressed_to_its_aircraft() -> None:
    data = encode(SETPOINT)
    assert data[:6] == bytes((0x99, 8 + 18, 0, 7, 2, 40))
    (arrived,) = PprzlinkParser().feed(data)
    assert arrived == Frame(
        "GUIDED_SETPOINT_NED", {"ac_id": 7, "flags": 0x60, "x": 1.5, "y": 0.0, "z": -0.5, "yaw": 0.25}, 0, 0
    )


def test_one_without_an_aircraft_goes_to_all() -> None:
    assert encode(Frame("PING", {}, 0, 0)) == bytes((0x99, 8, 0, 255, 2, 8)) + checksum(
        b"\x08\x00\xff\x02\x08"
    )


def test_the_component_travels_beside_the_class() -> None:
    data = encode(Frame("ALIVE", {}, 7, 3))
    assert data[4] == 0x31
    assert PprzlinkParser().feed(data)[0].component == 3


def test_frames_come_whole_however_the_bytes_are_cut() -> None:
    parser = PprzlinkParser()
    noise = b"boot\r\n\x99\x05\x00"
    frames = [frame for octet in noise + ALIVE + encode(SETPOINT) for frame in parser.feed(bytes([octet]))]
    assert [frame.name for frame in frames] == ["ALIVE", "GUIDED_SETPOINT_NED"]
    assert parser.problem() == ""
    assert "boot" in parser.statistics.lines


def test_a_turned_bit_costs_one_frame() -> None:
    broken = bytearray(encode(SETPOINT))
    broken[9] ^= 4
    parser = PprzlinkParser()
    assert [frame.name for frame in parser.feed(bytes(broken) + ALIVE + ALIVE)] == ["ALIVE", "ALIVE"]
    assert parser.statistics.corrupt == 1


def test_texts_and_arrays_arrive_as_they_were() -> None:
    text = Frame("INFO_MSG", {"msg": "Störung ä"}, 7, 0)
    channels = Frame("RC_UP", {"ac_id": 7, "channels": (-128, 0, 127)}, 0, 0)
    assert PprzlinkParser().feed(encode(text) + encode(channels)) == [text, channels]
    assert quantised(channels) == channels


def test_a_text_that_is_no_utf_8_is_decoded_with_replacements() -> None:
    data = bytearray(encode(Frame("INFO_MSG", {"msg": "wind"}, 7, 0)))
    data[data.index(b"w")] = 0xFF
    data[-2:] = checksum(data[1:-2])
    (arrived,) = PprzlinkParser().feed(bytes(data))
    assert arrived.fields["msg"] == "\ufffdind"


def test_a_text_that_has_no_utf_8_is_encoded_with_replacements() -> None:
    (arrived,) = PprzlinkParser().feed(encode(Frame("INFO_MSG", {"msg": "a\ud800"}, 7, 0)))
    assert arrived.fields["msg"] == "a?"


def test_arrays_of_fixed_length_have_no_count() -> None:
    (kind,) = parse_definitions("=== telemetry 1\n9 POSE: quat float[4], tag char[3], flag char\n")
    payload = kind.pack({"quat": (1.0, 0.5), "tag": "abcdef", "flag": "x"})
    assert len(payload) == 20
    assert kind.unpack(payload) == {"quat": (1.0, 0.5, 0.0, 0.0), "tag": "abc", "flag": "x"}
    assert kind.unpack(payload[:-1]) is None
    assert kind.unpack(payload + b"!") is None


def test_values_are_those_of_the_wire() -> None:
    fields = quantised(Frame("DL_VALUE", {"index": 3, "value": 0.1}, 7, 0)).fields
    assert fields["value"] != 0.1
    assert math.isclose(fields["value"], 0.1, rel_tol=1e-6)


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        (Frame("ALIV", {}, 7, 0), "no message 'ALIV' here (did you mean 'ALIVE'?)"),
        (Frame("BLOCK", {"block": 3}, 0, 0), "BLOCK has no field 'block' (did you mean 'block_id'?)"),
        (Frame("BLOCK", {"block_id": 300}, 0, 0), "BLOCK: a field does not fit"),
        (Frame("BLOCK", {"block_id": "four"}, 0, 0), "BLOCK: a field does not fit"),
        (Frame("SETTING", {"value": 1e39}, 0, 0), "SETTING: a field does not fit"),
        (
            Frame("INFO_MSG", {"msg": "x" * 250}, 7, 0),
            "INFO_MSG: too long: 251 bytes, a frame has room for 247",
        ),
        (Frame("INFO_MSG", {"msg": "x" * 400}, 7, 0), "INFO_MSG: a field does not fit"),
        (Frame("ALIVE", {}, 700, 0), "ALIVE from system 700, component 0: ids are 0 to 255"),
        (Frame("ALIVE", {}, 7, 16), "components 0 to 15"),
    ],
)
def test_what_cannot_be_written_is_refused_by_name(frame: Frame, expected: str) -> None:
    with pytest.raises(UsageError) as raised:
        PPRZLINK.encode(frame, 0)
    assert expected in str(raised.value)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", ""),
        (ALIVE, ""),
        (mavlink(Frame("HEARTBEAT", {"type": 2}, 1, 1), 0), "MAVLink arrives, not pprzlink"),
        (old("ALIVE", md5sum=(0, 1, 2)), "pprzlink 1.0 arrives; build the aircraft with pprzlink 2.0"),
        (old("ROTORCRAFT_FP", east=256), "pprzlink 1.0 arrives"),
        (b"SSH-2.0-OpenSSH_9.6\r\n", "only text arrives: 'SSH-2.0-OpenSSH_9.6'"),
        (bytes(range(160, 200)) * 3, "120 bytes arrive but no pprzlink: another protocol, or the wrong baud"),
        ((ALIVE[:-1] + b"\x00") * 4, "4 corrupt frames: noise, or the wrong baud rate"),
        (
            b"\x99\x09\x07\x00\x01\x93\x00" + checksum(b"\x09\x07\x00\x01\x93\x00"),
            "ROTORCRAFT_FP has another length there: other message definitions",
        ),
    ],
)
def test_problem_describes_the_received_bytes(data: bytes, expected: str) -> None:
    parser = PprzlinkParser()
    parser.feed(data)
    assert expected in parser.problem()
    assert bool(expected) == bool(parser.problem())


def test_a_broken_connection_leaves_no_half_frame() -> None:
    parser = PprzlinkParser()
    parser.feed(ALIVE[:7])
    parser.reset()
    assert len(parser.feed(ALIVE)) == 1


def test_words_of_the_protocol() -> None:
    assert entry_name("ROTORCRAFT_STATUS", "ap_mode", 19) == "GUIDED"
    assert entry_name("ROTORCRAFT_STATUS", "ap_mode", 200) == "200"
    assert entry_value("EMERGENCY_CMD", "cmd", "LAND") == 2
    with pytest.raises(UsageError, match=r"has no 'GUIDE' .did you mean 'GUIDED'"):
        entry_value("ROTORCRAFT_STATUS", "ap_mode", "GUIDE")
