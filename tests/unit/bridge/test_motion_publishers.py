"""Where the vehicle is: NED to ENU, FRD to FLU, AMSL to the ellipsoid."""

from math import nan, pi
from typing import Any

import pytest

from volery.base.time import MS

ODOMETRY = "nav_msgs/Odometry"
EAST = {"yaw": pi / 2}


def xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def test_topics_on_demand_need_a_subscription(rig: Any) -> None:
    rig.connect()
    before = sum(call.startswith("publish") for _, call in rig.priced)
    rig.emit("SERVO_OUTPUT_RAW", servo1_raw=1100)
    rig.run(200 * MS)
    assert sum(call.startswith("publish") for _, call in rig.priced) == before


def test_the_receivers_own_speed_and_satellites(rig: Any) -> None:
    rig.connect()
    twists = rig.listen("global_position/raw/gps_vel", "geometry_msgs/TwistStamped")
    seen = rig.listen("global_position/raw/satellites", "std_msgs/UInt32")
    rig.emit("GPS_RAW_INT", vel=500, cog=9000, satellites_visible=11)
    rig.run(200 * MS)
    rig.emit("GPS_RAW_INT", vel=65535, cog=65535, satellites_visible=255)
    rig.run(200 * MS)
    [twist] = twists
    assert xyz(twist.twist.linear) == pytest.approx((5.0, 0.0, 0.0))  # east
    assert [message.data for message in seen] == [11]


def test_odometry_about_the_autopilots_origin_has_its_velocity_in_the_body(rig: Any) -> None:
    rig.connect()
    poses = rig.listen("local_position/odom", ODOMETRY)
    twists = rig.listen("local_position/velocity_body", "geometry_msgs/TwistStamped")
    rig.emit("ATTITUDE", rollspeed=0.1, pitchspeed=0.2, yawspeed=0.3, **EAST)
    rig.emit("LOCAL_POSITION_NED", x=1.0, y=2.0, z=-3.0, vx=0.5, vy=4.0, vz=0.25)
    rig.run(200 * MS)
    [odometry], [twist] = poses, twists
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("map", "base_link")
    assert xyz(odometry.pose.pose.position) == (2.0, 1.0, 3.0)
    # heading east: 4 m/s east is forward, 0.5 m/s north is to the left, 0.25 m/s down
    assert xyz(odometry.twist.twist.linear) == pytest.approx((4.0, 0.5, -0.25), abs=1e-6)
    assert xyz(twist.twist.linear) == pytest.approx((4.0, 0.5, -0.25), abs=1e-6)
    assert xyz(twist.twist.angular) == pytest.approx((0.1, -0.2, -0.3))
    assert twist.header.frame_id == "base_link"


def test_odometry_about_home(rig: Any) -> None:
    rig.connect()
    received = rig.listen("global_position/local", ODOMETRY)
    place = {"lat": 470000000, "lon": 80010000, "alt": 410_000, "relative_alt": 10_000}
    rig.emit("GLOBAL_POSITION_INT", **place, vx=100, vy=200, vz=-50)
    rig.run(200 * MS)
    assert received == []  # about what?
    rig.emit("HOME_POSITION", latitude=470000000, longitude=80000000, altitude=400_000)
    rig.emit("GLOBAL_POSITION_INT", **place, vx=100, vy=200, vz=-50)
    rig.run(200 * MS)
    [odometry] = received
    assert xyz(odometry.pose.pose.position) == pytest.approx((76.06, 0.0, 10.0), abs=0.05)
    assert xyz(odometry.twist.twist.linear) == (2.0, 1.0, 0.5)


def test_the_origin_and_home_are_ellipsoidal(raised_rig: Any) -> None:
    rig = raised_rig
    rig.connect()
    origins = rig.listen("global_position/gp_origin", "geographic_msgs/GeoPointStamped")
    rig.emit("GPS_GLOBAL_ORIGIN", latitude=470000000, longitude=80000000, altitude=400_000)
    rig.run(200 * MS)
    [origin] = origins
    assert (origin.position.latitude, origin.position.longitude) == (47.0, 8.0)
    assert origin.position.altitude == 447.0


def test_px4s_altitudes(rig: Any) -> None:
    rig.heartbeat(autopilot=12)
    rig.run(200 * MS)
    received = rig.listen("altitude", "mavros_msgs/Altitude")
    rig.emit(
        "ALTITUDE", altitude_monotonic=1.0, altitude_amsl=488.0, altitude_local=2.0, altitude_relative=3.0
    )
    rig.run(200 * MS)
    [one] = received
    assert (one.monotonic, one.amsl, one.local, one.relative) == (1.0, 488.0, 2.0, 3.0)


def test_invalid_numbers_are_reported_once(rig: Any) -> None:
    rig.connect()
    received = rig.listen("setpoint_raw/target_local", "mavros_msgs/PositionTarget")
    for yaw in (float("inf"), float("inf"), nan, 0.0):
        rig.emit("POSITION_TARGET_LOCAL_NED", coordinate_frame=1, yaw=yaw)
        rig.run(200 * MS)
    assert len(received) == 2  # not a number is what PX4 says of what it does not hold
    [warning] = rig.of_texts()
    assert warning.text.startswith("POSITION_TARGET_LOCAL_NED: not published")
