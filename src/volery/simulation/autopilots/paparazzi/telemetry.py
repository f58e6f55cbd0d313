"""Periodic messages of a rotorcraft: their fields and periods.

Periods are those of the default rotorcraft telemetry. Scales: positions 2^-8 m, velocities 2^-19 m/s, angles
2^-12 rad; ECEF cm, degrees 1e-7, altitudes mm.
"""

from __future__ import annotations

from collections.abc import Callable
from math import radians
from typing import Any, NamedTuple

from volery.base.elementary import cos, sin
from volery.base.frames import Vector, enu_to_ned, euler_to_quaternion, geodetic_to_ecef, ned_to_enu
from volery.base.time import MS, Ns, S, to_seconds
from volery.links.paparazzi_aircraft import stock_aircraft
from volery.simulation.autopilots.paparazzi import modes, rotorcraft_state
from volery.simulation.autopilots.paparazzi.flight_modes import GuidedMode
from volery.simulation.autopilots.paparazzi.flight_plan import Vertical
from volery.simulation.autopilots.paparazzi.parameters import NUMBERED, read_setting
from volery.simulation.autopilots.paparazzi.rotorcraft_state import FULL, state_of
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

Fields = dict[str, Any]

POSITION, SPEED, ANGLE = 1 << 8, 1 << 19, 1 << 12
"""Counts in a metre, in a metre per second, in a radian."""
ACCELERATION, QUATERNION = 1 << 10, 1 << 15
"""Counts in a metre per second squared, in a quaternion's one."""
AIR_DEG_C, STANDARD_QNH = 14.0, 1013.25
"""Air temperature, as recorded [deg C]; pressure at sea level [hPa]."""
ABOVE_ELLIPSOID_M = 49.85
"""Height of mean sea level above the ellipsoid, as recorded; the simulated world has no geoid model."""
GUIDANCE = {
    modes.KILL: (0, 0),
    modes.FAILSAFE: (0, 3),
    modes.HOME: (2, 5),
    modes.ATTITUDE_DIRECT: (0, 1),
    modes.ATTITUDE_RC_CLIMB: (0, 2),
    modes.ATTITUDE_Z_HOLD: (0, 4),
    modes.HOVER_Z_HOLD: (1, 4),
    modes.NAV: (2, 5),
    modes.GUIDED: (3, 6),
}
"""ROTORCRAFT_STATUS.ap_h_mode and ap_v_mode by mode."""


def to_counts(value: float, scale: float, bits: int = 32) -> int:
    """Return a value in counts, limited to the range of a signed field."""
    most = (1 << bits - 1) - 1
    return round(min(float(most), max(-float(most), value * scale)))


WEEK_MS = 604_800_000
"""Milliseconds of a week of the satellite receiver's clock."""


def to_unsigned(value: float, bits: int = 16) -> int:
    """Return a value limited to the range of an unsigned field."""
    return int(min(float((1 << bits) - 1), max(0.0, value)))


def counted(value: float, bits: int = 16) -> int:
    """Return a counter as an unsigned field shows it: it begins anew after its range."""
    return int(value) % (1 << bits)


def rotorcraft_fp(vehicle: AutopilotVehicle) -> Fields:
    """Return ROTORCRAFT_FP: estimated state and target."""
    estimate, (position, velocity) = vehicle.estimate, rotorcraft_state.known_motion(vehicle)
    fields: Fields = {}
    for axis, metres, speed in zip(
        ("east", "north", "up"), ned_to_enu(position), ned_to_enu(velocity), strict=True
    ):
        fields[axis] = to_counts(metres, POSITION)
        fields[f"v{axis}"] = to_counts(speed, SPEED)
    for name, angle in zip(("phi", "theta", "psi"), estimate.attitude, strict=True):
        fields[name] = to_counts(angle, ANGLE)
    carrot, heading = _carrot(vehicle)
    for axis, metres in zip(("east", "north", "up"), ned_to_enu(carrot), strict=True):
        fields[f"carrot_{axis}"] = to_counts(metres, POSITION)
    fields["carrot_psi"] = to_counts(heading, ANGLE)
    fields["thrust"] = round(estimate.throttle * FULL) if vehicle.armed else 0
    fields["flight_time"] = counted(to_seconds(vehicle.ground.flight_time))
    return fields


def _carrot(vehicle: AutopilotVehicle) -> tuple[Vector, float]:
    """Return the target point, north-east-down [m], and the heading [rad]."""
    manoeuvre, navigation = vehicle.manoeuvre, state_of(vehicle).navigation
    if isinstance(manoeuvre, GuidedMode):
        return manoeuvre.carrot()
    demand = navigation.demand
    if demand.vertical is Vertical.THROTTLE:
        return vehicle.estimate.position, navigation.heading
    return enu_to_ned(demand.target), navigation.heading


def _centimetres(name: str, vector: Vector, fields: Fields) -> None:
    for axis, value in zip("xyz", vector, strict=True):
        fields[name.format(axis)] = to_counts(value, 100.0)


def gps_int(vehicle: AutopilotVehicle) -> Fields:
    """Return GPS_INT: the last fix of the receiver."""
    fix = vehicle.estimate.gps
    kind = rotorcraft_state.fix_type(vehicle)
    fields: Fields = {
        "lat": to_counts(fix.latitude, 1e7),
        "lon": to_counts(fix.longitude, 1e7),
        "alt": to_counts(fix.amsl + ABOVE_ELLIPSOID_M, 1000.0),
        "hmsl": to_counts(fix.amsl, 1000.0),
        "pacc": to_unsigned(fix.h_acc * 100.0, 32),
        "sacc": to_unsigned(fix.speed_acc * 100.0, 32),
        "tow": vehicle.uptime() // MS % WEEK_MS,
        "pdop": to_unsigned(fix.eph * 100.0),
        "numsv": fix.satellites if kind else 1,
        "fix": kind,
    }
    _centimetres(
        "ecef_{}", geodetic_to_ecef(fix.latitude, fix.longitude, fix.amsl + ABOVE_ELLIPSOID_M), fields
    )
    _centimetres("ecef_{}d", _to_ecef(fix.velocity, fix.latitude, fix.longitude), fields)
    return fields


def _to_ecef(ned: Vector, latitude: float, longitude: float) -> Vector:
    """Rotate a north-east-down vector at a place [deg] to ECEF axes."""
    north, east, down = ned
    sin_lat, cos_lat = sin(radians(latitude)), cos(radians(latitude))
    sin_lon, cos_lon = sin(radians(longitude)), cos(radians(longitude))
    across = -sin_lat * north - cos_lat * down
    return (
        cos_lon * across - sin_lon * east,
        sin_lon * across + cos_lon * east,
        cos_lat * north - sin_lat * down,
    )


def ins_ref(vehicle: AutopilotVehicle) -> Fields | None:
    """Return INS_REF once there is a local origin."""
    if not vehicle.estimate.position_ok or vehicle.home is None:
        return None
    latitude, longitude, amsl = vehicle.estimate.origin
    fields: Fields = {
        "lat0": to_counts(latitude, 1e7),
        "lon0": to_counts(longitude, 1e7),
        "alt0": to_counts(amsl + ABOVE_ELLIPSOID_M, 1000.0),
        "hmsl0": to_counts(amsl, 1000.0),
        "baro_qfe": vehicle.estimate.pressure * 100.0,
    }
    _centimetres("ecef_{}0", geodetic_to_ecef(latitude, longitude, amsl + ABOVE_ELLIPSOID_M), fields)
    return fields


def rotorcraft_status(vehicle: AutopilotVehicle) -> Fields:
    """Return ROTORCRAFT_STATUS."""
    plane, height = GUIDANCE[vehicle.mode.number]
    return {
        "rc_status": state_of(vehicle).radio.status(vehicle),
        "frame_rate": 0,
        "gps_status": rotorcraft_state.fix_type(vehicle),
        "ap_mode": vehicle.mode.number,
        "ap_in_flight": int(modes.in_flight(vehicle)),
        "ap_motors_on": int(vehicle.armed),
        "arming_status": modes.arming_status(vehicle),
        "ap_h_mode": plane,
        "ap_v_mode": height,
        "cpu_time": counted(to_seconds(vehicle.uptime())),
        "vsupply": vehicle.estimate.battery_volts,
        "vboard": 0.0,
    }


def nav_status(vehicle: AutopilotVehicle) -> Fields:
    """Return ROTORCRAFT_NAV_STATUS: progress of the flight plan."""
    navigation = state_of(vehicle).navigation
    return {
        "block_time": counted(navigation.block_time),
        "stage_time": counted(navigation.stage_time),
        "dist_home": navigation.from_home(),
        "dist_wp": navigation.from_goal(),
        "cur_block": navigation.block,
        "cur_stage": navigation.stage,
        "horizontal_mode": navigation.demand.horizontal,
    }


def alive(_vehicle: AutopilotVehicle) -> Fields:
    """Return ALIVE."""
    return {"md5sum": stock_aircraft().fingerprint}


def energy(vehicle: AutopilotVehicle) -> Fields:
    """Return ENERGY."""
    estimate = vehicle.estimate
    power = estimate.battery_volts * estimate.battery_amps
    joules, seconds = estimate.battery_energy_j, max(1.0, to_seconds(vehicle.uptime()))
    return {
        "throttle": to_unsigned(estimate.throttle * 100.0, 8) if vehicle.armed else 0,
        "voltage": estimate.battery_volts,
        "current": estimate.battery_amps,
        "power": power,
        "avg_power": joules / seconds,
        "charge": estimate.battery_used_mah / 1000.0,
        "energy": joules / 3600.0,
    }


def datalink_report(vehicle: AutopilotVehicle) -> Fields:
    """Return DATALINK_REPORT."""
    state = state_of(vehicle)
    received = state.last_uplink_ns != NEVER
    silence = vehicle.kernel.now() - state.last_uplink_ns if received else vehicle.uptime()
    return {
        "uplink_lost_time": counted(to_seconds(silence)),
        "uplink_nb_msgs": state.uplink_messages & 0xFFFF,
        "downlink_nb_msgs": state.downlink_messages & 0xFFFF,
    }


def waypoint(vehicle: AutopilotVehicle, number: int) -> Fields:
    """Return WP_MOVED_ENU of that waypoint."""
    east, north, up = state_of(vehicle).navigation.waypoints[number]
    return {
        "wp_id": number,
        "east": to_counts(east, POSITION),
        "north": to_counts(north, POSITION),
        "up": to_counts(up, POSITION),
    }


def next_waypoint(vehicle: AutopilotVehicle) -> Fields:
    """Return WP_MOVED_ENU of the waypoints in turn."""
    state = state_of(vehicle)
    state.last_sent_waypoint = (state.last_sent_waypoint + 1) % len(state.navigation.waypoints)
    return waypoint(vehicle, state.last_sent_waypoint)


def ins(vehicle: AutopilotVehicle) -> Fields:
    """Return INS: estimated position, velocity and acceleration, north, east, down."""
    estimate, (position, velocity) = vehicle.estimate, rotorcraft_state.known_motion(vehicle)
    fields: Fields = {}
    for suffix, vector, scale in (
        ("", position, POSITION),
        ("d", velocity, SPEED),
        ("dd", estimate.acceleration, ACCELERATION),
    ):
        for axis, value in zip("xyz", vector, strict=True):
            fields[f"ins_{axis}{suffix}"] = to_counts(value, scale)
    return fields


def ahrs_ref_quat(vehicle: AutopilotVehicle) -> Fields:
    """Return AHRS_REF_QUAT: commanded and estimated attitude."""
    estimate = vehicle.estimate
    wanted = euler_to_quaternion(*estimate.target_attitude) if vehicle.armed else (1.0, 0.0, 0.0, 0.0)
    fields: Fields = {}
    for name, quaternion in (("ref", wanted), ("body", estimate.quaternion)):
        for part, value in zip("ixyz", quaternion, strict=True):
            fields[f"{name}_q{part}"] = to_counts(value, QUATERNION)
    return fields


def air_data(vehicle: AutopilotVehicle) -> Fields:
    """Return AIR_DATA: pressure and the rest without a sensor, as recorded."""
    return {
        "pressure": vehicle.estimate.pressure * 100.0,
        "temp": AIR_DEG_C,
        "qnh": STANDARD_QNH,
        "airspeed": -1.0,
        "tas": -1.0,
    }


def state_filter_status(_vehicle: AutopilotVehicle) -> Fields:
    """Return STATE_FILTER_STATUS as recorded: the attitude filter works."""
    return {"id": 3, "state_filter_mode": 3}


def autopilot_version(_vehicle: AutopilotVehicle) -> Fields:
    """Return AUTOPILOT_VERSION: the version that is simulated."""
    return {"version": 60_200, "desc": "v6.2 simulated by volery"}


def next_setting(vehicle: AutopilotVehicle) -> Fields:
    """Return DL_VALUE of the settings in turn."""
    state = state_of(vehicle)
    state.last_sent_setting = (state.last_sent_setting + 1) % len(NUMBERED)
    return {
        "index": state.last_sent_setting,
        "value": read_setting(vehicle, state.last_sent_setting),
    }


class PeriodicMessage(NamedTuple):
    """A message with its period; ``build`` returns None while there is nothing to send."""

    name: str
    period: Ns
    build: Callable[[AutopilotVehicle], Fields | None]


def _period(seconds: float) -> Ns:
    return round(seconds * S)


PERIODIC_MESSAGES = (
    PeriodicMessage("ROTORCRAFT_FP", _period(0.25), rotorcraft_fp),
    PeriodicMessage("INS", _period(0.25), ins),
    PeriodicMessage("GPS_INT", _period(0.25), gps_int),
    PeriodicMessage("AHRS_REF_QUAT", _period(0.5), ahrs_ref_quat),
    PeriodicMessage("DL_VALUE", _period(1.1), next_setting),
    PeriodicMessage("ROTORCRAFT_STATUS", _period(1.2), rotorcraft_status),
    PeriodicMessage("WP_MOVED_ENU", _period(1.3), next_waypoint),
    PeriodicMessage("AIR_DATA", _period(1.3), air_data),
    PeriodicMessage("ROTORCRAFT_NAV_STATUS", _period(1.6), nav_status),
    PeriodicMessage("ALIVE", _period(2.1), alive),
    PeriodicMessage("ENERGY", _period(2.5), energy),
    PeriodicMessage("STATE_FILTER_STATUS", _period(3.2), state_filter_status),
    PeriodicMessage("INS_REF", _period(5.1), ins_ref),
    PeriodicMessage("DATALINK_REPORT", _period(5.1), datalink_report),
    PeriodicMessage("AUTOPILOT_VERSION", _period(11.1), autopilot_version),
)
"""Sorted by period, which is the order of messages that are due together."""

OTHER_MODES = range(1, 10)
"""Values of ``telemetry_mode_Main`` that are other lists. Beyond them no periodic message is sent."""
NOT_IN_OTHER_MODES = frozenset({"ROTORCRAFT_FP", "ROTORCRAFT_NAV_STATUS"})


def is_listed(vehicle: AutopilotVehicle, message: str) -> bool:
    """Return whether a periodic message is in the list that ``telemetry_mode_Main`` selects."""
    mode = state_of(vehicle).telemetry_mode
    return mode == 0 or (mode in OTHER_MODES and message not in NOT_IN_OTHER_MODES)
