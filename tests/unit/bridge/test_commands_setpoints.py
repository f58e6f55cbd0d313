"""Attitudes in and targets out, there and back between ENU and NED; status of the system; missions'
current item.
"""

from math import pi, sqrt
from typing import Any

import pytest

from volery.base.time import MS

from .test_commands_services import only, vector
from .test_motion_publishers import xyz

HALF = sqrt(0.5)


def test_an_attitude_set_point(rig: Any) -> None:
    rig.connect()
    north = {"w": HALF, "x": 0.0, "y": 0.0, "z": HALF}  # yaw 90 degrees anticlockwise from east
    rates = vector(0.1, 0.2, 0.3)
    rig.publish(
        "setpoint_raw/attitude",
        "mavros_msgs/AttitudeTarget",
        type_mask=7,
        orientation=north,
        body_rate=rates,
        thrust=0.5,
    )
    sent = only(rig, "SET_ATTITUDE_TARGET")
    assert [abs(part) for part in sent["q"]] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-6)
    sent_rates = (sent["body_roll_rate"], sent["body_pitch_rate"], sent["body_yaw_rate"])
    assert sent_rates == pytest.approx((0.1, -0.2, -0.3))
    assert (sent["thrust"], sent["type_mask"]) == (0.5, 7)


def test_a_velocity_without_a_header(rig: Any) -> None:
    rig.connect()
    twist = {"linear": vector(1.0, 2.0, 0.5), "angular": vector(0.0, 0.0, 0.25)}
    rig.publish("setpoint_velocity/cmd_vel_unstamped", "geometry_msgs/Twist", **twist)
    sent = only(rig, "SET_POSITION_TARGET_LOCAL_NED")
    assert (sent["vx"], sent["vy"], sent["vz"], sent["yaw_rate"]) == (2.0, 1.0, -0.5, -0.25)


def test_a_text_for_ground_stations(rig: Any) -> None:
    rig.connect()
    rig.publish("statustext/send", "mavros_msgs/StatusText", severity=4, text="low on tea" + "!" * 60)
    sent = only(rig, "STATUSTEXT")
    assert (sent["severity"], sent["text"]) == (4, "low on tea" + "!" * 40)


def test_where_it_is_going(rig: Any) -> None:
    rig.connect()
    local = rig.listen("setpoint_raw/target_local", "mavros_msgs/PositionTarget")
    globally = rig.listen("setpoint_raw/target_global", "mavros_msgs/GlobalPositionTarget")
    attitudes = rig.listen("setpoint_raw/target_attitude", "mavros_msgs/AttitudeTarget")
    moving = {"vx": 0.5, "vy": 0.25, "vz": -0.125, "yaw": 0.0, "yaw_rate": 0.5, "type_mask": 3576}
    rig.emit("POSITION_TARGET_LOCAL_NED", coordinate_frame=1, x=1.0, y=2.0, z=-3.0, **moving)
    place = {"lat_int": 473977418, "lon_int": 85455939, "alt": 20.0}
    rig.emit("POSITION_TARGET_GLOBAL_INT", coordinate_frame=6, **place, **moving)
    rig.emit("ATTITUDE_TARGET", q=[1.0, 0.0, 0.0, 0.0], body_pitch_rate=0.5, thrust=0.25)
    rig.run(200 * MS)
    [one], [other], [attitude] = local, globally, attitudes
    assert (xyz(one.position), xyz(one.velocity)) == ((2.0, 1.0, 3.0), (0.25, 0.5, 0.125))
    assert (one.yaw, one.yaw_rate, one.type_mask) == (pytest.approx(pi / 2), -0.5, 3576)
    assert (other.latitude, other.longitude, other.altitude) == (47.3977418, 8.5455939, 20.0)
    assert (other.coordinate_frame, xyz(other.velocity)) == (6, (0.25, 0.5, 0.125))
    assert abs(attitude.orientation.z) == pytest.approx(HALF)  # north is yaw 90 degrees in ENU
    assert (attitude.body_rate.y, attitude.thrust) == (-0.5, 0.25)


def test_the_state_of_the_system_and_of_its_ports(rig: Any) -> None:
    rig.connect()
    states = rig.listen("sys_status", "mavros_msgs/SysStatus")
    ports = rig.listen("rc/out", "mavros_msgs/RCOut")
    status = {"onboard_control_sensors_present": 7, "onboard_control_sensors_health": 3, "load": 250}
    rig.emit("SYS_STATUS", **status, voltage_battery=12_600, current_battery=350, battery_remaining=80)
    rig.emit("SERVO_OUTPUT_RAW", servo1_raw=1100, servo16_raw=1900)
    rig.run(200 * MS)
    [state], [out] = states, ports
    assert (state.sensors_present, state.sensors_health, state.load) == (7, 3, 250)
    assert (state.voltage_battery, state.current_battery, state.battery_remaining) == (12_600, 350, 80)
    assert (out.channels[0], out.channels[15], len(out.channels)) == (1100, 1900, 16)


def test_the_waypoint_that_is_the_current_one(rig: Any) -> None:
    rig.connect()
    received = rig.listen("mission/waypoints", "mavros_msgs/WaypointList")
    rig.emit("MISSION_CURRENT", seq=3)
    rig.run(200 * MS)
    assert received == []  # of which mission?
    rig.answers["MISSION_REQUEST_LIST"] = lambda fields: rig.emit("MISSION_COUNT", count=1)
    rig.answers["MISSION_REQUEST_INT"] = lambda fields: rig.emit("MISSION_ITEM_INT", seq=0, command=16)
    assert rig.call("mission/pull", "mavros_msgs/WaypointPull").wp_received == 1
    rig.emit("MISSION_CURRENT", seq=4)
    rig.run(200 * MS)
    assert [(message.current_seq, len(message.waypoints)) for message in received] == [(3, 1), (4, 1)]


def test_an_acceleration(rig: Any) -> None:
    rig.connect()
    vector = {"x": 1.0, "y": 2.0, "z": 3.0}
    rig.publish("setpoint_accel/accel", "geometry_msgs/Vector3Stamped", vector=vector)
    rig.run(10 * MS)
    [sent] = rig.asked("SET_POSITION_TARGET_LOCAL_NED")
    assert (sent["afx"], sent["afy"], sent["afz"]) == (2.0, 1.0, -3.0)
    assert sent["type_mask"] == 0xC3F


def test_a_thrust_and_an_attitude_or_rates_are_sent_as_one(rig: Any) -> None:
    rig.connect()
    topic = "setpoint_attitude"
    rig.publish(f"{topic}/thrust", "mavros_msgs/Thrust", thrust=0.5)
    rig.run(10 * MS)
    assert rig.asked("SET_ATTITUDE_TARGET") == []
    rig.publish(f"{topic}/attitude", "geometry_msgs/PoseStamped", pose={"orientation": {"w": 1.0}})
    rig.run(10 * MS)
    rig.publish(f"{topic}/cmd_vel", "geometry_msgs/TwistStamped", twist={"angular": {"y": 0.25}})
    rig.publish(f"{topic}/thrust", "mavros_msgs/Thrust", thrust=0.25)
    rig.run(10 * MS)
    attitude, rates = rig.asked("SET_ATTITUDE_TARGET")
    assert (attitude["thrust"], attitude["type_mask"]) == (0.5, 7)
    assert [abs(one) for one in attitude["q"]] == pytest.approx([0.5**0.5, 0.0, 0.0, 0.5**0.5])
    assert (rates["thrust"], rates["type_mask"], rates["body_pitch_rate"]) == (0.25, 128, -0.25)
