"""Messages that pymavlink lacks: their form follows from names and types, and is that of recorded bytes."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from volery.links.frame import Frame
from volery.links.mavlink_codec import MavlinkParser, encode
from volery.links.mavlink_messages import NEWER_MESSAGES, FieldDefinition, MessageDefinition, message_type

RECORDED = (
    ("EVENT", "fd1e00007903019a0100e093a80120080000f7ff000088000000100080000000c02b81ffc02b81ffc610"),
    ("EVENT", "fd1200007a03019a01008f749f0120080000f8ff0000223ed07e00146911"),
    ("CURRENT_EVENT_SEQUENCE", "fd0300002503019b0100f6ff01ee37"),
    ("CURRENT_EVENT_SEQUENCE", "fd0300000701019b0100f6ff01ef58"),
)


@pytest.mark.parametrize(("name", "recorded"), RECORDED)
def test_recorded_bytes_are_read_and_written_again(name: str, recorded: str) -> None:
    raw = bytes.fromhex(recorded)
    parser = MavlinkParser()
    (frame,) = parser.feed(raw)
    assert (frame.name, parser.statistics.corrupt) == (name, 0)
    assert encode(frame, raw[4]) == raw


@pytest.mark.parametrize(
    "definition",
    [
        MessageDefinition(
            30,
            "ATTITUDE",
            FieldDefinition("uint32_t", "time_boot_ms"),
            *(
                FieldDefinition("float", name)
                for name in ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed")
            ),
        ),
        MessageDefinition(
            33,
            "GLOBAL_POSITION_INT",
            FieldDefinition("uint32_t", "time_boot_ms"),
            *(FieldDefinition("int32_t", name) for name in ("lat", "lon", "alt", "relative_alt")),
            *(FieldDefinition("int16_t", name) for name in ("vx", "vy", "vz")),
            FieldDefinition("uint16_t", "hdg"),
        ),
        MessageDefinition(
            83,
            "ATTITUDE_TARGET",
            FieldDefinition("uint32_t", "time_boot_ms"),
            FieldDefinition("uint8_t", "type_mask"),
            FieldDefinition("float", "q", 4),
            *(
                FieldDefinition("float", name)
                for name in ("body_roll_rate", "body_pitch_rate", "body_yaw_rate", "thrust")
            ),
        ),
    ],
    ids=lambda definition: definition.msgname,
)
def test_the_rules_are_those_of_pymavlink(definition: MessageDefinition) -> None:
    theirs = ardupilotmega.mavlink_map[definition.id]
    assert definition.crc_extra == theirs.crc_extra
    assert definition.ordered_fieldnames == theirs.ordered_fieldnames
    assert definition.unpacker.format == theirs.unpacker.format


def test_none_of_them_has_come_to_pymavlink() -> None:
    """Once it has, ours can go."""
    assert not [one.msgname for one in NEWER_MESSAGES if one.id in ardupilotmega.mavlink_map]


def test_they_are_messages_like_others() -> None:
    kind = message_type("EVENT")
    assert (kind.id, kind.size) == (410, 53)
    frame = Frame("EVENT", {"id": 5, "arguments": (1, 2)}, 1, 1)
    (back,) = MavlinkParser().feed(encode(frame, 0))
    assert back.fields["arguments"][:3] == (1, 2, 0)
