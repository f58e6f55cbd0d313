"""Telemetry of PX4 about where the vehicle is and how it moves. Units and signs are the messages' own."""

from __future__ import annotations

from math import atan2, degrees, hypot, nan

from volery.base.frames import euler_to_quaternion, quaternion_to_euler
from volery.base.time import MS, US, Ns
from volery.simulation.autopilots.mavlink import message_fields
from volery.simulation.autopilots.mavlink.message_fields import (
    EPOCH_US,
    Fields,
    boot_ms,
    boot_us,
    heading_cdeg,
    to_int16,
    to_uint16,
)
from volery.simulation.autopilots.px4 import modes
from volery.simulation.autopilots.px4.commander import ATTITUDE_AFTER, of
from volery.simulation.autopilots.px4.offboard import AttitudeTarget
from volery.simulation.autopilots.px4.planned import Orbit
from volery.simulation.autopilots.vehicle_state import Vehicle

GLOBAL_AFTER: Ns = 6_500 * MS
"""Recorded: the first GLOBAL_POSITION_INT a tenth of a second after the first ATTITUDE."""

HOME_FROM: Ns = 2_200 * MS
"""Before there is a home, the receiver's own place is sent as one."""

NOT_KNOWN = 65_535


def _aligned(vehicle: Vehicle) -> bool:
    return vehicle.uptime() >= ATTITUDE_AFTER


def attitude(vehicle: Vehicle) -> Fields | None:
    """ATTITUDE: once the estimator is aligned."""
    return message_fields.attitude(vehicle) if _aligned(vehicle) else None


def attitude_quaternion(vehicle: Vehicle) -> Fields | None:
    """ATTITUDE_QUATERNION: likewise."""
    return message_fields.attitude_quaternion(vehicle) if _aligned(vehicle) else None


def global_position(vehicle: Vehicle) -> Fields | None:
    """GLOBAL_POSITION_INT: once there is a position."""
    estimate = vehicle.estimate
    if vehicle.uptime() < GLOBAL_AFTER or not estimate.position_ok:
        return None
    latitude, longitude, amsl = estimate.geodetic
    north, east, down = estimate.velocity
    return {
        "time_boot_ms": boot_ms(vehicle),
        "lat": round(latitude * 1e7),
        "lon": round(longitude * 1e7),
        "alt": round(amsl * 1000.0),
        "relative_alt": round(vehicle.height * 1000.0),
        "vx": to_int16(north * 100.0),
        "vy": to_int16(east * 100.0),
        "vz": to_int16(down * 100.0),
        "hdg": heading_cdeg(estimate.attitude[2]),
    }


def local_position(vehicle: Vehicle) -> Fields:
    """LOCAL_POSITION_NED: from the start."""
    estimate = vehicle.estimate
    fields: Fields = {"time_boot_ms": boot_ms(vehicle)}
    if estimate.position_ok:
        fields["x"], fields["y"], fields["z"] = estimate.position
        fields["vx"], fields["vy"], fields["vz"] = estimate.velocity
    return fields


def odometry(vehicle: Vehicle) -> Fields:
    """ODOMETRY."""
    estimate = vehicle.estimate
    p, q, r = estimate.rates
    x, y, z = estimate.position
    vx, vy, vz = estimate.velocity
    plane, height, speed, climb = (spread**2 for spread in estimate.spread)
    return {
        "time_usec": boot_us(vehicle),
        "frame_id": 1,
        "child_frame_id": 1,
        "x": x,
        "y": y,
        "z": z,
        "q": estimate.quaternion,
        "vx": vx,
        "vy": vy,
        "vz": vz,
        "rollspeed": p,
        "pitchspeed": q,
        "yawspeed": r,
        "pose_covariance": _diagonal(plane, plane, height, 4.5e-4, 4.5e-4, 1.2e-3),
        "velocity_covariance": _diagonal(speed, speed, climb, nan, nan, nan),
        "estimator_type": 8,
    }


def _diagonal(*variances: float) -> tuple[float, ...]:
    """The upper triangle of a 6 by 6 matrix, row by row."""
    values: list[float] = []
    for row, variance in enumerate(variances):
        values += [variance, *([nan] * (5 - row))]
    return tuple(values)


def altitude(vehicle: Vehicle) -> Fields:
    """ALTITUDE."""
    estimate = vehicle.estimate
    return {
        "time_usec": boot_us(vehicle),
        "altitude_monotonic": estimate.baro_altitude,
        "altitude_amsl": estimate.geodetic[2],
        "altitude_local": -estimate.position[2],
        "altitude_relative": vehicle.height,
        "altitude_terrain": nan,
        "bottom_clearance": nan,
    }


def vfr_hud(vehicle: Vehicle) -> Fields:
    """VFR_HUD: no airspeed sensor."""
    estimate = vehicle.estimate
    north, east, down = estimate.velocity
    return {
        "airspeed": 0.0,
        "groundspeed": hypot(north, east),
        "heading": int(degrees(estimate.attitude[2])) % 360,
        "throttle": round(abs(estimate.throttle) * 100.0) if vehicle.armed else 0,
        "alt": estimate.geodetic[2],
        "climb": -down,
    }


def highres_imu(vehicle: Vehicle) -> Fields:
    """HIGHRES_IMU: m/s^2, rad/s, gauss, hectopascals as PX4 1.14 fills them."""
    estimate = vehicle.estimate
    xacc, yacc, zacc = estimate.accel
    xgyro, ygyro, zgyro = estimate.gyro
    xmag, ymag, zmag = estimate.mag
    return {
        "time_usec": boot_us(vehicle),
        "xacc": xacc,
        "yacc": yacc,
        "zacc": zacc,
        "xgyro": xgyro,
        "ygyro": ygyro,
        "zgyro": zgyro,
        "xmag": xmag,
        "ymag": ymag,
        "zmag": zmag,
        "abs_pressure": estimate.pressure * 100.0,
        "pressure_alt": estimate.baro_altitude,
        "temperature": 15.0,
        "fields_updated": 63,
    }


def pressure(vehicle: Vehicle) -> Fields:
    """SCALED_PRESSURE."""
    return {"time_boot_ms": boot_ms(vehicle), "press_abs": vehicle.estimate.pressure, "temperature": 1479}


def gps_raw(vehicle: Vehicle) -> Fields:
    """GPS_RAW_INT."""
    fix = vehicle.estimate.gps
    if fix.fix_type == 0:
        return {"time_usec": boot_us(vehicle), "eph": NOT_KNOWN, "epv": NOT_KNOWN, "cog": NOT_KNOWN}
    north, east, _ = fix.velocity
    speed = hypot(north, east)
    return {
        "time_usec": boot_us(vehicle),
        "fix_type": fix.fix_type,
        "lat": round(fix.latitude * 1e7),
        "lon": round(fix.longitude * 1e7),
        "alt": round(fix.amsl * 1000.0),
        "eph": to_uint16(fix.eph * 100.0),
        "epv": to_uint16(fix.epv * 100.0),
        "vel": to_uint16(speed * 100.0),
        "cog": heading_cdeg(atan2(east, north)) if speed > 0.0 else 0,
        "satellites_visible": fix.satellites,
        "alt_ellipsoid": round(fix.amsl * 1000.0),
        "h_acc": round(fix.h_acc * 1000.0),
        "v_acc": round(fix.v_acc * 1000.0),
        "vel_acc": round(fix.speed_acc * 1000.0),
    }


def system_time(vehicle: Vehicle) -> Fields:
    """SYSTEM_TIME."""
    now = EPOCH_US + vehicle.kernel.now() // US
    return {"time_unix_usec": now, "time_boot_ms": boot_ms(vehicle)}


def position_target(vehicle: Vehicle) -> Fields:
    """POSITION_TARGET_LOCAL_NED: not-a-number where nothing is held."""
    estimate = vehicle.estimate
    fields: Fields = {"time_boot_ms": boot_ms(vehicle), "coordinate_frame": 1}
    if not vehicle.armed or vehicle.landed:
        blank = dict.fromkeys(("x", "y", "z", "vx", "vy", "vz"), nan)
        return {**fields, **blank, "afz": 100.0, "yaw": estimate.attitude[2], "type_mask": 63}
    target = vehicle.manoeuvre.target or estimate.target
    fields["x"], fields["y"], fields["z"] = target
    fields["vx"], fields["vy"], fields["vz"] = estimate.target_velocity
    fields["yaw"] = estimate.target_attitude[2]
    return fields


def global_target(vehicle: Vehicle) -> Fields | None:
    """POSITION_TARGET_GLOBAL_INT: once it flies to a point."""
    target = vehicle.manoeuvre.target
    if target is None or not vehicle.armed:
        return None
    latitude, longitude, amsl = vehicle.flight.from_ned(target)
    vx, vy, vz = vehicle.estimate.target_velocity
    return {
        "time_boot_ms": boot_ms(vehicle),
        "coordinate_frame": 5,
        "lat_int": round(latitude * 1e7),
        "lon_int": round(longitude * 1e7),
        "alt": amsl,
        "vx": vx,
        "vy": vy,
        "vz": vz,
        "yaw": vehicle.estimate.target_attitude[2],
    }


def attitude_target(vehicle: Vehicle) -> Fields:
    """ATTITUDE_TARGET."""
    estimate = vehicle.estimate
    wanted = of(vehicle).stream.target
    thrust = estimate.throttle
    angles = estimate.target_attitude
    if vehicle.mode.number == modes.OFFBOARD and isinstance(wanted, AttitudeTarget):
        angles, thrust = quaternion_to_euler(wanted.attitude), wanted.thrust
    return {"time_boot_ms": boot_ms(vehicle), "q": euler_to_quaternion(*angles), "thrust": thrust}


def home_position(vehicle: Vehicle) -> Fields | None:
    """HOME_POSITION: until there is a home, where the receiver says the vehicle is."""
    home = vehicle.home
    fields: Fields = {"q": (1.0, 0.0, 0.0, 0.0), "time_usec": boot_us(vehicle)}
    if home is not None:
        x, y, z = home.ned
        place = home.latitude, home.longitude, home.amsl
        fields |= {"x": x, "y": y, "z": z}
    else:
        fix = vehicle.estimate.gps
        if vehicle.uptime() < HOME_FROM or fix.fix_type == 0:
            return None
        place = fix.latitude, fix.longitude, fix.amsl
    latitude, longitude, amsl = place
    fields["latitude"], fields["longitude"] = round(latitude * 1e7), round(longitude * 1e7)
    fields["altitude"] = round(amsl * 1000.0)
    return fields


def origin(vehicle: Vehicle) -> Fields | None:
    """GPS_GLOBAL_ORIGIN: once the estimator has one."""
    if not vehicle.estimate.position_ok:
        return None
    latitude, longitude, amsl = vehicle.estimate.origin
    return {
        "latitude": round(latitude * 1e7),
        "longitude": round(longitude * 1e7),
        "altitude": round(amsl * 1000.0),
        "time_usec": boot_us(vehicle),
    }


def distance_sensor(vehicle: Vehicle) -> Fields:
    """DISTANCE_SENSOR, looking down: the recorded airframe has one that reaches 100 m."""
    height = max(0.0, of(vehicle).above_ground)
    return {
        "time_boot_ms": boot_ms(vehicle),
        "max_distance": 10_000,
        "current_distance": to_uint16(height * 100.0),
        "orientation": 25,
    }


def orbit_status(vehicle: Vehicle) -> Fields | None:
    """ORBIT_EXECUTION_STATUS: while it circles."""
    circling = vehicle.manoeuvre
    if not isinstance(circling, Orbit):
        return None
    latitude, longitude, amsl = vehicle.flight.from_ned(circling.centre)
    return {
        "time_usec": boot_us(vehicle),
        "radius": circling.radius,
        "x": round(latitude * 1e7),
        "y": round(longitude * 1e7),
        "z": amsl,
    }
