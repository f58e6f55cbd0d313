"""ArduPilot's own names: frames and altitudes as the firmware has them, services, what is taken."""

from math import nan, pi
from typing import Any

import pytest

from volery.base.time import MS
from volery.bridge import MAVLINK_SCHEMES
from volery.ros.messages import new

GUIDED = 4
VELOCITY = "ap/cmd_vel", "geometry_msgs/TwistStamped"
PLACE = "ap/cmd_gps_pose", "ardupilot_msgs/GlobalPosition"


@pytest.fixture
def copter(rig_of: Any) -> Any:
    made = rig_of(47.0, names=MAVLINK_SCHEMES["ardupilot"])
    made.heartbeat()
    made.run(50 * MS)
    made.sent.clear()
    return made


def facing_east(rig: Any) -> None:
    rig.emit("ATTITUDE", roll=0.0, pitch=0.0, yaw=pi / 2, rollspeed=0.1, pitchspeed=0.2, yawspeed=0.3)


def twist(frame: str, **linear: float) -> Any:
    made = new("geometry_msgs/TwistStamped")
    made.header.frame_id = frame
    for axis, value in linear.items():
        setattr(made.twist.linear, axis, value)
    made.twist.angular.z = 0.5
    return made


def test_the_pose_is_about_home_and_the_twist_in_the_axes_of_the_earth(copter: Any) -> None:
    poses = copter.listen("ap/pose/filtered", "geometry_msgs/PoseStamped")
    twists = copter.listen("ap/twist/filtered", "geometry_msgs/TwistStamped")
    copter.run(10 * MS)
    copter.emit("HOME_POSITION", x=1.0, y=2.0, z=-0.5, q=(1.0, 0.0, 0.0, 0.0))
    facing_east(copter)
    copter.emit("LOCAL_POSITION_NED", x=4.0, y=7.0, z=-10.5, vx=1.0, vy=2.0, vz=3.0)
    copter.run(10 * MS)
    [pose], [moving] = poses, twists
    place, turned = pose.pose.position, pose.pose.orientation
    assert (place.x, place.y, place.z) == (5.0, 3.0, 10.0)
    assert abs(turned.w) == pytest.approx(1.0)  # forwards is the axis x, which is east
    linear, angular = moving.twist.linear, moving.twist.angular
    assert (linear.x, linear.y, linear.z) == (2.0, 1.0, -3.0)
    assert (angular.x, angular.y, angular.z) == pytest.approx((0.1, -0.2, -0.3))
    assert pose.header.frame_id == moving.header.frame_id == "base_link"


def test_altitudes_are_amsl(copter: Any) -> None:
    fixes = copter.listen("ap/navsat", "sensor_msgs/NavSatFix")
    places = copter.listen("ap/geopose/filtered", "geographic_msgs/GeoPoseStamped")
    goals = copter.listen("ap/goal_lla", "geographic_msgs/GeoPointStamped")
    copter.run(10 * MS)
    here = {"lat": 473977418, "lon": 85455939, "alt": 488_100}
    copter.emit("GPS_RAW_INT", **here, fix_type=4)
    copter.emit("GLOBAL_POSITION_INT", **here)
    for _ in range(2):
        copter.emit("POSITION_TARGET_GLOBAL_INT", lat_int=473977418, lon_int=85455939, alt=500.5)
    copter.run(10 * MS)
    [fix], [place], [goal] = fixes, places, goals
    assert (fix.altitude, fix.status.status, fix.header.frame_id) == (488.1, 1, "0")
    assert (place.pose.position.latitude, place.pose.position.altitude) == (47.3977418, 488.1)
    assert goal.position.altitude == 500.5


def test_status_is_published_when_it_changes_and_kept_for_late_subscriptions(copter: Any) -> None:
    copter.emit("EXTENDED_SYS_STATE", landed_state=2)
    copter.emit("SYS_STATUS", onboard_control_sensors_health=0x1_0000)
    for _ in range(2):
        copter.heartbeat(base_mode=128 | 81, custom_mode=GUIDED, system_status=5)
        copter.run(10 * MS)
    received = copter.listen("ap/status", "ardupilot_msgs/Status")
    copter.run(10 * MS)
    copter.heartbeat(base_mode=128 | 81, custom_mode=GUIDED, system_status=5)
    copter.run(10 * MS)
    [status] = received
    assert (status.vehicle_type, status.armed, status.mode, status.flying) == (2, True, GUIDED, True)
    assert list(status.failsafe) == [22]


def test_time_is_ros_time(copter: Any) -> None:
    times = copter.listen("ap/time", "builtin_interfaces/Time")
    copter.run(10 * MS)
    facing_east(copter)
    copter.run(10 * MS)
    [stamp], now = times, copter.graph.epoch + copter.kernel.now()
    assert stamp.sec * 10**9 + stamp.nanosec == pytest.approx(now, abs=1e8)


@pytest.mark.parametrize(
    ("frame", "linear", "ned"),
    [
        ("map", {"x": 1.0, "y": 2.0, "z": 3.0}, (2.0, 1.0, -3.0)),
        (
            "base_link",
            {"x": 1.0, "y": 2.0, "z": 3.0},
            (-2.0, 1.0, -3.0),
        ),  # y to the right
    ],
)
def test_a_velocity_is_turned_as_in_the_firmware(copter: Any, frame: str, linear: Any, ned: Any) -> None:
    facing_east(copter)
    copter.run(10 * MS)
    message = twist(frame, **linear)
    copter.publish(*VELOCITY, header=message.header, twist=message.twist)
    copter.run(10 * MS)
    [sent] = copter.asked("SET_POSITION_TARGET_LOCAL_NED")
    assert (sent["vx"], sent["vy"], sent["vz"]) == pytest.approx(ned, abs=1e-6)
    assert sent["yaw_rate"] == -0.5


def test_frames_that_the_firmware_ignores_are_named_once(copter: Any) -> None:
    for _ in range(2):
        copter.publish(*VELOCITY, twist=twist("").twist)
        copter.publish(*PLACE, coordinate_frame=7)
    copter.run(10 * MS)
    assert copter.sent == []
    texts = [event.text for event in copter.of_texts()]
    assert len(texts) == 2
    assert "frame '' is ignored" in texts[0]
    assert "coordinate_frame 7" in texts[1]


def test_a_place_is_sent_unless_a_part_of_it_is_ignored(copter: Any) -> None:
    header = new("std_msgs/Header", frame_id="map")
    place = {"latitude": 47.3977418, "longitude": 8.5455939, "altitude": 20.0, "coordinate_frame": 6}
    copter.publish(*PLACE, header=header, type_mask=4, **place)
    copter.publish(*PLACE, header=header, **place)
    copter.run(10 * MS)
    [sent] = copter.asked("SET_POSITION_TARGET_GLOBAL_INT")
    assert (sent["coordinate_frame"], sent["lat_int"], sent["alt"]) == (6, 473977418, 20.0)


def test_axes_override_channels_and_nan_releases_one(copter: Any) -> None:
    copter.publish("ap/joy", "sensor_msgs/Joy", axes=[0.0, 0.0, 0.0])
    copter.publish("ap/joy", "sensor_msgs/Joy", axes=[0.0, 0.5, -1.0, nan, 2.0])
    copter.run(10 * MS)
    [sent] = copter.asked("RC_CHANNELS_OVERRIDE")
    assert [sent[f"chan{number}_raw"] for number in range(1, 7)] == [1500, 1750, 1000, 0, 2000, 65535]


def test_services_answer_with_the_autopilot_s_acknowledgement(copter: Any) -> None:
    copter.answers["COMMAND_LONG"] = lambda sent: copter.emit(
        "COMMAND_ACK", command=sent["command"], result=0 if sent["command"] != 22 else 4
    )
    assert copter.call("ap/arm_motors", "ardupilot_msgs/ArmMotors", arm=True).result
    switched = copter.call("ap/mode_switch", "ardupilot_msgs/ModeSwitch", mode=GUIDED)
    assert (switched.status, switched.curr_mode) == (True, GUIDED)
    assert not copter.call("ap/experimental/takeoff", "ardupilot_msgs/Takeoff", alt=10.0).status
    asked = [(one["command"], one["param1"], one["param7"]) for one in copter.asked("COMMAND_LONG")]
    assert [one for one in asked if one[0] != 511] == [(400, 1.0, 0.0), (176, 1.0, 0.0), (22, 0.0, 10.0)]


def test_the_check_before_arming_is_that_of_sys_status(copter: Any) -> None:
    assert not copter.call("ap/prearm_check", "std_srvs/Trigger").success
    copter.emit("SYS_STATUS", onboard_control_sensors_health=0x1000_0000)
    copter.run(10 * MS)
    answer = copter.call("ap/prearm_check", "std_srvs/Trigger")
    assert (answer.success, answer.message) == (True, "Vehicle is Armable")


def test_names_of_4_5_number_the_sensors(rig_of: Any) -> None:
    old = rig_of(names=MAVLINK_SCHEMES["ardupilot-4.5"])
    old.heartbeat()
    old.run(50 * MS)
    names = {topic.name for topic in old.graph.topics()}
    assert {"/drone_1/ap/navsat/navsat0", "/drone_1/ap/battery/battery0"} <= names
    assert "/drone_1/ap/status" not in names
    assert {one.name for one in old.graph.services()} >= {"/drone_1/ap/arm_motors", "/drone_1/ap/mode_switch"}
    assert not any("prearm" in one.name for one in old.graph.services())
