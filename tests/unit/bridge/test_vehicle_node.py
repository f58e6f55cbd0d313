from math import isnan, pi, sqrt
from typing import Any

import pytest

from volery.base.time import MS, S
from volery.links.frame import Frame


def test_state_follows_the_heartbeat(rig: Any) -> None:
    received = rig.listen("state", "mavros_msgs/State")
    rig.heartbeat(base_mode=209, custom_mode=4, system_status=4)
    rig.run(200 * MS)
    rig.heartbeat(base_mode=89, custom_mode=9, system_status=5)
    rig.run(200 * MS)
    seen = [(m.connected, m.armed, m.guided, m.manual_input, m.mode, m.system_status) for m in received]
    assert seen == [
        (True, True, False, True, "GUIDED", 4),
        (True, False, True, True, "LAND", 5),
    ]
    assert received[0].header.stamp.to_nsec() == MS  # when the frame came, not when it was published


@pytest.mark.parametrize(
    ("kind", "number", "name"),
    [(2, 6, "RTL"), (2, 17, "BRAKE"), (10, 15, "GUIDED"), (10, 4, "HOLD"), (2, 99, "CMODE(99)")],
)
def test_modes_go_by_the_names_of_the_kind_of_vehicle(rig: Any, kind: int, number: int, name: str) -> None:
    received = rig.listen("state", "mavros_msgs/State")
    rig.heartbeat(type=kind, custom_mode=number)
    rig.run(200 * MS)
    assert [message.mode for message in received] == [name]


def test_every_heartbeat_counts_but_of_positions_the_latest(rig: Any) -> None:
    states = rig.listen("state", "mavros_msgs/State")
    heights = rig.listen("global_position/rel_alt", "std_msgs/Float64")
    rig.run(110 * MS)
    for height in (1000, 2000, 3000):
        rig.heartbeat()
        rig.emit("GLOBAL_POSITION_INT", relative_alt=height)
    rig.run(200 * MS)
    assert len(states) == 3
    assert [message.data for message in heights] == [3.0]


def test_silence_is_a_disconnection(rig: Any) -> None:
    received = rig.listen("state", "mavros_msgs/State")
    rig.heartbeat()
    rig.run(9 * S)
    assert [message.connected for message in received] == [True]
    rig.run(2 * S)
    assert [message.connected for message in received] == [True, False]
    rig.heartbeat()
    rig.run(S)
    assert [message.connected for message in received] == [True, False, True]


def test_late_subscriptions_receive_state_and_home(rig: Any) -> None:
    rig.heartbeat()
    rig.emit("HOME_POSITION", latitude=470000000, longitude=80000000, altitude=400000)
    rig.run(S)
    states = rig.listen("state", "mavros_msgs/State")
    homes = rig.listen("home_position/home", "mavros_msgs/HomePosition")
    rig.run(10 * MS)
    assert [message.mode for message in states] == ["STABILIZE"]
    assert [message.geo.latitude for message in homes] == [47.0]


def test_the_global_position_is_ellipsoidal(raised_rig: Any) -> None:
    rig = raised_rig
    rig.connect()
    fixes = rig.listen("global_position/global", "sensor_msgs/NavSatFix")
    headings = rig.listen("global_position/compass_hdg", "std_msgs/Float64")
    rig.emit("GPS_RAW_INT", fix_type=3, eph=150, epv=200)
    rig.emit("GLOBAL_POSITION_INT", lat=473977418, lon=85455939, alt=488_100, relative_alt=10_000, hdg=27_000)
    rig.run(200 * MS)
    [fix] = fixes
    assert (fix.latitude, fix.longitude, fix.altitude) == (47.3977418, 8.5455939, pytest.approx(535.1))
    assert fix.status.status == 0
    assert fix.position_covariance.tolist() == [2.25, 0, 0, 0, 2.25, 0, 0, 0, 4.0]
    assert [message.data for message in headings] == [270.0]


@pytest.mark.parametrize(("fix_type", "status"), [(0, -1), (2, -1), (3, 0), (4, 1), (5, 2), (6, 2)])
def test_the_status_of_a_fix(rig: Any, fix_type: int, status: int) -> None:
    rig.connect()
    fixes = rig.listen("global_position/raw/fix", "sensor_msgs/NavSatFix")
    rig.emit("GPS_RAW_INT", fix_type=fix_type)
    rig.run(200 * MS)
    assert [fix.status.status for fix in fixes] == [status]


def test_local_positions_and_velocities_are_east_north_up(rig: Any) -> None:
    rig.connect()
    poses = rig.listen("local_position/pose", "geometry_msgs/PoseStamped")
    twists = rig.listen("local_position/velocity_local", "geometry_msgs/TwistStamped")
    rig.emit("ATTITUDE", yaw=pi / 2)  # heading east
    rig.emit("LOCAL_POSITION_NED", x=1.0, y=2.0, z=-3.0, vx=0.5, vy=0.25, vz=-0.125)
    rig.run(200 * MS)
    position, orientation = poses[0].pose.position, poses[0].pose.orientation
    assert (position.x, position.y, position.z) == (2.0, 1.0, 3.0)
    assert poses[0].header.frame_id == "map"
    assert abs(orientation.w) == pytest.approx(1.0)  # east is yaw 0 in ENU
    linear = twists[0].twist.linear
    assert (linear.x, linear.y, linear.z) == (0.25, 0.5, 0.125)


def test_home_is_ellipsoidal_with_its_place_in_the_local_frame(raised_rig: Any) -> None:
    rig = raised_rig
    rig.connect()
    homes = rig.listen("home_position/home", "mavros_msgs/HomePosition")
    rig.emit("HOME_POSITION", latitude=470000000, longitude=-80000000, altitude=400_000, x=1.0, y=2.0, z=3.0)
    rig.run(200 * MS)
    [home] = homes
    assert (home.geo.latitude, home.geo.longitude, home.geo.altitude) == (47.0, -8.0, 447.0)
    assert (home.position.x, home.position.y, home.position.z) == (2.0, 1.0, -3.0)


def test_the_imu_is_forward_left_up(rig: Any) -> None:
    rig.connect()
    received = rig.listen("imu/data", "sensor_msgs/Imu")
    rig.emit("ATTITUDE", rollspeed=0.5, pitchspeed=0.25, yawspeed=-0.125)
    rig.run(200 * MS)
    rig.emit("RAW_IMU", xacc=100, yacc=200, zacc=-1000)
    rig.emit("ATTITUDE", yaw=0.0)
    rig.run(200 * MS)
    first, second = received
    rates = first.angular_velocity
    assert (rates.x, rates.y, rates.z) == (0.5, -0.25, 0.125)
    assert first.linear_acceleration_covariance[0] == -1.0  # not known yet
    felt = second.linear_acceleration
    assert (felt.x, felt.y, felt.z) == pytest.approx((0.980665, -1.96133, 9.80665))
    assert abs(second.orientation.z) == pytest.approx(sqrt(0.5))  # north is yaw 90 degrees


def test_the_battery_discharges_with_a_negative_current(rig: Any) -> None:
    rig.connect()
    received = rig.listen("battery", "sensor_msgs/BatteryState")
    rig.emit("SYS_STATUS", voltage_battery=12_450, current_battery=1_234, battery_remaining=76)
    rig.run(200 * MS)
    rig.emit("SYS_STATUS", voltage_battery=65_535, current_battery=-1, battery_remaining=-1)
    rig.run(200 * MS)
    assert (received[0].voltage, received[0].current, received[0].percentage) == pytest.approx(
        (12.45, -12.34, 0.76)
    )
    assert all(isnan(value) for value in (received[1].voltage, received[1].current, received[1].percentage))


def test_texts_landed_state_sticks_and_reached_waypoints(rig: Any) -> None:
    rig.connect()
    texts = rig.listen("statustext/recv", "mavros_msgs/StatusText")
    extended = rig.listen("extended_state", "mavros_msgs/ExtendedState")
    sticks = rig.listen("rc/in", "mavros_msgs/RCIn")
    reached = rig.listen("mission/reached", "mavros_msgs/WaypointReached")
    for text in ("PreArm: Compass not healthy", "Arm: Need Position Estimate"):
        rig.emit("STATUSTEXT", severity=2, text=text)
    rig.emit("EXTENDED_SYS_STATE", landed_state=2)
    rig.emit("RC_CHANNELS", chancount=3, rssi=99, chan1_raw=1500, chan2_raw=1400, chan3_raw=1000, chan4_raw=9)
    rig.emit("MISSION_ITEM_REACHED", seq=2)
    rig.run(200 * MS)
    assert [(m.severity, m.text) for m in texts] == [
        (2, "PreArm: Compass not healthy"),
        (2, "Arm: Need Position Estimate"),
    ]
    assert [message.landed_state for message in extended] == [2]
    assert [(m.rssi, m.channels.tolist()) for m in sticks] == [(99, [1500, 1400, 1000])]
    assert [message.wp_seq for message in reached] == [2]


def test_the_instruments_of_the_pilot(rig: Any) -> None:
    rig.connect()
    received = rig.listen("vfr_hud", "mavros_msgs/VfrHud")
    rig.emit("VFR_HUD", airspeed=8.5, groundspeed=8.0, heading=90, throttle=45, alt=500.5, climb=-0.5)
    rig.run(200 * MS)
    hud = received[0]
    assert (hud.airspeed, hud.groundspeed, hud.heading, hud.throttle, hud.altitude, hud.climb) == (
        8.5,
        8.0,
        90,
        pytest.approx(0.45),  # a float32
        500.5,
        -0.5,
    )


def test_other_stations_on_the_link_are_not_the_vehicle(rig: Any) -> None:
    received = rig.listen("state", "mavros_msgs/State")
    station = {"type": 6, "autopilot": 8, "base_mode": 0}
    rig._theirs.send(Frame("HEARTBEAT", station, 254, 190))
    rig.heartbeat()
    rig._theirs.send(Frame("HEARTBEAT", station, 254, 190))
    rig.run(200 * MS)
    assert rig.node.link.target == (1, 1)
    assert len(received) == 1


def test_streams_are_asked_for_until_they_come(rig: Any) -> None:
    rig.run(2 * S)
    assert {frame.name for frame in rig.sent} == {"HEARTBEAT"}  # without an addressee
    rig.heartbeat()
    rig.run(1200 * MS)
    asked = {
        fields["req_stream_id"]: fields["req_message_rate"] for fields in rig.asked("REQUEST_DATA_STREAM")
    }
    assert asked == {1: 1, 2: 2, 3: 1, 6: 10, 10: 4, 11: 1}
    assert {fields["command"] for fields in rig.asked("COMMAND_LONG")} == {410, 511}
    for name in ("RAW_IMU", "SYS_STATUS", "RC_CHANNELS", "GLOBAL_POSITION_INT", "ATTITUDE", "VFR_HUD"):
        rig.emit(name)
    rig.emit("EXTENDED_SYS_STATE")
    rig.emit("HOME_POSITION")
    rig.run(100 * MS)
    rig.sent.clear()
    rig.run(2 * S)
    assert rig.asked("REQUEST_DATA_STREAM", "COMMAND_LONG") == []
    rig.run(3 * S)  # they have fallen silent: after a restart they have to be asked for again
    assert len(rig.asked("REQUEST_DATA_STREAM")) >= 6


def test_the_node_is_charged_for_its_calls(rig: Any) -> None:
    rig.connect()
    rig.priced.clear()
    rig.emit("GLOBAL_POSITION_INT", hdg=0)
    rig.run(100 * MS)
    calls = [call for name, call in rig.priced if name == "/drone_1/mavros"]
    assert calls.count("publish") == 3
    assert "sleep" in calls
