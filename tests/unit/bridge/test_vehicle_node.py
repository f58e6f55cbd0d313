from math import isnan, pi, sqrt
from typing import Any

import pytest

from volery.base.time import MS, S
from volery.links.link import Frame


def test_state_follows_the_heartbeat(aviary: Any) -> None:
    received = aviary.listen("state", "mavros_msgs/State")
    aviary.heartbeat(base_mode=209, custom_mode=4, system_status=4)
    aviary.run(200 * MS)
    aviary.heartbeat(base_mode=89, custom_mode=9, system_status=5)
    aviary.run(200 * MS)
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
def test_modes_go_by_the_names_of_the_kind_of_vehicle(aviary: Any, kind: int, number: int, name: str) -> None:
    received = aviary.listen("state", "mavros_msgs/State")
    aviary.heartbeat(type=kind, custom_mode=number)
    aviary.run(200 * MS)
    assert [message.mode for message in received] == [name]


def test_every_heartbeat_counts_but_of_positions_the_latest(aviary: Any) -> None:
    states = aviary.listen("state", "mavros_msgs/State")
    heights = aviary.listen("global_position/rel_alt", "std_msgs/Float64")
    aviary.run(110 * MS)
    for height in (1000, 2000, 3000):
        aviary.heartbeat()
        aviary.emit("GLOBAL_POSITION_INT", relative_alt=height)
    aviary.run(200 * MS)
    assert len(states) == 3
    assert [message.data for message in heights] == [3.0]


def test_silence_is_a_disconnection(aviary: Any) -> None:
    received = aviary.listen("state", "mavros_msgs/State")
    aviary.heartbeat()
    aviary.run(9 * S)
    assert [message.connected for message in received] == [True]
    aviary.run(2 * S)
    assert [message.connected for message in received] == [True, False]
    aviary.heartbeat()
    aviary.run(S)
    assert [message.connected for message in received] == [True, False, True]


def test_late_subscriptions_receive_state_and_home(aviary: Any) -> None:
    aviary.heartbeat()
    aviary.emit("HOME_POSITION", latitude=470000000, longitude=80000000, altitude=400000)
    aviary.run(S)
    states = aviary.listen("state", "mavros_msgs/State")
    homes = aviary.listen("home_position/home", "mavros_msgs/HomePosition")
    aviary.run(10 * MS)
    assert [message.mode for message in states] == ["STABILIZE"]
    assert [message.geo.latitude for message in homes] == [47.0]


def test_the_global_position_is_ellipsoidal(raised_aviary: Any) -> None:
    aviary = raised_aviary
    aviary.connect()
    fixes = aviary.listen("global_position/global", "sensor_msgs/NavSatFix")
    headings = aviary.listen("global_position/compass_hdg", "std_msgs/Float64")
    aviary.emit("GPS_RAW_INT", fix_type=3, eph=150, epv=200)
    aviary.emit(
        "GLOBAL_POSITION_INT", lat=473977418, lon=85455939, alt=488_100, relative_alt=10_000, hdg=27_000
    )
    aviary.run(200 * MS)
    [fix] = fixes
    assert (fix.latitude, fix.longitude, fix.altitude) == (47.3977418, 8.5455939, pytest.approx(535.1))
    assert fix.status.status == 0
    assert fix.position_covariance.tolist() == [2.25, 0, 0, 0, 2.25, 0, 0, 0, 4.0]
    assert [message.data for message in headings] == [270.0]


@pytest.mark.parametrize(("fix_type", "status"), [(0, -1), (2, -1), (3, 0), (4, 1), (5, 2), (6, 2)])
def test_the_status_of_a_fix(aviary: Any, fix_type: int, status: int) -> None:
    aviary.connect()
    fixes = aviary.listen("global_position/raw/fix", "sensor_msgs/NavSatFix")
    aviary.emit("GPS_RAW_INT", fix_type=fix_type)
    aviary.run(200 * MS)
    assert [fix.status.status for fix in fixes] == [status]


def test_local_positions_and_velocities_are_east_north_up(aviary: Any) -> None:
    aviary.connect()
    poses = aviary.listen("local_position/pose", "geometry_msgs/PoseStamped")
    twists = aviary.listen("local_position/velocity_local", "geometry_msgs/TwistStamped")
    aviary.emit("ATTITUDE", yaw=pi / 2)  # heading east
    aviary.emit("LOCAL_POSITION_NED", x=1.0, y=2.0, z=-3.0, vx=0.5, vy=0.25, vz=-0.125)
    aviary.run(200 * MS)
    position, orientation = poses[0].pose.position, poses[0].pose.orientation
    assert (position.x, position.y, position.z) == (2.0, 1.0, 3.0)
    assert poses[0].header.frame_id == "map"
    assert abs(orientation.w) == pytest.approx(1.0)  # east is yaw 0 in ENU
    linear = twists[0].twist.linear
    assert (linear.x, linear.y, linear.z) == (0.25, 0.5, 0.125)


def test_home_is_ellipsoidal_with_its_place_in_the_local_frame(raised_aviary: Any) -> None:
    aviary = raised_aviary
    aviary.connect()
    homes = aviary.listen("home_position/home", "mavros_msgs/HomePosition")
    aviary.emit(
        "HOME_POSITION", latitude=470000000, longitude=-80000000, altitude=400_000, x=1.0, y=2.0, z=3.0
    )
    aviary.run(200 * MS)
    [home] = homes
    assert (home.geo.latitude, home.geo.longitude, home.geo.altitude) == (47.0, -8.0, 447.0)
    assert (home.position.x, home.position.y, home.position.z) == (2.0, 1.0, -3.0)


def test_the_imu_is_forward_left_up(aviary: Any) -> None:
    aviary.connect()
    received = aviary.listen("imu/data", "sensor_msgs/Imu")
    aviary.emit("ATTITUDE", rollspeed=0.5, pitchspeed=0.25, yawspeed=-0.125)
    aviary.run(200 * MS)
    aviary.emit("RAW_IMU", xacc=100, yacc=200, zacc=-1000)
    aviary.emit("ATTITUDE", yaw=0.0)
    aviary.run(200 * MS)
    first, second = received
    rates = first.angular_velocity
    assert (rates.x, rates.y, rates.z) == (0.5, -0.25, 0.125)
    assert first.linear_acceleration_covariance[0] == -1.0  # not known yet
    felt = second.linear_acceleration
    assert (felt.x, felt.y, felt.z) == pytest.approx((0.980665, -1.96133, 9.80665))
    assert abs(second.orientation.z) == pytest.approx(sqrt(0.5))  # north is yaw 90 degrees


def test_the_battery_discharges_with_a_negative_current(aviary: Any) -> None:
    aviary.connect()
    received = aviary.listen("battery", "sensor_msgs/BatteryState")
    aviary.emit("SYS_STATUS", voltage_battery=12_450, current_battery=1_234, battery_remaining=76)
    aviary.run(200 * MS)
    aviary.emit("SYS_STATUS", voltage_battery=65_535, current_battery=-1, battery_remaining=-1)
    aviary.run(200 * MS)
    assert (received[0].voltage, received[0].current, received[0].percentage) == pytest.approx(
        (12.45, -12.34, 0.76)
    )
    assert all(isnan(value) for value in (received[1].voltage, received[1].current, received[1].percentage))


def test_texts_landed_state_sticks_and_reached_waypoints(aviary: Any) -> None:
    aviary.connect()
    texts = aviary.listen("statustext/recv", "mavros_msgs/StatusText")
    extended = aviary.listen("extended_state", "mavros_msgs/ExtendedState")
    sticks = aviary.listen("rc/in", "mavros_msgs/RCIn")
    reached = aviary.listen("mission/reached", "mavros_msgs/WaypointReached")
    for text in ("PreArm: Compass not healthy", "Arm: Need Position Estimate"):
        aviary.emit("STATUSTEXT", severity=2, text=text)
    aviary.emit("EXTENDED_SYS_STATE", landed_state=2)
    aviary.emit(
        "RC_CHANNELS", chancount=3, rssi=99, chan1_raw=1500, chan2_raw=1400, chan3_raw=1000, chan4_raw=9
    )
    aviary.emit("MISSION_ITEM_REACHED", seq=2)
    aviary.run(200 * MS)
    assert [(m.severity, m.text) for m in texts] == [
        (2, "PreArm: Compass not healthy"),
        (2, "Arm: Need Position Estimate"),
    ]
    assert [message.landed_state for message in extended] == [2]
    assert [(m.rssi, m.channels.tolist()) for m in sticks] == [(99, [1500, 1400, 1000])]
    assert [message.wp_seq for message in reached] == [2]


def test_the_instruments_of_the_pilot(aviary: Any) -> None:
    aviary.connect()
    received = aviary.listen("vfr_hud", "mavros_msgs/VfrHud")
    aviary.emit("VFR_HUD", airspeed=8.5, groundspeed=8.0, heading=90, throttle=45, alt=500.5, climb=-0.5)
    aviary.run(200 * MS)
    hud = received[0]
    assert (hud.airspeed, hud.groundspeed, hud.heading, hud.throttle, hud.altitude, hud.climb) == (
        8.5,
        8.0,
        90,
        0.45,
        500.5,
        -0.5,
    )


def test_other_stations_on_the_link_are_not_the_vehicle(aviary: Any) -> None:
    received = aviary.listen("state", "mavros_msgs/State")
    station = {"type": 6, "autopilot": 8, "base_mode": 0}
    aviary._theirs.send(Frame("HEARTBEAT", station, 254, 190))
    aviary.heartbeat()
    aviary._theirs.send(Frame("HEARTBEAT", station, 254, 190))
    aviary.run(200 * MS)
    assert aviary.node.link.target == (1, 1)
    assert len(received) == 1


def test_streams_are_asked_for_until_they_come(aviary: Any) -> None:
    aviary.run(2 * S)
    assert {frame.name for frame in aviary.sent} == {"HEARTBEAT"}  # without an addressee
    aviary.heartbeat()
    aviary.run(1200 * MS)
    asked = {
        fields["req_stream_id"]: fields["req_message_rate"] for fields in aviary.asked("REQUEST_DATA_STREAM")
    }
    assert asked == {1: 1, 2: 2, 3: 1, 6: 10, 10: 4, 11: 1}
    assert {fields["command"] for fields in aviary.asked("COMMAND_LONG")} == {410, 511}
    for name in ("RAW_IMU", "SYS_STATUS", "RC_CHANNELS", "GLOBAL_POSITION_INT", "ATTITUDE", "VFR_HUD"):
        aviary.emit(name)
    aviary.emit("EXTENDED_SYS_STATE")
    aviary.emit("HOME_POSITION")
    aviary.run(100 * MS)
    aviary.sent.clear()
    aviary.run(2 * S)
    assert aviary.asked("REQUEST_DATA_STREAM", "COMMAND_LONG") == []
    aviary.run(3 * S)  # they have fallen silent: after a restart they have to be asked for again
    assert len(aviary.asked("REQUEST_DATA_STREAM")) >= 6


def test_the_node_is_charged_for_its_calls(aviary: Any) -> None:
    aviary.connect()
    aviary.priced.clear()
    aviary.emit("GLOBAL_POSITION_INT", hdg=0)
    aviary.run(100 * MS)
    calls = [call for name, call in aviary.priced if name == "/drone_1/mavros"]
    assert calls.count("publish") + calls.count("publish_next") == 3
    assert "sleep" in calls
