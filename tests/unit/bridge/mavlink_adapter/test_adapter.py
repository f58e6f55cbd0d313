"""Under MAVROS's and roscopter's names: a Paparazzi and a DJI, in virtual time."""

from __future__ import annotations

from math import isnan, nan
from typing import Any

import pytest

from volery.bridge import ROSCOPTER
from volery.ros import messages

HOVERS = {"paparazzi": "GUIDED", "dji": "P_GPS"}


def kind_of(made: Any) -> str:
    return "dji" if made.driver.telemetry.autopilot.startswith("DJI") else "paparazzi"


def waypoint(command: int, latitude: float = 0.0, longitude: float = 0.0, height: float = 0.0) -> Any:
    place = {"x_lat": latitude, "y_long": longitude, "z_alt": height}
    return messages.new("mavros_msgs/Waypoint", frame=3, command=command, param4=nan, **place)


def test_telemetry_is_what_the_autopilot_says(ready: Any) -> None:
    topics = {
        "state": "mavros_msgs/State",
        "extended_state": "mavros_msgs/ExtendedState",
        "battery": "sensor_msgs/BatteryState",
        "global_position/global": "sensor_msgs/NavSatFix",
        "global_position/raw/fix": "sensor_msgs/NavSatFix",
        "global_position/rel_alt": "std_msgs/Float64",
        "global_position/local": "nav_msgs/Odometry",
        "home_position/home": "mavros_msgs/HomePosition",
        "local_position/pose": "geometry_msgs/PoseStamped",
        "imu/data": "sensor_msgs/Imu",
        "vfr_hud": "mavros_msgs/VfrHud",
    }
    for topic, kind in topics.items():
        ready.listen(topic, kind)
    ready.run(3.0)
    seen, last = ready.driver.telemetry, ready.last
    assert (last("state").connected, last("state").mode, last("state").armed) == (True, seen.mode, False)
    assert last("extended_state").landed_state == 1
    assert last("battery").voltage == pytest.approx(seen.battery.volts, abs=0.05)
    assert isnan(last("battery").percentage) == isnan(seen.battery.remaining)
    for topic in ("global_position/global", "global_position/raw/fix"):
        assert last(topic).latitude == pytest.approx(46.0825, abs=2e-5)
        assert last(topic).altitude == pytest.approx(910.0, abs=3.0)  # above the ellipsoid
        assert last(topic).status.status == 0
    assert last("home_position/home").geo.altitude == pytest.approx(910.0, abs=3.0)
    assert last("global_position/rel_alt").data == pytest.approx(0.0, abs=0.5)
    assert last("local_position/pose").pose.position.z == pytest.approx(0.0, abs=0.5)
    assert last("vfr_hud").altitude == pytest.approx(900.0, abs=3.0)  # above the sea
    assert isnan(last("vfr_hud").airspeed)
    assert last("imu/data").angular_velocity_covariance[0] == -1.0  # unknown


def test_it_is_armed_flown_to_set_points_and_landed(ready: Any) -> None:
    ready.listen("state", "mavros_msgs/State")
    ready.listen("local_position/pose", "geometry_msgs/PoseStamped")
    ready.listen("local_position/velocity_local", "geometry_msgs/TwistStamped")
    assert ready.command("cmd/arming", "CommandBool", value=True) == (True, 0)
    ready.run(0.3)
    assert ready.last("state").armed
    ready.take_off(6.0)
    pose = {"position": {"x": 8.0, "y": -6.0, "z": 7.0}, "orientation": {"w": 1.0}}
    for _ in range(150):  # as one does it: again and again
        ready.publish("setpoint_position/local", "geometry_msgs/PoseStamped", pose=pose)
        ready.run(0.1)
    assert ready.true == pytest.approx((8.0, -6.0, 7.0), abs=1.0)
    there = ready.last("local_position/pose").pose
    assert (there.position.x, there.position.y) == pytest.approx((8.0, -6.0), abs=0.6)
    assert abs(there.orientation.w) == pytest.approx(1.0, abs=0.01)  # it has turned east
    for _ in range(100):  # a Paparazzi overshoots before it settles
        ready.publish("setpoint_velocity/cmd_vel_unstamped", "geometry_msgs/Twist", linear={"y": 2.0})
        ready.run(0.1)
    assert ready.last("local_position/velocity_local").twist.linear.y == pytest.approx(2.0, abs=0.4)
    ready.run(16.0)  # the set-point has expired, and the vehicle has settled
    assert ready.last("local_position/velocity_local").twist.linear.y == pytest.approx(0.0, abs=0.4)
    assert ready.last("state").mode == HOVERS[kind_of(ready)]
    assert ready.last("state").guided
    assert ready.command("cmd/land", "CommandTOL") == (True, 0)
    ready.until(lambda: not ready.last("state").armed, 60.0)
    assert ready.height == pytest.approx(0.0, abs=0.2)
    assert ready.texts == []


def test_a_new_target_replaces_the_old_and_a_command_replaces_targets(ready: Any) -> None:
    ready.take_off(5.0)
    for x in (30.0, -8.0):
        pose = {"position": {"x": x, "z": 5.0}, "orientation": {"w": 1.0}}
        ready.publish("setpoint_position/local", "geometry_msgs/PoseStamped", pose=pose)
        ready.run(3.0)
    ready.until(lambda: ready.true[0] < -7.0, 30.0)
    ready.publish(
        "setpoint_position/local", "geometry_msgs/PoseStamped", pose={"position": {"x": 30.0, "z": 5.0}}
    )
    ready.run(2.0)
    assert ready.command("cmd/command", "CommandLong", command=20)[0]  # return
    ready.publish(
        "setpoint_position/local", "geometry_msgs/PoseStamped", pose={"position": {"x": 30.0, "z": 5.0}}
    )
    ready.until(lambda: not ready.driver.telemetry.armed, 120.0)
    assert ready.true == pytest.approx((0.0, 0.0, 0.0), abs=2.0)  # satellites: 1.2 m, one deviation
    assert ready.texts == ["d: set-points are not followed while it is to return home"]


def test_a_global_place_is_above_the_ellipsoid(ready: Any) -> None:
    ready.take_off(5.0)
    place = {"position": {"latitude": 46.08255, "longitude": -103.8995, "altitude": 917.0}}
    pose = {**place, "orientation": {"z": 0.70710678, "w": 0.70710678}}
    ready.publish("setpoint_position/global", "geographic_msgs/GeoPoseStamped", pose=pose)
    ready.run(20.0)
    assert ready.true == pytest.approx((0.0, 5.56, 7.0), abs=1.5)


def test_refusals_have_a_reason(ready: Any) -> None:
    ready.listen("statustext/recv", "mavros_msgs/StatusText")
    kind = kind_of(ready)
    assert ready.command("cmd/command", "CommandLong", command=181) == (False, 3)
    ready.run(0.3)
    warning = ready.last("statustext/recv")
    assert warning.text == ready.texts[-1]  # whole, however long
    assert warning.severity == 4
    assert "no command DO_SET_RELAY here; there is" in warning.text
    assert ready.command("cmd/takeoff", "CommandTOL", altitude=-1.0) == (False, 2)
    assert "give metres above home, above 0" in ready.texts[-1]
    assert ready.command("cmd/arming", "CommandBool", value=False) == (True, 0)  # it is
    refused = {"paparazzi": "NAV", "dji": "AUTO_TAKEOFF"}[kind]
    assert ready.call("set_mode", "mavros_msgs/SetMode", custom_mode=refused).mode_sent
    ready.run(0.3)
    assert f"mode {refused} cannot be requested; there is" in ready.texts[-1]
    for _ in range(20):
        ready.publish("setpoint_velocity/cmd_vel_unstamped", "geometry_msgs/Twist", linear={"x": 1.0})
        ready.run(0.1)
    assert [text for text in ready.texts if "it is on the ground" in text] == [
        ready.texts[-1]
    ]  # messages_of once


def test_in_the_air_it_is_not_disarmed_unless_by_force(ready: Any) -> None:
    ready.take_off(3.0)
    assert ready.command("cmd/arming", "CommandBool", value=False) == (False, 2)
    assert "it flies, and would fall" in ready.texts[-1]
    stopped = ready.command("cmd/command", "CommandLong", command=400, param2=21196.0)[0]
    # node 3.8 of DJI stops no motors in the air, and says so
    assert stopped == (kind_of(ready) != "dji")
    assert ready.driver.telemetry.armed != stopped
    assert stopped or "only the pilot can" in ready.texts[-1]


def test_a_command_that_is_overtaken_is_cancelled(flown: Any) -> None:
    made = flown("sim:paparazzi?start=warm")
    made.run(30.0)
    made.tap()
    made.send("COMMAND_LONG", command=22, param7=5.0)
    made.run(1.0)
    made.send("COMMAND_LONG", command=400, param1=1.0)  # waits its turn
    made.run(0.1)
    made.send("COMMAND_LONG", command=21)
    made.run(5.0)
    assert [(ack["command"], ack["result"]) for ack in made.messages_of("COMMAND_ACK")] == [
        (400, 1),
        (22, 6),
        (21, 0),
    ]
    assert "arm: not while it is to take off to 5 m" in made.texts[-1]


def test_a_paparazzi_refuses_missions(flown: Any) -> None:
    made = flown("sim:paparazzi?start=warm")
    made.run(30.0)
    pushed = made.call(
        "mission/push", "mavros_msgs/WaypointPush", waypoints=[waypoint(16, 46.08, -103.9, 5.0)]
    )
    assert (pushed.success, pushed.wp_transfered) == (False, 0)
    assert "cannot fly an uploaded mission" in made.texts[-1]
    assert not made.call("mission/pull", "mavros_msgs/WaypointPull").success


def test_a_dji_flies_a_mission(flown: Any) -> None:
    made = flown("sim:dji?start=warm")
    made.run(5.0)
    made.listen("mission/waypoints", "mavros_msgs/WaypointList")
    plan = [
        waypoint(22, height=6.0),
        waypoint(16, 46.08258, -103.8995, 6.0),
        waypoint(16, 46.08258, -103.8994, 6.0),
        waypoint(21),
    ]
    pushed = made.call("mission/push", "mavros_msgs/WaypointPush", waypoints=plan)
    assert (pushed.success, pushed.wp_transfered) == (True, 4)
    pulled = made.call("mission/pull", "mavros_msgs/WaypointPull")
    assert (pulled.success, pulled.wp_received) == (True, 4)
    assert made.last("mission/waypoints").waypoints[1].x_lat == pytest.approx(46.08258)
    assert made.call("set_mode", "mavros_msgs/SetMode", custom_mode="NAVI_MISSION").mode_sent
    made.until(lambda: made.driver.telemetry.flying, 30.0)
    made.until(lambda: not made.driver.telemetry.armed, 120.0)
    assert made.true == pytest.approx((7.7, 8.9, 0.0), abs=1.5)
    assert made.texts == []
    wrong = made.call("mission/push", "mavros_msgs/WaypointPush", waypoints=[waypoint(17)])
    assert not wrong.success
    assert "mission item 0: no NAV_LOITER_UNLIM here; there is" in made.texts[-1]


@pytest.mark.parametrize(("autopilot", "mode"), [("paparazzi", "ATTITUDE_RC_CLIMB"), ("dji", "ATTITUDE")])
def test_manual_control_flies_and_its_end_holds(flown: Any, autopilot: str, mode: str) -> None:
    made = flown(f"sim:{autopilot}?start=warm")
    made.run(30.0)
    made.take_off(8.0)
    forward = [1500, 1400, 1500, 1500, *[0] * 14]
    for step in range(30):
        made.publish("rc/override", "mavros_msgs/OverrideRCIn", channels=forward)
        if step == 2:
            assert made.call("set_mode", "mavros_msgs/SetMode", custom_mode=mode).mode_sent
        made.run(0.1)
    assert made.true[1] > 1.0
    assert made.texts == []
    made.until(lambda: any("no sticks for 3 s" in text for text in made.texts), 5.0)
    made.run(8.0)
    before = made.true
    made.run(3.0)
    assert made.true == pytest.approx(before, abs=0.5)
    assert made.driver.telemetry.mode == HOVERS[autopilot]


def test_roscopter_reads_and_arms_it(
    flown: Any,
) -> None:
    made = flown("sim:paparazzi?start=warm", names=ROSCOPTER, control=True)
    for topic, kind in {
        "gps": "sensor_msgs/NavSatFix",
        "state": "roscopter/State",
        "vfr_hud": "roscopter/VFR_HUD",
        "attitude": "roscopter/Attitude",
    }.items():
        made.listen(topic, kind)
    made.run(30.0)
    assert made.last("gps").altitude == pytest.approx(900.0, abs=3.0)  # above the sea
    assert made.last("gps").status.status == 0
    assert (made.last("state").mode, made.last("state").armed) == ("NAV", False)
    assert made.last("vfr_hud").alt == pytest.approx(900.0, abs=3.0)
    assert made.last("attitude").roll == pytest.approx(0.0, abs=0.05)
    made.call("arm", "std_srvs/Empty")
    made.run(0.5)
    assert made.last("state").armed
    made.call("disarm", "std_srvs/Empty")
    made.run(0.5)
    assert not made.last("state").armed
    assert made.texts == []


def test_messages_are_sent_only_while_telemetry_arrives(flown: Any) -> None:
    made = flown("sim:paparazzi?start=cold")
    made.tap()
    assert made.frames == []
    made.run(4.0)
    assert {frame.name for frame in made.frames} == {"HEARTBEAT"}  # nothing else was requested
    made.send("REQUEST_DATA_STREAM", req_stream_id=0, req_message_rate=10, start_stop=1)
    made.run(4.0)
    assert not made.messages_of("GLOBAL_POSITION_INT")  # it does not know where it is
    made.driver.close()  # no word comes through any more
    made.run(2.0)
    made.frames.clear()
    made.run(5.0)
    assert made.frames == []
    assert made.adapter.problem()


HOSTILE = [
    ("COMMAND_LONG", {"command": 22, "param7": nan}),
    ("COMMAND_LONG", {"command": 176, "param1": nan, "param2": float("inf")}),
    ("COMMAND_LONG", {"command": 511, "param1": float("inf"), "param2": nan}),
    ("COMMAND_LONG", {"command": 511, "param1": 33.0, "param2": nan}),
    ("COMMAND_LONG", {"command": 400, "param1": nan}),
    ("COMMAND_LONG", {"command": 115, "param1": nan, "param4": nan}),
    ("COMMAND_INT", {"command": 192, "x": 2**31 - 1, "y": 0, "z": nan, "frame": 3}),
    ("COMMAND_INT", {"command": 192, "frame": 77}),
    ("SET_POSITION_TARGET_LOCAL_NED", {"x": nan, "y": float("inf"), "coordinate_frame": 8}),
    ("SET_POSITION_TARGET_LOCAL_NED", {"type_mask": 0x0FFF}),
    ("SET_POSITION_TARGET_GLOBAL_INT", {"coordinate_frame": 5, "lat_int": 2_000_000_000, "alt": 5.0}),
    ("SET_ATTITUDE_TARGET", {}),
    ("MANUAL_CONTROL", {"x": 32_767, "y": -32_768, "z": 32_767, "r": 5_000}),
    ("RC_CHANNELS_OVERRIDE", {"chan1_raw": 1, "chan2_raw": 65_534}),
    ("SET_MODE", {"base_mode": 0, "custom_mode": 4_000_000_000}),
    ("MISSION_COUNT", {"count": 0}),
    ("MISSION_ITEM_INT", {"seq": 7}),
    ("MISSION_REQUEST_INT", {"seq": 7}),
    ("MISSION_CLEAR_ALL", {}),
    ("MISSION_SET_CURRENT", {"seq": 1}),
    ("REQUEST_DATA_STREAM", {"req_stream_id": 200, "req_message_rate": 65_535, "start_stop": 1}),
    ("PARAM_REQUEST_LIST", {}),
]


@pytest.mark.parametrize(("name", "fields"), HOSTILE)
def test_invalid_messages_are_reported(flown: Any, name: str, fields: dict[str, Any]) -> None:
    made = flown("sim:paparazzi?start=warm")
    made.run(25.0)
    made.send(name, **fields)
    made.run(4.0)
    assert not made.driver.telemetry.armed
    made.tap()
    made.run(2.0)
    assert made.messages_of("HEARTBEAT")  # it lives


def test_a_takeover_by_the_pilot_is_reported_and_respected(flown: Any) -> None:
    made = flown("sim:dji?start=warm")
    made.listen("state", "mavros_msgs/State")
    made.run(5.0)
    made.take_off(4.0)
    made.fleet.autopilots["d"].vehicle.rc.transmitter[4] = 1500  # the mode switch
    made.run(2.0)
    assert (made.last("state").mode, made.last("state").guided) == ("ATTITUDE", False)
    assert made.command("cmd/land", "CommandTOL") == (False, 2)
    assert "which this program did not command" in made.texts[-1]
    assert made.driver.telemetry.flying


def test_it_is_closed_during_a_command(flown: Any) -> None:
    made = flown("sim:paparazzi?start=warm")
    made.run(30.0)
    made.send("COMMAND_LONG", command=22, param7=20.0)
    made.run(6.0)
    made.adapter.close()
    assert made.kernel.close() == []
