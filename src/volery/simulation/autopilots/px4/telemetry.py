"""Fields of PX4's telemetry messages. Units and signs are those of the messages.

A builder returns None while the firmware does not send its message.
"""

from __future__ import annotations

from math import degrees, hypot, nan
from zlib import crc32

from volery.base.elementary import atan2
from volery.base.frames import euler_to_quaternion, quaternion_to_euler
from volery.base.time import MS, US, Ns, S
from volery.links.mavlink_messages import constant
from volery.simulation.autopilots.mavlink import messages
from volery.simulation.autopilots.mavlink.messages import (
    EPOCH_US,
    Fields,
    boot_ms,
    boot_us,
    heading_cdeg,
    to_int16,
    to_uint16,
    to_uint32,
    vehicle_type,
)
from volery.simulation.autopilots.mavlink.microservices import FENCE, MISSION, RALLY
from volery.simulation.autopilots.px4 import modes
from volery.simulation.autopilots.px4.flight_modes import Orbit
from volery.simulation.autopilots.px4.modes import ATTITUDE_AFTER, commander_of
from volery.simulation.autopilots.px4.offboard import OffboardAttitude, RateTarget
from volery.simulation.autopilots.px4.versions import (
    ADVANCED,
    EXTERNAL,
    NOT_SELECTABLE,
    SIMPLE_MODES,
    STANDARD_MODES,
)
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

GLOBAL_AFTER: Ns = 6_500 * MS
"""Recorded: the first GLOBAL_POSITION_INT 0.1 s after the first ATTITUDE."""

HOME_FROM: Ns = 2_200 * MS
"""Uptime [ns] from which the GPS position is sent as home position until there is one."""

NOT_KNOWN = 65_535


def _aligned(vehicle: AutopilotVehicle) -> bool:
    return vehicle.uptime() >= ATTITUDE_AFTER


def attitude(vehicle: AutopilotVehicle) -> Fields | None:
    """Return ATTITUDE once the estimator is aligned."""
    return messages.attitude(vehicle) if _aligned(vehicle) else None


def attitude_quaternion(vehicle: AutopilotVehicle) -> Fields | None:
    """Return ATTITUDE_QUATERNION once the estimator is aligned."""
    return messages.attitude_quaternion(vehicle) if _aligned(vehicle) else None


def global_position(vehicle: AutopilotVehicle) -> Fields | None:
    """Return GLOBAL_POSITION_INT once there is a position; PX4 cuts decimals off and does not round."""
    estimate = vehicle.estimate
    if vehicle.uptime() < GLOBAL_AFTER or not estimate.position_ok:
        return None
    latitude, longitude, amsl = estimate.geodetic
    north, east, down = estimate.velocity
    return {
        "time_boot_ms": boot_ms(vehicle),
        "lat": int(latitude * 1e7),
        "lon": int(longitude * 1e7),
        "alt": int(amsl * 1000.0),
        "relative_alt": int(vehicle.height * 1000.0),
        "vx": to_int16(int(north * 100.0)),
        "vy": to_int16(int(east * 100.0)),
        "vz": to_int16(int(down * 100.0)),
        "hdg": heading_cdeg(estimate.attitude[2]),
    }


def local_position(vehicle: AutopilotVehicle) -> Fields:
    """Return LOCAL_POSITION_NED, with zeros before the first position."""
    estimate = vehicle.estimate
    fields: Fields = {"time_boot_ms": boot_ms(vehicle)}
    if estimate.position_ok:
        fields["x"], fields["y"], fields["z"] = estimate.position
        fields["vx"], fields["vy"], fields["vz"] = estimate.velocity
    return fields


def odometry(vehicle: AutopilotVehicle) -> Fields:
    """Return ODOMETRY."""
    estimate = vehicle.estimate
    p, q, r = estimate.rates
    x, y, z = estimate.position
    vx, vy, vz = estimate.velocity
    plane, height, speed, climb = (spread * spread for spread in estimate.sigmas)
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
    """Return the upper triangle of a 6x6 matrix row by row, NaN off the diagonal."""
    values: list[float] = []
    for row, variance in enumerate(variances):
        values += [variance, *([nan] * (5 - row))]
    return tuple(values)


def altitude(vehicle: AutopilotVehicle) -> Fields:
    """Return ALTITUDE."""
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


def vfr_hud(vehicle: AutopilotVehicle) -> Fields:
    """Return VFR_HUD (no airspeed sensor)."""
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


def highres_imu(vehicle: AutopilotVehicle) -> Fields:
    """Return HIGHRES_IMU (m/s^2, rad/s, gauss; pressure in Pa, as PX4 1.14 sends it)."""
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


def pressure(vehicle: AutopilotVehicle) -> Fields:
    """Return SCALED_PRESSURE."""
    return {"time_boot_ms": boot_ms(vehicle), "press_abs": vehicle.estimate.pressure, "temperature": 1479}


def gps_raw(vehicle: AutopilotVehicle) -> Fields:
    """Return GPS_RAW_INT."""
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


def system_time(vehicle: AutopilotVehicle) -> Fields:
    """Return SYSTEM_TIME."""
    now = EPOCH_US + vehicle.kernel.now() // US
    return {"time_unix_usec": now, "time_boot_ms": boot_ms(vehicle)}


def position_target(vehicle: AutopilotVehicle) -> Fields:
    """Return POSITION_TARGET_LOCAL_NED, with NaN where nothing is controlled."""
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


def global_target(vehicle: AutopilotVehicle) -> Fields | None:
    """Return POSITION_TARGET_GLOBAL_INT while the vehicle flies to a point."""
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


def attitude_target(vehicle: AutopilotVehicle) -> Fields:
    """Return ATTITUDE_TARGET."""
    estimate = vehicle.estimate
    wanted = commander_of(vehicle).stream.target
    thrust = estimate.throttle
    angles = estimate.target_attitude
    if vehicle.mode.number == modes.OFFBOARD and isinstance(wanted, OffboardAttitude):
        angles, thrust = quaternion_to_euler(wanted.attitude), wanted.thrust
    return {"time_boot_ms": boot_ms(vehicle), "q": euler_to_quaternion(*angles), "thrust": thrust}


def home_position(vehicle: AutopilotVehicle) -> Fields | None:
    """Return HOME_POSITION; until it is set, the position of the GPS receiver."""
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


def origin(vehicle: AutopilotVehicle) -> Fields | None:
    """Return GPS_GLOBAL_ORIGIN once the estimator has an origin."""
    if not vehicle.estimate.position_ok and not commander_of(vehicle).vision.aiding.placed:
        return None
    latitude, longitude, amsl = vehicle.estimate.origin
    return {
        "latitude": round(latitude * 1e7),
        "longitude": round(longitude * 1e7),
        "altitude": round(amsl * 1000.0),
        "time_usec": boot_us(vehicle),
    }


def distance_sensor(vehicle: AutopilotVehicle) -> Fields:
    """Return DISTANCE_SENSOR (downwards); the recorded airframe has one with a range of 100 m."""
    height = max(0.0, commander_of(vehicle).above_ground)
    return {
        "time_boot_ms": boot_ms(vehicle),
        "max_distance": 10_000,
        "current_distance": to_uint16(height * 100.0),
        "orientation": 25,
    }


def orbit_status(vehicle: AutopilotVehicle) -> Fields | None:
    """Return ORBIT_EXECUTION_STATUS while the vehicle circles."""
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


ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
STANDBY = constant("MAV_STATE_STANDBY")
ACTIVE = constant("MAV_STATE_ACTIVE")
CRITICAL = constant("MAV_STATE_CRITICAL")
TERMINATED = constant("MAV_STATE_FLIGHT_TERMINATION")
ON_GROUND = constant("MAV_LANDED_STATE_ON_GROUND")
IN_AIR = constant("MAV_LANDED_STATE_IN_AIR")
TAKING_OFF = constant("MAV_LANDED_STATE_TAKEOFF")
LANDING = constant("MAV_LANDED_STATE_LANDING")

NOT_THERE = 65_535
NO_CURRENT = -100
"""Current of a battery without a current sensor [cA], as recorded; ``current_consumed`` is then 0."""

PRESENT, ENABLED, HEALTHY, PREARM, GPS = 35_651_629, 35_717_165, 572_555_327, 1 << 28, 1 << 5
"""Sensor bits of SYS_STATUS as recorded; the pre-arm check is a separate bit."""

OS_VERSION = 101_854_463
"""Kernel of the recorded machine."""

UID = 5_283_920_058_631_409_231

WITH_POSITION, WITHOUT_POSITION = 831, 1
"""ESTIMATOR_STATUS_FLAGS as recorded with a position; without one only the attitude is valid."""


def heartbeat(vehicle: AutopilotVehicle, kind: int) -> Fields:
    """Return HEARTBEAT of a vehicle of that MAV_TYPE."""
    commander, mode = commander_of(vehicle), vehicle.mode
    base = mode.base_mode
    by_rates = commander.stream.target is None or isinstance(commander.stream.target, RateTarget)
    if mode.number == modes.OFFBOARD and by_rates:
        base = modes.CUSTOM
    state = ACTIVE
    if not vehicle.armed:
        state = STANDBY if commander.armable else commander.version.unready_state
    if vehicle.armed and (commander.failsafe or commander.taken_over):
        state = CRITICAL
    if commander.terminated:
        state = TERMINATED
    return {
        "type": vehicle_type(vehicle, kind),
        "autopilot": 12,
        "base_mode": base | (ARMED if vehicle.armed else 0),
        "custom_mode": mode.number,
        "system_status": state,
        "mavlink_version": 3,
    }


def sys_status(vehicle: AutopilotVehicle) -> Fields:
    """Return SYS_STATUS."""
    estimate = vehicle.estimate
    present, enabled, healthy = PRESENT, ENABLED, HEALTHY
    if commander_of(vehicle).armable or vehicle.armed:
        healthy |= PREARM
    if not vehicle.has_position:  # PX4 states a receiver as present only while the estimator uses it
        present, enabled = present & ~GPS, enabled & ~GPS
    if estimate.fix_type == 0:
        healthy, enabled = healthy & ~GPS, enabled | GPS
    return {
        "onboard_control_sensors_present": present,
        "onboard_control_sensors_enabled": enabled,
        "onboard_control_sensors_health": healthy,
        "load": 100,
        "voltage_battery": to_uint16(estimate.battery_volts * 1000.0),
        "current_battery": NO_CURRENT,
        "battery_remaining": _percent(vehicle),
        "onboard_control_sensors_health_extended": 1,
    }


def _percent(vehicle: AutopilotVehicle) -> int:
    return min(100, max(0, int(vehicle.estimate.battery_left * 100.0)))


def battery_status(vehicle: AutopilotVehicle) -> Fields:
    """Return BATTERY_STATUS."""
    estimate = vehicle.estimate
    return {
        "id": 0,
        "battery_function": 1,
        "type": 1,
        "temperature": 32_767,
        "voltages": (to_uint16(estimate.battery_volts * 1000.0), *([NOT_THERE] * 9)),
        "current_battery": NO_CURRENT,
        "current_consumed": 0,
        "energy_consumed": -1,
        "battery_remaining": _percent(vehicle),
        "charge_state": _charge_state(vehicle),
    }


def _charge_state(vehicle: AutopilotVehicle) -> int:
    """Return the MAV_BATTERY_CHARGE_STATE."""
    left, p = vehicle.estimate.battery_left, vehicle.parameters
    levels = (p["BAT_LOW_THR"], p["BAT_CRIT_THR"], p["BAT_EMERGEN_THR"])
    return 1 + sum(left < level for level in levels)


def extended_sys_state(vehicle: AutopilotVehicle) -> Fields:
    """Return EXTENDED_SYS_STATE."""
    manoeuvre = vehicle.manoeuvre
    state = IN_AIR
    if not vehicle.flies or not commander_of(vehicle).flying:
        state = ON_GROUND
    elif manoeuvre.taking_off:
        state = TAKING_OFF
    elif manoeuvre.landing:
        state = LANDING
    return {"vtol_state": 0, "landed_state": state}


def estimator_status(vehicle: AutopilotVehicle) -> Fields:
    """Return ESTIMATOR_STATUS."""
    estimate = vehicle.estimate
    plane, height, _, _ = estimate.sigmas
    flags = WITH_POSITION if vehicle.has_position else WITHOUT_POSITION
    if not vehicle.armed and vehicle.landed:
        flags |= commander_of(vehicle).version.at_rest
    return {
        "time_usec": boot_us(vehicle),
        "flags": flags,
        "vel_ratio": 0.06,
        "pos_horiz_ratio": min(1.0, estimate.gps_innovation * estimate.gps_innovation / 25.0),
        "pos_vert_ratio": 0.035,
        "mag_ratio": min(1.0, abs(estimate.heading_error)),
        "pos_horiz_accuracy": plane,
        "pos_vert_accuracy": height,
    }


def servo_output(vehicle: AutopilotVehicle) -> Fields:
    """Return SERVO_OUTPUT_RAW; 900 us is off."""
    pulses = vehicle.estimate.motor_pwm if vehicle.armed else ()
    fields: Fields = {"time_usec": to_uint32(boot_us(vehicle)), "port": 0}
    for place, pulse in enumerate((*pulses, *([900] * (16 - len(pulses)))), start=1):
        fields[f"servo{place}_raw"] = pulse
    return fields


def vibration(vehicle: AutopilotVehicle) -> Fields:
    """Return VIBRATION: the body model has none."""
    return {"time_usec": boot_us(vehicle), "vibration_x": 0.0, "vibration_y": 0.1, "vibration_z": 1.3}


def mission_current(vehicle: AutopilotVehicle) -> Fields | None:
    """Return MISSION_CURRENT; 1.14 sends it while there is a mission, and the current item only."""
    plan, commander = vehicle.mission, commander_of(vehicle)
    if not commander.version.mission_state:
        return {"seq": plan.current} if len(plan) else None
    active = vehicle.mode.number in (modes.MISSION, modes.TAKEOFF, modes.LAND)
    if not commander.has_mission:
        state = NO_MISSION
    elif commander.mission_finished:
        state = COMPLETE
    elif active:
        state = UNDER_WAY
    else:
        state = NOT_STARTED if commander.reached is None else PAUSED
    return {
        "seq": plan.current,
        "total": len(plan) or NO_ITEMS,
        "mission_state": state,
        "mission_mode": IN_MISSION if active else SUSPENDED,
        "mission_id": list_id(vehicle, MISSION),
        "fence_id": list_id(vehicle, FENCE),
        "rally_points_id": list_id(vehicle, RALLY),
    }


def list_id(vehicle: AutopilotVehicle, kind: int) -> int:
    """Return the checksum of a list on board by its MAV_MISSION_TYPE; 0 of an empty one.

    The firmware's has other values; clients compare it only with what it was before.
    """
    items = vehicle.mission.items if kind == MISSION else vehicle.points.get(kind, [])
    return crc32(repr(items).encode()) if items else 0


NO_ITEMS = 65_535
NO_MISSION, NOT_STARTED, UNDER_WAY, PAUSED, COMPLETE = 1, 2, 3, 4, 5
"""MISSION_STATE."""
IN_MISSION, SUSPENDED = 1, 2
"""``mission_mode``: PX4 counts a take-off and a landing as flying the mission."""


def available_modes(vehicle: AutopilotVehicle) -> list[Fields]:
    """Return AVAILABLE_MODES, all of them: as recorded, but for modes that are not simulated at all."""
    version = commander_of(vehicle).version
    if not version.lists_modes:
        return []
    every = {**version.words, modes.main_and_sub(modes.TERMINATION): "Termination"}
    listed: list[Fields] = []
    for place, (mode, word) in enumerate(sorted(every.items()), start=1):
        absent = mode in EXTERNAL
        properties = 0 if mode in SIMPLE_MODES else ADVANCED
        if absent or mode == modes.main_and_sub(modes.TERMINATION):
            properties = NOT_SELECTABLE if absent else ADVANCED | NOT_SELECTABLE
        standard = STANDARD_MODES.get(mode, 0)
        name = "" if standard else word
        listed.append(
            {
                "number_modes": len(every),
                "mode_index": place,
                "standard_mode": standard,
                "custom_mode": modes.custom_mode(*mode),
                "properties": properties,
                "mode_name": "(Mode not available)" if absent else name,
            }
        )
    return listed


def current_mode(vehicle: AutopilotVehicle) -> Fields | None:
    """Return CURRENT_MODE: the mode that is flown, and the one that the user requested."""
    commander = commander_of(vehicle)
    if not commander.version.lists_modes:
        return None
    return {
        "standard_mode": STANDARD_MODES.get(modes.main_and_sub(vehicle.mode.number), 0),
        "custom_mode": vehicle.mode.number,
        "intended_custom_mode": commander.requested,
    }


def ping(vehicle: AutopilotVehicle) -> Fields:
    """Return PING as a broadcast."""
    return {"time_usec": boot_us(vehicle), "seq": vehicle.uptime() // S}


def timesync(vehicle: AutopilotVehicle) -> Fields:
    """Return TIMESYNC as a request."""
    return {"tc1": 0, "ts1": vehicle.uptime()}


def event_sequence(vehicle: AutopilotVehicle) -> Fields:
    """Return CURRENT_EVENT_SEQUENCE, by which a receiver detects missed events."""
    return {"sequence": commander_of(vehicle).log.latest}


def autopilot_version(vehicle: AutopilotVehicle) -> Fields:
    """Return AUTOPILOT_VERSION."""
    version = commander_of(vehicle).version
    return {
        "capabilities": version.capabilities,
        "flight_sw_version": version.software,
        "middleware_sw_version": version.software,
        "os_sw_version": OS_VERSION,
        "board_version": 1,
        "flight_custom_version": version.git_hash,
        "middleware_custom_version": version.git_hash,
        "uid": UID + vehicle.system - 1,
    }
