from __future__ import annotations

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from volery.base.errors import UsageError
from volery.links.frame import Frame
from volery.links.mavlink_codec import encode, quantised
from volery.links.mavlink_messages import constant, entry_name, message_type


def test_what_we_write_is_what_pymavlink_reads() -> None:
    frame = Frame("STATUSTEXT", {"severity": 2, "text": "PreArm: Compass not healthy"}, 1, 1)
    read = dialect.MAVLink(None).decode(bytearray(encode(frame, 300)))
    assert (read.get_type(), read.severity, read.text) == ("STATUSTEXT", 2, "PreArm: Compass not healthy")
    assert (read.get_srcSystem(), read.get_srcComponent(), read.get_seq()) == (1, 1, 300 % 256)


def test_the_same_bytes_as_pymavlink_for_a_message_with_floats_and_arrays() -> None:
    sender = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    voltages = [4200, 4190, *[65535] * 8]
    message = dialect.MAVLink_battery_status_message(0, 1, 2, 300, voltages, 120, 55, -1, 87)
    fields = {
        "battery_function": 1,
        "type": 2,
        "temperature": 300,
        "voltages": voltages,
        "current_battery": 120,
        "current_consumed": 55,
        "energy_consumed": -1,
        "battery_remaining": 87,
    }
    assert encode(Frame("BATTERY_STATUS", fields, 255, 190), 0) == bytes(message.pack(sender))


def test_an_in_process_value_is_the_value_after_the_wire() -> None:
    frame = quantised(Frame("VFR_HUD", {"alt": 0.1, "heading": 270}, 1, 1))
    assert frame.fields["alt"] == pytest.approx(0.1)
    assert frame.fields["alt"] != 0.1  # a 32-bit float now
    assert frame.fields["groundspeed"] == 0.0


def test_a_text_is_cut_to_its_field_and_at_zero() -> None:
    assert quantised(Frame("STATUSTEXT", {"text": "x" * 60}, 1, 1)).fields["text"] == "x" * 50
    assert message_type("STATUSTEXT").unpack(b"\x06ab\0cd")["text"] == "ab"


def test_whole_numbers_arrive_as_they_are_and_as_int():
    """A message that is complete and of ints alone is not unpacked; any other is."""
    complete = {"tc1": 3, "ts1": -7}
    assert quantised(Frame("TIMESYNC", complete, 1, 1)).fields is complete
    odd = quantised(Frame("TIMESYNC", {"tc1": np.int64(3), "ts1": True}, 1, 1)).fields
    assert {name: type(value) for name, value in odd.items()} == {"tc1": int, "ts1": int}
    assert quantised(Frame("TIMESYNC", {"tc1": 3}, 1, 1)).fields == {"tc1": 3, "ts1": 0}
    with pytest.raises(UsageError, match="does not fit"):
        quantised(Frame("TIMESYNC", {"tc1": 1 << 63, "ts1": 0}, 1, 1))


@pytest.mark.parametrize(
    ("name", "fields", "expected"),
    [
        ("HARTBEAT", {}, "did you mean 'HEARTBEAT'"),
        ("HEARTBEAT", {"custom_node": 1}, "did you mean 'custom_mode'"),
        ("HEARTBEAT", {"type": 256}, "does not fit"),
        ("HEARTBEAT", {"type": 1.5}, "does not fit"),
        ("BATTERY_STATUS", {"voltages": [1] * 11}, "room for 10"),
    ],
)
def test_errors_name_fields_that_do_not_fit(name: str, fields: dict[str, object], expected: str) -> None:
    with pytest.raises(UsageError, match=expected):
        encode(Frame(name, fields, 1, 1), 0)


def test_names_of_the_dialect() -> None:
    assert constant("MAV_CMD_NAV_TAKEOFF") == 22
    assert entry_name("MAV_RESULT", 4) == "FAILED"
    assert entry_name("MAV_RESULT", 99) == "99"
    with pytest.raises(UsageError, match="no constant"):
        constant("MAV_CMD_NAV_TAKEOF")
    with pytest.raises(UsageError, match="did you mean 'MAV_RESULT'"):
        entry_name("MAV_RESULTS", 4)
