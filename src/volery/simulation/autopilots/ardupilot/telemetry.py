"""Fields of ArduPilot's telemetry messages. Units and signs are those of the messages.

A builder returns None while the firmware does not send its message.
"""

from __future__ import annotations

from math import degrees, hypot, nan, pi

from volery.base.elementary import atan2
from volery.base.frames import attitude_enu_to_ned, euler_to_quaternion, quaternion_to_euler
from volery.base.time import US, S
from volery.links.mavlink_messages import constant
from volery.simulation.autopilots.ardupilot.sensor_status import FIX_AFTER, NO_FIX_AFTER, receiver_is_lost
from volery.simulation.autopilots.ardupilot.servo_outputs import outputs_of
from volery.simulation.autopilots.ardupilot.versions import ArduPilotVersion
from volery.simulation.autopilots.manoeuvres.guided_flight import Guided
from volery.simulation.autopilots.manoeuvres.to_point import bearing
from volery.simulation.autopilots.mavlink.messages import (
    EPOCH_US,
    Fields,
    boot_ms,
    boot_us,
    heading_cdeg,
    to_int16,
    to_uint16,
    to_uint32,
)
from volery.simulation.autopilots.onboard_mission import OnboardMission
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

GRAVITY_MILLI = 1000.0 / 9.80665
ZERO_CELSIUS_RISE = 2850
"""Temperature of the recorded boards in flight [cdegC]."""


def _has_fix(vehicle: AutopilotVehicle) -> bool:
    return vehicle.uptime() >= FIX_AFTER


def _cm(metres: float) -> int:
    """Return a length in mm, rounded to cm as in the firmware."""
    return round(metres * 100.0) * 10


def global_position(vehicle: AutopilotVehicle) -> Fields:
    """Return GLOBAL_POSITION_INT, with zeros before the first fix."""
    estimate = vehicle.estimate
    fields: Fields = {"time_boot_ms": boot_ms(vehicle), "hdg": heading_cdeg(estimate.attitude[2])}
    if not _has_fix(vehicle):
        return fields
    latitude, longitude, amsl = estimate.geodetic
    north, east, down = estimate.velocity
    fields["lat"], fields["lon"] = round(latitude * 1e7), round(longitude * 1e7)
    fields["alt"], fields["relative_alt"] = _cm(amsl), round(vehicle.height * 1000.0)
    fields["vx"], fields["vy"], fields["vz"] = (to_int16(speed * 100.0) for speed in (north, east, down))
    return fields


def local_position(vehicle: AutopilotVehicle) -> Fields | None:
    """Return LOCAL_POSITION_NED once there is a position."""
    if vehicle.uptime() < vehicle.rules.startup.local_position_after:
        return None
    estimate = vehicle.estimate
    if not vehicle.position_ok:
        return None
    x, y, z = estimate.position
    vx, vy, vz = estimate.velocity
    return {"time_boot_ms": boot_ms(vehicle), "x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz}


def vfr_hud(vehicle: AutopilotVehicle) -> Fields:
    """Return VFR_HUD: without an airspeed sensor the speed is that of the satellites."""
    estimate = vehicle.estimate
    north, east, down = estimate.velocity
    ground = hypot(north, east)
    return {
        "airspeed": hypot(ground, down),
        "groundspeed": ground,
        "heading": int(degrees(estimate.attitude[2]) % 360.0) % 360,
        "throttle": round(abs(estimate.throttle) * 100.0) if vehicle.armed else 0,
        "alt": estimate.geodetic[2] if _has_fix(vehicle) else 0.0,
        "climb": -down,
    }


def _imu(vehicle: AutopilotVehicle) -> Fields:
    estimate = vehicle.estimate
    return {
        "xacc": to_int16(estimate.accel[0] * GRAVITY_MILLI),
        "yacc": to_int16(estimate.accel[1] * GRAVITY_MILLI),
        "zacc": to_int16(estimate.accel[2] * GRAVITY_MILLI),
        "xgyro": to_int16(estimate.gyro[0] * 1000.0),
        "ygyro": to_int16(estimate.gyro[1] * 1000.0),
        "zgyro": to_int16(estimate.gyro[2] * 1000.0),
        **_compass(vehicle),
        "temperature": ZERO_CELSIUS_RISE,
    }


def _compass(vehicle: AutopilotVehicle) -> Fields:
    if vehicle.uptime() < vehicle.rules.startup.ready_after:
        return {}
    x, y, z = vehicle.estimate.mag
    return {"xmag": to_int16(x * 1000.0), "ymag": to_int16(y * 1000.0), "zmag": to_int16(z * 1000.0)}


def raw_imu(vehicle: AutopilotVehicle) -> Fields:
    """Return RAW_IMU (milli-g, mrad/s, milligauss)."""
    return {"time_usec": boot_us(vehicle), "id": 0, **_imu(vehicle)}


def scaled_imu2(vehicle: AutopilotVehicle) -> Fields:
    """Return SCALED_IMU2: the second unit measures like the first."""
    return {"time_boot_ms": boot_ms(vehicle), **_imu(vehicle)}


def scaled_imu3(vehicle: AutopilotVehicle) -> Fields:
    """Return SCALED_IMU3: there is no third unit but a third compass."""
    return {"time_boot_ms": boot_ms(vehicle), **_compass(vehicle)}


def pressure(vehicle: AutopilotVehicle) -> Fields:
    """Return SCALED_PRESSURE or SCALED_PRESSURE2."""
    return {
        "time_boot_ms": boot_ms(vehicle),
        "press_abs": vehicle.estimate.pressure,
        "press_diff": 0.0,
        "temperature": ZERO_CELSIUS_RISE,
    }


EPH, EPV = 121, 200
ACCURACY_WITHOUT_FIX = {"h_acc": 300, "v_acc": 300, "vel_acc": 40}
"""Dilutions [1/100] and accuracies [mm, mm/s] that the receiver of the original's simulator always states."""


def gps_raw(vehicle: AutopilotVehicle) -> Fields:
    """Return GPS_RAW_INT. Without a fix it still states where it is, like the original's simulator."""
    if vehicle.uptime() < NO_FIX_AFTER:
        return {"eph": 65_535, "epv": 65_535}
    if receiver_is_lost(vehicle):
        return {"eph": 9999, "epv": 9999}
    fix = vehicle.estimate.gps
    if fix.fix_type == 0 or not _has_fix(vehicle):
        return _gps_without_fix(vehicle)
    return {
        "time_usec": boot_us(vehicle),
        "fix_type": fix.fix_type,
        "satellites_visible": fix.satellites,
        **_gps_position(fix.latitude, fix.longitude, fix.amsl),
        **_gps_speed(*fix.velocity[:2]),
        "h_acc": round(fix.h_acc * 1000.0),
        "v_acc": round(fix.v_acc * 1000.0),
        "vel_acc": round(fix.speed_acc * 1000.0),
    }


def _gps_without_fix(vehicle: AutopilotVehicle) -> Fields:
    truth = vehicle.flight.truth()
    east, north, _ = truth.velocity
    last = boot_us(vehicle) - round(vehicle.estimate.gps_age * 1e6)
    return {
        "time_usec": max(0, last) if _has_fix(vehicle) else 0,  # the age may be that of another boot
        "fix_type": 1,
        "satellites_visible": 3,
        **_gps_position(*vehicle.flight.frame.from_enu(truth.position)),
        **_gps_speed(north, east),
        **ACCURACY_WITHOUT_FIX,
    }


def _gps_position(latitude: float, longitude: float, amsl: float) -> Fields:
    """Return the fields of a position [degrees, m], with the dilutions, which never change."""
    return {
        "lat": round(latitude * 1e7),
        "lon": round(longitude * 1e7),
        "alt": _cm(amsl),
        "alt_ellipsoid": _cm(amsl),
        "eph": EPH,
        "epv": EPV,
    }


def _gps_speed(north: float, east: float) -> Fields:
    speed = hypot(north, east)
    return {
        "vel": to_uint16(speed * 100.0),
        "cog": heading_cdeg(atan2(east, north)) if speed > 0.0 else 0,
    }


def system_time(vehicle: AutopilotVehicle) -> Fields:
    """Return SYSTEM_TIME, with satellite time once there is a fix."""
    now = EPOCH_US + vehicle.kernel.now() // US
    return {"time_unix_usec": now if _has_fix(vehicle) else 0, "time_boot_ms": boot_ms(vehicle)}


def simstate(vehicle: AutopilotVehicle) -> Fields:
    """Return SIMSTATE: the true state, as sent by ArduPilot's own simulator."""
    truth = vehicle.flight.truth()
    roll, pitch, yaw = quaternion_to_euler(attitude_enu_to_ned(truth.attitude))
    latitude, longitude, _ = vehicle.flight.frame.from_enu(truth.position)
    p, q, r = truth.rates
    x, y, z = vehicle.estimate.accel
    return {
        "roll": roll,
        "pitch": pitch,
        "yaw": yaw,
        "xacc": x,
        "yacc": y,
        "zacc": z,
        "xgyro": p,
        "ygyro": -q,
        "zgyro": -r,
        "lat": round(latitude * 1e7),
        "lng": round(longitude * 1e7),
    }


def ahrs(vehicle: AutopilotVehicle) -> Fields:
    """Return AHRS: errors of the backup estimator."""
    return {"error_rp": 0.0025, "error_yaw": abs(vehicle.estimate.heading_error)}


def ahrs2(vehicle: AutopilotVehicle) -> Fields | None:
    """Return AHRS2: the backup estimator, here equal to the first."""
    if vehicle.uptime() < 4 * S:
        return None
    estimate = vehicle.estimate
    roll, pitch, yaw = estimate.attitude
    fields: Fields = {"roll": roll, "pitch": pitch, "yaw": yaw}
    if _has_fix(vehicle):
        latitude, longitude, amsl = estimate.geodetic
        fields |= {"altitude": amsl, "lat": round(latitude * 1e7), "lng": round(longitude * 1e7)}
    return fields


def nav_controller(vehicle: AutopilotVehicle) -> Fields:
    """Return NAV_CONTROLLER_OUTPUT."""
    estimate, target = vehicle.estimate, vehicle.manoeuvre.target
    roll, pitch, yaw = estimate.target_attitude
    fields: Fields = {
        "nav_roll": degrees(roll),
        "nav_pitch": degrees(pitch),
        "nav_bearing": round(degrees(yaw)),
    }
    if target is not None:
        away = bearing(estimate.position, target) % (2.0 * pi)
        fields["target_bearing"] = int(degrees(away))
        fields["wp_dist"] = min(65_535, int(vehicle.manoeuvre.distance()))
        fields["alt_error"] = estimate.position[2] - target[2]
    return fields


def position_target(vehicle: AutopilotVehicle) -> Fields | None:
    """Return POSITION_TARGET_GLOBAL_INT while the vehicle flies to a point."""
    target = vehicle.manoeuvre.target
    if target is None or not vehicle.armed:
        return None
    latitude, longitude, amsl = vehicle.flight.from_ned(target)
    return {
        "time_boot_ms": boot_ms(vehicle),
        "coordinate_frame": 0,
        "type_mask": 65_016,
        "lat_int": round(latitude * 1e7),
        "lon_int": round(longitude * 1e7),
        "alt": amsl,
    }


VELOCITY_ONLY = 0b1100_0000_0111
"""``type_mask`` of a velocity and an acceleration: position, yaw and yaw rate are ignored."""


def local_target(vehicle: AutopilotVehicle) -> Fields | None:
    """Return POSITION_TARGET_LOCAL_NED while the vehicle flies to a point or follows a velocity."""
    manoeuvre = vehicle.manoeuvre.flown
    if not vehicle.armed:
        return None
    fields: Fields = {"time_boot_ms": boot_ms(vehicle), "coordinate_frame": 1}
    followed = manoeuvre.followed if isinstance(manoeuvre, Guided) else None
    if followed is not None:
        (vx, vy, vz), (ax, ay, az) = followed
        motion = {"vx": vx, "vy": vy, "vz": vz, "afx": ax, "afy": ay, "afz": az}
        return {**fields, "type_mask": VELOCITY_ONLY, **motion}
    if manoeuvre.target is None:
        return None
    x, y, z = manoeuvre.target
    return {**fields, "type_mask": 65_016, "x": x, "y": y, "z": z}


def home_position(vehicle: AutopilotVehicle) -> Fields | None:
    """Return HOME_POSITION once it is set."""
    home = vehicle.home
    if home is None:
        return None
    x, y, z = home.ned
    return {
        "latitude": round(home.latitude * 1e7),
        "longitude": round(home.longitude * 1e7),
        "altitude": _cm(home.amsl),
        "x": x,
        "y": y,
        "z": z,
        "q": (nan, nan, nan, nan),
        "time_usec": boot_us(vehicle),
    }


def origin(vehicle: AutopilotVehicle) -> Fields | None:
    """Return GPS_GLOBAL_ORIGIN once the estimator has an origin."""
    if vehicle.home is None or not vehicle.position_ok:
        return None
    latitude, longitude, amsl = vehicle.estimate.origin
    return {
        "latitude": round(latitude * 1e7),
        "longitude": round(longitude * 1e7),
        "altitude": _cm(amsl),
        "time_usec": boot_us(vehicle),
    }


ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
CALIBRATING = constant("MAV_STATE_CALIBRATING")
STANDBY = constant("MAV_STATE_STANDBY")
ACTIVE = constant("MAV_STATE_ACTIVE")
CRITICAL = constant("MAV_STATE_CRITICAL")
ON_GROUND = constant("MAV_LANDED_STATE_ON_GROUND")
IN_AIR = constant("MAV_LANDED_STATE_IN_AIR")
TAKING_OFF = constant("MAV_LANDED_STATE_TAKEOFF")
LANDING = constant("MAV_LANDED_STATE_LANDING")


def heartbeat(vehicle: AutopilotVehicle, kind: int, system_status: int) -> Fields:
    """Return HEARTBEAT of a vehicle of that MAV_TYPE and MAV_STATE."""
    return {
        "type": kind,
        "autopilot": 3,
        "base_mode": vehicle.mode.base_mode | (ARMED if vehicle.armed else 0),
        "custom_mode": vehicle.mode.number,
        "system_status": system_status,
        "mavlink_version": 3,
    }


def extended_sys_state(vehicle: AutopilotVehicle) -> Fields:
    """Return EXTENDED_SYS_STATE."""
    if vehicle.landed:
        landed = ON_GROUND
    elif vehicle.manoeuvre.taking_off:
        landed = TAKING_OFF
    else:
        landed = LANDING if vehicle.manoeuvre.landing else IN_AIR
    return {"vtol_state": 3, "landed_state": landed}


def rc_channels(vehicle: AutopilotVehicle) -> Fields:
    """Return RC_CHANNELS, including overrides."""
    fields: Fields = {"time_boot_ms": boot_ms(vehicle), "chancount": 16, "rssi": 255}
    for number, pulse in enumerate(vehicle.rc.pulses(), start=1):
        fields[f"chan{number}_raw"] = pulse
    return fields


def rc_channels_raw(vehicle: AutopilotVehicle) -> Fields:
    """Return RC_CHANNELS_RAW: the first eight channels."""
    fields: Fields = {"time_boot_ms": boot_ms(vehicle), "port": 0, "rssi": 255}
    for number, pulse in enumerate(vehicle.rc.pulses()[:8], start=1):
        fields[f"chan{number}_raw"] = pulse
    return fields


def rc_channels_scaled(vehicle: AutopilotVehicle) -> Fields:
    """Return RC_CHANNELS_SCALED: steering and throttle outputs in 1/10000."""
    steering, throttle = vehicle.estimate.motors
    return {
        "time_boot_ms": boot_ms(vehicle),
        "chan1_scaled": round(steering * 10_000.0),
        "chan3_scaled": round(throttle * 10_000.0),
        "rssi": 255,
    }


def servo_output(vehicle: AutopilotVehicle) -> Fields:
    """Return SERVO_OUTPUT_RAW."""
    return {
        "time_usec": to_uint32(boot_us(vehicle)),
        "port": 0,
        **{f"servo{motor}_raw": pulse for motor, pulse in enumerate(vehicle.estimate.motor_pwm, start=1)},
        **{f"servo{channel}_raw": pulse for channel, pulse in outputs_of(vehicle).servos.items()},
    }


NO_MISSION, NOT_STARTED, IN_PROGRESS, COMPLETE = 1, 2, 3, 5
"""MISSION_STATE."""


def _mission_state(plan: OnboardMission) -> int:
    if len(plan) <= 1:
        return NO_MISSION
    if plan.complete:
        return COMPLETE
    return IN_PROGRESS if plan.current else NOT_STARTED


def mission_current(vehicle: AutopilotVehicle) -> Fields:
    """Return MISSION_CURRENT; the home position is not counted as an item."""
    plan = vehicle.mission
    return {
        "seq": plan.current,
        "total": max(0, len(plan) - 1),
        "mission_state": _mission_state(plan),
        "mission_mode": int(vehicle.mode.name in ("AUTO", "AUTO_RTL")),
    }


WITHOUT_POSITION, WITH_POSITION, STARTING = 167, 831, 1024
"""EKF_STATUS_FLAGS as recorded: attitude and height only, with a position, not initialised."""

EKF_REPORTS_AFTER, EKF_STARTS_AFTER, EKF_ALIGNED_AFTER = int(3.3 * S), int(5.3 * S), int(5.75 * S)


def ekf_status(vehicle: AutopilotVehicle) -> Fields | None:
    """Return EKF_STATUS_REPORT."""
    age = vehicle.uptime()
    if age < EKF_REPORTS_AFTER:
        return None
    if age < EKF_ALIGNED_AFTER:
        return {"flags": STARTING if age < EKF_STARTS_AFTER else 0}
    estimate = vehicle.estimate
    flags = WITH_POSITION if vehicle.has_position else WITHOUT_POSITION
    return {
        "flags": flags,
        "velocity_variance": 0.007,
        "pos_horiz_variance": estimate.gps_innovation / 5.0,
        "pos_vert_variance": 0.002,
        "compass_variance": min(1.0, abs(estimate.heading_error)),
    }


def vibration(vehicle: AutopilotVehicle) -> Fields:
    """Return VIBRATION: the body model has none."""
    return {"time_usec": boot_us(vehicle), "vibration_x": 0.003, "vibration_y": 0.003, "vibration_z": 0.003}


def wind(vehicle: AutopilotVehicle) -> Fields | None:
    """Return WIND: without an airspeed sensor the firmware estimates none."""
    return {"direction": -180.0, "speed": 0.0, "speed_z": 0.0} if vehicle.has_position else None


def terrain_report(vehicle: AutopilotVehicle) -> Fields:
    """Return TERRAIN_REPORT: there is no terrain data on board."""
    if vehicle.uptime() < FIX_AFTER:
        return {"spacing": 100, "pending": 56}
    latitude, longitude, amsl = vehicle.estimate.geodetic
    return {
        "lat": round(latitude * 1e7),
        "lon": round(longitude * 1e7),
        "current_height": amsl,
        "pending": 504,
    }


def attitude_target(vehicle: AutopilotVehicle) -> Fields:
    """Return ATTITUDE_TARGET of a copter, without body rates."""
    estimate = vehicle.estimate
    q = euler_to_quaternion(*estimate.target_attitude)
    return {"time_boot_ms": boot_ms(vehicle), "q": q, "thrust": estimate.throttle if vehicle.armed else 0.0}


def power_status(_vehicle: AutopilotVehicle) -> Fields:
    """Return POWER_STATUS."""
    return {"Vcc": 5000}


def meminfo(_vehicle: AutopilotVehicle) -> Fields:
    """Return MEMINFO."""
    return {"brkval": 0, "freemem": 65_535, "freemem32": 131_072}


def autopilot_version(version: ArduPilotVersion, capabilities: int, board: bytes) -> Fields:
    """Return AUTOPILOT_VERSION with the board's serial number."""
    return {
        "capabilities": capabilities,
        "flight_sw_version": version.number,
        "flight_custom_version": tuple(version.commit.encode()),
        "uid2": tuple(board.ljust(18, b"\0")[:18]),
    }
