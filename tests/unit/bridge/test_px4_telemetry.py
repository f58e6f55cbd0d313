"""The topics below fmu/out: state, motion and sensors of a PX4 from its MAVLink telemetry."""

from math import pi
from typing import Any

import pytest

from volery.base.time import MS, S
from volery.bridge import MAVLINK_SCHEMES

OFFBOARD = 6 << 16
ARMED = 128
COVARIANCE = {"pose_covariance": (0.25,) * 21, "velocity_covariance": (0.04,) * 21}


@pytest.fixture
def px4(rig_of: Any) -> Any:
    made = rig_of(names=MAVLINK_SCHEMES["px4"])
    made.heartbeat(autopilot=12)
    made.run(50 * MS)
    made.sent.clear()
    return made


def test_status_is_that_of_the_heartbeat(px4: Any) -> None:
    received = px4.listen("fmu/out/vehicle_status_v1", "px4_msgs/VehicleStatus")
    px4.emit("SYS_STATUS", onboard_control_sensors_health=0x1000_0000)
    px4.run(10 * MS)
    px4.heartbeat(autopilot=12, base_mode=ARMED, custom_mode=OFFBOARD, system_status=5)
    px4.run(10 * MS)
    last = received[-1]
    assert (last.nav_state, last.arming_state, last.failsafe) == (14, 2, True)
    assert last.pre_flight_checks_pass
    assert last.system_id == 1
    assert last.armed_time > 0


@pytest.mark.parametrize("child", [1, 12])
def test_one_odometry_is_attitude_position_and_odometry(px4: Any, child: int) -> None:
    attitudes = px4.listen("fmu/out/vehicle_attitude", "px4_msgs/VehicleAttitude")
    places = px4.listen("fmu/out/vehicle_local_position_v1", "px4_msgs/VehicleLocalPosition")
    odometries = px4.listen("fmu/out/vehicle_odometry", "px4_msgs/VehicleOdometry")
    px4.emit("ESTIMATOR_STATUS", flags=63)
    px4.emit("GPS_GLOBAL_ORIGIN", latitude=473977418, longitude=85455939, altitude=488_000)
    px4.run(10 * MS)
    east_facing = (0.5**0.5, 0.0, 0.0, 0.5**0.5)
    speed = {"vx": 0.0, "vy": 3.0} if child == 1 else {"vx": 3.0, "vy": 0.0}  # eastwards is forwards
    rates = {"rollspeed": 0.1, "pitchspeed": 0.2, "yawspeed": 0.3}
    frame = {"frame_id": 1, "child_frame_id": child}
    fields = {"x": 1.0, "y": 2.0, "z": -5.0, "vz": -1.0, "q": east_facing, **speed, **rates}
    px4.emit("ODOMETRY", **frame, **fields, **COVARIANCE)
    px4.run(10 * MS)
    [attitude], [place], [odometry] = attitudes, places, odometries
    assert list(attitude.q) == pytest.approx(east_facing)
    assert (place.x, place.y, place.z) == (1.0, 2.0, -5.0)
    assert (place.vx, place.vy, place.vz) == pytest.approx((0.0, 3.0, -1.0), abs=1e-6)
    assert place.heading == pytest.approx(pi / 2)
    assert place.xy_valid
    assert place.z_valid
    assert place.xy_global
    assert (place.ref_lat, place.ref_lon, place.ref_alt) == (47.3977418, 8.5455939, 488.0)
    assert list(odometry.velocity) == pytest.approx((0.0, 3.0, -1.0), abs=1e-6)
    assert list(odometry.angular_velocity) == pytest.approx((0.1, 0.2, 0.3))
    assert (odometry.pose_frame, odometry.velocity_frame) == (1, 1)


def test_altitudes_are_amsl_and_above_the_ellipsoid(rig_of: Any) -> None:
    raised = rig_of(47.0, names=MAVLINK_SCHEMES["px4"])
    raised.heartbeat(autopilot=12)
    fixes = raised.listen("fmu/out/vehicle_gps_position", "px4_msgs/SensorGps")
    places = raised.listen("fmu/out/vehicle_global_position", "px4_msgs/VehicleGlobalPosition")
    raised.run(10 * MS)
    here = {"lat": 473977418, "lon": 85455939, "alt": 488_100}
    raised.emit("GPS_RAW_INT", **here, fix_type=3, vel=250, cog=9000, satellites_visible=11, eph=90, epv=120)
    raised.emit("GLOBAL_POSITION_INT", **here, relative_alt=100, vx=250)
    raised.run(10 * MS)
    [fix], [place] = fixes, places
    assert (fix.altitude_msl_m, fix.altitude_ellipsoid_m) == (488.1, 535.1)
    assert (fix.latitude_deg, fix.longitude_deg, fix.satellites_used) == (47.3977418, 8.5455939, 11)
    assert fix.cog_rad == pytest.approx(pi / 2)
    assert place.alt == pytest.approx(488.1, abs=1e-3)
    assert place.alt_ellipsoid == pytest.approx(535.1, abs=1e-3)


def test_missing_messages_are_requested(rig_of: Any) -> None:
    made = rig_of(names=MAVLINK_SCHEMES["px4"])
    made.heartbeat(autopilot=12)
    made.run(2 * S)
    intervals = {one["param1"]: one["param2"] for one in made.asked("COMMAND_LONG") if one["command"] == 511}
    assert intervals[331] == 20_000
    slow = rig_of(names=MAVLINK_SCHEMES["px4"], rate=20)
    slow.heartbeat(autopilot=12)
    slow.run(2 * S)
    intervals = {one["param1"]: one["param2"] for one in slow.asked("COMMAND_LONG") if one["command"] == 511}
    assert intervals[331] == 50_000
    assert intervals[24] == 200_000
