"""roscopter's names: its types, its units, its services."""

from math import pi
from typing import Any

import pytest

from volery.base.time import MS, S
from volery.bridge import ROSCOPTER
from volery.ros.messages import ros1_type

RC = "roscopter/RC"
BOOTED = 12_000_000


def empty(rig: Any, service: str) -> None:
    rig.call(service, "std_srvs/Empty")


def test_the_types_are_those_of_the_real_one() -> None:
    """MD5 sum of roscopter's own RC.msg, as its generated code carries it."""
    assert ros1_type("roscopter/RC").md5 == "0f8285b6fdeccee6bef1d0353358d5cf"


@pytest.mark.parametrize(("fix_type", "status"), [(0, -1), (2, -1), (3, 0), (5, 0)])
def test_gps_is_amsl(roscopter: Any, fix_type: int, status: int) -> None:
    roscopter.heartbeat()
    received = roscopter.listen("gps", "sensor_msgs/NavSatFix")
    roscopter.run(10 * MS)
    roscopter.emit("GPS_RAW_INT", lat=473977418, lon=-85455939, alt=488_100, fix_type=fix_type)
    roscopter.run(10 * MS)
    [fix] = received
    assert (fix.latitude, fix.longitude, fix.altitude) == (47.3977418, -8.5455939, 488.1)
    assert (fix.status.status, fix.status.service) == (status, 1)


def test_state_is_that_of_the_heartbeat(roscopter: Any) -> None:
    received = roscopter.listen("state", "roscopter/State")
    roscopter.heartbeat(base_mode=81, custom_mode=0)
    roscopter.run(10 * MS)
    roscopter.heartbeat(base_mode=128 | 8, custom_mode=4)
    roscopter.run(10 * MS)
    seen = [(message.armed, message.guided, message.mode) for message in received]
    assert seen == [(False, False, "STABILIZE"), (True, True, "GUIDED")]


def test_frames_are_published_as_they_arrive(roscopter: Any) -> None:
    roscopter.heartbeat()
    received = roscopter.listen("attitude", "roscopter/Attitude")
    roscopter.run(10 * MS)
    for roll in (0.5, 0.25):
        roscopter.emit(
            "ATTITUDE", roll=roll, pitch=-0.5, yaw=1.0, rollspeed=2.0, pitchspeed=-2.0, yawspeed=0.5
        )
        roscopter.run(2 * MS)
    assert [message.roll for message in received] == [0.5, 0.25]
    last = received[-1]  # NED and FRD, as MAVLink has it
    angles = (last.pitch, last.yaw, last.rollspeed, last.pitchspeed, last.yawspeed)
    assert angles == (-0.5, 1.0, 2.0, -2.0, 0.5)


def test_the_head_up_display_and_the_channels(roscopter: Any) -> None:
    roscopter.heartbeat()
    huds = roscopter.listen("vfr_hud", "roscopter/VFR_HUD")
    channels = roscopter.listen("rc", RC)
    roscopter.run(10 * MS)
    roscopter.emit("VFR_HUD", airspeed=1.5, groundspeed=2.5, heading=271, throttle=40, alt=900.5, climb=-0.5)
    eight = {f"chan{number}_raw": 1000 + number for number in range(1, 9)}
    roscopter.emit("RC_CHANNELS_RAW", **eight)
    roscopter.run(10 * MS)
    roscopter.emit("RC_CHANNELS", chancount=16, **{**eight, "chan1_raw": 1500, "chan9_raw": 1900})
    roscopter.run(10 * MS)
    roscopter.emit("RC_CHANNELS_RAW", **eight)  # what it has in RC_CHANNELS already
    roscopter.run(10 * MS)
    [hud] = huds
    assert (hud.airspeed, hud.groundspeed, hud.heading, hud.throttle) == (1.5, 2.5, 271, 40)
    assert (hud.alt, hud.climb) == (900.5, -0.5)
    assert [list(message.channel) for message in channels] == [
        [1001, 1002, 1003, 1004, 1005, 1006, 1007, 1008],
        [1500, 1002, 1003, 1004, 1005, 1006, 1007, 1008],
    ]


@pytest.mark.parametrize(
    ("name", "time", "fields"),
    [
        ("RAW_IMU", {"time_usec": BOOTED}, {"zacc": -1000, "xgyro": 250, "ymag": 330}),
        ("SCALED_IMU", {"time_boot_ms": BOOTED // 1000}, {"zacc": -1000, "xgyro": 250, "ymag": 330}),
        ("HIGHRES_IMU", {"time_usec": BOOTED}, {"zacc": -9.80665, "xgyro": 0.25, "ymag": 0.33}),
    ],
)
def test_the_raw_imu_is_in_thousandths_from_every_source(
    roscopter: Any, name: str, time: dict[str, int], fields: dict[str, float]
) -> None:
    roscopter.heartbeat()
    received = roscopter.listen("raw_imu", "roscopter/Mavlink_RAW_IMU")
    roscopter.run(10 * MS)
    roscopter.emit(name, **time, **fields)
    roscopter.run(10 * MS)
    [message] = received
    assert message.time_usec == BOOTED
    assert (message.zacc, message.xgyro, message.ymag) == (-1000, 250, 330)


def test_sticks_reach_eight_channels_and_leave_the_others(roscopter: Any) -> None:
    roscopter.connect()
    roscopter.publish("send_rc", RC, channel=[1500, 1500, 1620, 1700, 0, 0, 0, 0])
    roscopter.run(10 * MS)
    [sent] = roscopter.asked("RC_CHANNELS_OVERRIDE")
    assert [sent[f"chan{number}_raw"] for number in range(1, 9)] == [1500, 1500, 1620, 1700, 0, 0, 0, 0]
    assert (sent["chan9_raw"], sent["target_system"]) == (0, 1)


def test_a_channel_that_is_none_is_dropped_with_a_warning(roscopter: Any) -> None:
    roscopter.connect()
    roscopter.publish("send_rc", RC, channel=[-1, 0, 0, 0, 0, 0, 0, 0])
    roscopter.run(10 * MS)
    assert roscopter.asked("RC_CHANNELS_OVERRIDE") == []
    [warning] = roscopter.of_texts()
    assert warning.text.startswith("/drone_1/send_rc: message dropped")


def test_without_leave_it_takes_no_sticks(rig_of: Any) -> None:
    rig = rig_of(names=ROSCOPTER, period=None)
    rig.connect()
    rig.publish("send_rc", RC, channel=[1500] * 8)
    rig.run(S)
    assert rig.asked("RC_CHANNELS_OVERRIDE") == []


@pytest.mark.parametrize(("service", "wanted"), [("arm", 1.0), ("disarm", 0.0)])
def test_arming(roscopter: Any, service: str, wanted: float) -> None:
    roscopter.connect()
    roscopter.answers["COMMAND_LONG"] = lambda fields: roscopter.emit("COMMAND_ACK", command=400, result=0)
    empty(roscopter, service)
    [sent] = [one for one in roscopter.asked("COMMAND_LONG") if one["command"] == 400]
    assert sent["param1"] == wanted
    assert roscopter.of_texts() == []


def test_a_refusal_is_a_warning(roscopter: Any) -> None:
    roscopter.connect()
    roscopter.answers["COMMAND_LONG"] = lambda fields: roscopter.emit("COMMAND_ACK", command=400, result=4)
    empty(roscopter, "arm")
    assert [event.text for event in roscopter.of_texts()] == ["arm: the autopilot answers FAILED"]


def test_it_asks_for_all_streams_until_they_come(roscopter: Any) -> None:
    roscopter.heartbeat()
    roscopter.run(2500 * MS)
    asked = roscopter.asked("REQUEST_DATA_STREAM")
    assert len(asked) >= 2
    assert {(one["req_stream_id"], one["req_message_rate"], one["start_stop"]) for one in asked} == {
        (0, 10, 1)
    }
    roscopter.emit("ATTITUDE", yaw=pi)
    roscopter.run(S)
    roscopter.sent.clear()
    roscopter.run(S)
    assert roscopter.asked("REQUEST_DATA_STREAM") == []


def test_a_px4_is_asked_for_messages(roscopter: Any) -> None:
    roscopter.heartbeat(autopilot=12)
    roscopter.run(1500 * MS)
    asked = {one["param1"]: one["param2"] for one in roscopter.asked("COMMAND_LONG") if one["command"] == 511}
    assert {1.0, 24.0, 30.0, 65.0, 74.0, 105.0} <= set(asked)
    assert set(asked.values()) == {100_000.0}


def test_one_of_several_autopilots_on_a_link_is_selected(rig_of: Any) -> None:
    rig = rig_of(names=ROSCOPTER, period=None, vehicle=7)
    received = rig.listen("state", "roscopter/State")
    rig.heartbeat()  # of system 1
    rig.run(S)
    assert received == []
    assert rig.node.summary == ""
    rig.emit_as(7, "HEARTBEAT", type=2, autopilot=3, base_mode=209, custom_mode=4)
    rig.run(S)
    assert [message.mode for message in received] == ["GUIDED"]
    assert rig.node.summary == "ArduPilot (system 7): GUIDED, armed"
