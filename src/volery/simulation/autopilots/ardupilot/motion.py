"""Telemetry of ArduPilot about where the vehicle is and how it moves.

Units and signs are the messages' own.
"""

from __future__ import annotations

from math import atan2, degrees, hypot, nan, pi

from volery.base.frames import attitude_enu_to_ned, quaternion_to_euler
from volery.base.time import US, S
from volery.simulation.autopilots.manoeuvres.to_point import bearing
from volery.simulation.autopilots.mavlink.message_fields import (
    EPOCH_US,
    Fields,
    boot_ms,
    boot_us,
    heading_cdeg,
    to_int16,
    to_uint16,
)
from volery.simulation.autopilots.vehicle_state import Vehicle

NO_FIX_AFTER = int(9.64 * S)
"""From this uptime on the receiver is known."""
FIX_AFTER = int(9.85 * S)
"""From this uptime on it has a fix."""
GRAVITY_MILLI = 1000.0 / 9.80665
ZERO_CELSIUS_RISE = 2850
"""What the recorded boards' thermometers show in flight [cdegC]."""


def _has_fix(vehicle: Vehicle) -> bool:
    return vehicle.uptime() >= FIX_AFTER


def _cm(metres: float) -> int:
    """Millimetres, as a firmware that reckons in centimetres gives them."""
    return round(metres * 100.0) * 10


def global_position(vehicle: Vehicle) -> Fields:
    """GLOBAL_POSITION_INT: sent with zeros while there is no fix."""
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


def local_position(vehicle: Vehicle) -> Fields | None:
    """LOCAL_POSITION_NED: only with a position."""
    if vehicle.uptime() < vehicle.firmware.local_position_after:
        return None
    estimate = vehicle.estimate
    if not estimate.position_ok:
        return None
    x, y, z = estimate.position
    vx, vy, vz = estimate.velocity
    return {"time_boot_ms": boot_ms(vehicle), "x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz}


def vfr_hud(vehicle: Vehicle) -> Fields:
    """VFR_HUD."""
    estimate = vehicle.estimate
    north, east, down = estimate.velocity
    ground = hypot(north, east)
    return {
        "airspeed": hypot(ground, down),
        "groundspeed": ground,
        "heading": int(degrees(estimate.attitude[2])) % 360,
        "throttle": round(abs(estimate.throttle) * 100.0) if vehicle.armed else 0,
        "alt": estimate.geodetic[2] if _has_fix(vehicle) else 0.0,
        "climb": -down,
    }


def _imu(vehicle: Vehicle) -> Fields:
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


def _compass(vehicle: Vehicle) -> Fields:
    if vehicle.uptime() < vehicle.firmware.ready_after:
        return {}
    x, y, z = vehicle.estimate.mag
    return {"xmag": to_int16(x * 1000.0), "ymag": to_int16(y * 1000.0), "zmag": to_int16(z * 1000.0)}


def raw_imu(vehicle: Vehicle) -> Fields:
    """RAW_IMU: milli-g, mrad/s, milligauss."""
    return {"time_usec": boot_us(vehicle), "id": 0, **_imu(vehicle)}


def scaled_imu2(vehicle: Vehicle) -> Fields:
    """SCALED_IMU2: the second unit reads as the first."""
    return {"time_boot_ms": boot_ms(vehicle), **_imu(vehicle)}


def scaled_imu3(vehicle: Vehicle) -> Fields:
    """SCALED_IMU3: there is no third unit but a third compass."""
    return {"time_boot_ms": boot_ms(vehicle), **_compass(vehicle)}


def pressure(vehicle: Vehicle) -> Fields:
    """SCALED_PRESSURE and SCALED_PRESSURE2."""
    return {
        "time_boot_ms": boot_ms(vehicle),
        "press_abs": vehicle.estimate.pressure,
        "press_diff": 0.0,
        "temperature": ZERO_CELSIUS_RISE,
    }


def gps_raw(vehicle: Vehicle) -> Fields:
    """GPS_RAW_INT."""
    if vehicle.uptime() < NO_FIX_AFTER:
        return {"eph": 65_535, "epv": 65_535}
    fix = vehicle.estimate.gps
    if fix.fix_type == 0 or not _has_fix(vehicle):
        return {
            "time_usec": boot_us(vehicle),
            "fix_type": 1,
            "eph": 9999,
            "epv": 9999,
            "satellites_visible": 3,
        }
    north, east, _ = fix.velocity
    speed = hypot(north, east)
    return {
        "time_usec": boot_us(vehicle),
        "fix_type": fix.fix_type,
        "lat": round(fix.latitude * 1e7),
        "lon": round(fix.longitude * 1e7),
        "alt": _cm(fix.amsl),
        "eph": to_uint16(fix.eph * 100.0),
        "epv": to_uint16(fix.epv * 100.0),
        "vel": to_uint16(speed * 100.0),
        "cog": heading_cdeg(atan2(east, north)) if speed > 0.0 else 0,
        "satellites_visible": fix.satellites,
        "alt_ellipsoid": _cm(fix.amsl),
        "h_acc": round(fix.h_acc * 1000.0),
        "v_acc": round(fix.v_acc * 1000.0),
        "vel_acc": round(fix.speed_acc * 1000.0),
    }


def system_time(vehicle: Vehicle) -> Fields:
    """SYSTEM_TIME: satellite time once there is a fix."""
    now = EPOCH_US + vehicle.kernel.now() // US
    return {"time_unix_usec": now if _has_fix(vehicle) else 0, "time_boot_ms": boot_ms(vehicle)}


def simstate(vehicle: Vehicle) -> Fields:
    """SIMSTATE: the truth, as ArduPilot's own simulator tells it."""
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


def ahrs(vehicle: Vehicle) -> Fields:
    """AHRS: the backup estimator's errors."""
    return {"error_rp": 0.0025, "error_yaw": abs(vehicle.estimate.heading_error)}


def ahrs2(vehicle: Vehicle) -> Fields | None:
    """AHRS2: the backup estimator, which here believes what the first one does."""
    if vehicle.uptime() < 4 * S:
        return None
    estimate = vehicle.estimate
    roll, pitch, yaw = estimate.attitude
    fields: Fields = {"roll": roll, "pitch": pitch, "yaw": yaw}
    if _has_fix(vehicle):
        latitude, longitude, amsl = estimate.geodetic
        fields |= {"altitude": amsl, "lat": round(latitude * 1e7), "lng": round(longitude * 1e7)}
    return fields


def nav_controller(vehicle: Vehicle) -> Fields:
    """NAV_CONTROLLER_OUTPUT."""
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


def position_target(vehicle: Vehicle) -> Fields | None:
    """POSITION_TARGET_GLOBAL_INT: only while there is a point to go to."""
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


def local_target(vehicle: Vehicle) -> Fields | None:
    """POSITION_TARGET_LOCAL_NED: the same point about the estimator's origin."""
    target = vehicle.manoeuvre.target
    if target is None or not vehicle.armed:
        return None
    x, y, z = target
    return {
        "time_boot_ms": boot_ms(vehicle),
        "coordinate_frame": 1,
        "type_mask": 65_016,
        "x": x,
        "y": y,
        "z": z,
    }


def home_position(vehicle: Vehicle) -> Fields | None:
    """HOME_POSITION: once there is a home."""
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


def origin(vehicle: Vehicle) -> Fields | None:
    """GPS_GLOBAL_ORIGIN: once the estimator has one."""
    if vehicle.home is None or not vehicle.estimate.position_ok:
        return None
    latitude, longitude, amsl = vehicle.estimate.origin
    return {
        "latitude": round(latitude * 1e7),
        "longitude": round(longitude * 1e7),
        "altitude": _cm(amsl),
        "time_usec": boot_us(vehicle),
    }


def rangefinder(vehicle: Vehicle) -> Fields | None:
    """RANGEFINDER: where one is set up and sees the ground."""
    distance = vehicle.estimate.rangefinder if vehicle.parameters["RNGFND1_TYPE"] else None
    return None if distance is None else {"distance": distance, "voltage": 0.0}


def distance_sensor(vehicle: Vehicle) -> Fields | None:
    """DISTANCE_SENSOR: the same, looking down."""
    distance = vehicle.estimate.rangefinder if vehicle.parameters["RNGFND1_TYPE"] else None
    if distance is None:
        return None
    return {
        "time_boot_ms": boot_ms(vehicle),
        "min_distance": 20,
        "max_distance": 3000,
        "current_distance": to_uint16(distance * 100.0),
        "orientation": 25,
    }
