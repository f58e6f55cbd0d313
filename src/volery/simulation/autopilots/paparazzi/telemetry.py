"""The messages that a rotorcraft sends regularly: what they hold now, and how often they go out.

Periods are the default rotorcraft telemetry's. Scales: positions 2^-8 m, velocities 2^-19 m/s, angles
2^-12 rad; ecef cm, degrees 1e-7, altitudes mm. Mean sea level and ellipsoid are one surface here.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, radians, sin
from typing import Any, NamedTuple

from volery.base.frames import Vector, enu_to_ned, geodetic_to_ecef, ned_to_enu
from volery.base.time import MS, Ns, S, to_seconds
from volery.simulation.autopilots.manual_control import NEVER
from volery.simulation.autopilots.paparazzi import modes, rotorcraft_state
from volery.simulation.autopilots.paparazzi.flight_modes import Guided
from volery.simulation.autopilots.paparazzi.flight_plan import Vertical
from volery.simulation.autopilots.paparazzi.parameters import NUMBERED, read_setting
from volery.simulation.autopilots.paparazzi.rotorcraft_state import FULL, state_of
from volery.simulation.autopilots.vehicle_state import Vehicle

Fields = dict[str, Any]

POSITION, SPEED, ANGLE = 1 << 8, 1 << 19, 1 << 12
"""Counts in a metre, in a metre per second, in a radian."""
MAIN_LOOP_HZ = 512 // 4
"""ROTORCRAFT_STATUS.frame_rate, of the sensors."""
MD5SUM = tuple(range(0x10, 0x20))
"""ALIVE: of the configuration. Of none here."""
GUIDANCE = {
    modes.KILL: (0, 0),
    modes.FAILSAFE: (0, 3),
    modes.HOME: (2, 5),
    modes.ATTITUDE_DIRECT: (0, 1),
    modes.ATTITUDE_RC_CLIMB: (0, 2),
    modes.ATTITUDE_Z_HOLD: (0, 4),
    modes.HOVER_Z_HOLD: (1, 4),
    modes.NAV: (2, 5),
    modes.GUIDED: (3, 8),
}
"""By mode: ROTORCRAFT_STATUS.ap_h_mode and ap_v_mode."""


def counts(value: float, scale: float, bits: int = 32) -> int:
    """In counts, at the end of the range where the field has no room."""
    most = (1 << bits - 1) - 1
    return round(min(float(most), max(-float(most), value * scale)))


def whole(value: float, bits: int = 16) -> int:
    """An unsigned field."""
    return int(min(float((1 << bits) - 1), max(0.0, value)))


def rotorcraft_fp(vehicle: Vehicle) -> Fields:
    """Where it is, and where it is led."""
    estimate = vehicle.estimate
    fields: Fields = {}
    for axis, metres, speed in zip(
        ("east", "north", "up"), ned_to_enu(estimate.position), ned_to_enu(estimate.velocity), strict=True
    ):
        fields[axis] = counts(metres, POSITION)
        fields[f"v{axis}"] = counts(speed, SPEED)
    for name, angle in zip(("phi", "theta", "psi"), estimate.attitude, strict=True):
        fields[name] = counts(angle, ANGLE)
    carrot, heading = _carrot(vehicle)
    for axis, metres in zip(("east", "north", "up"), ned_to_enu(carrot), strict=True):
        fields[f"carrot_{axis}"] = counts(metres, POSITION)
    fields["carrot_psi"] = counts(heading, ANGLE)
    fields["thrust"] = round(estimate.throttle * FULL) if vehicle.armed else 0
    fields["flight_time"] = whole(to_seconds(vehicle.ground.flight_time))
    return fields


def _carrot(vehicle: Vehicle) -> tuple[Vector, float]:
    """North, east, down, and the heading."""
    manoeuvre, navigation = vehicle.manoeuvre, state_of(vehicle).navigation
    if isinstance(manoeuvre, Guided):
        return manoeuvre.carrot()
    demand = navigation.demand
    if demand.vertical is Vertical.THROTTLE:
        return vehicle.estimate.position, navigation.heading
    return enu_to_ned(demand.target), navigation.heading


def attitude(vehicle: Vehicle) -> Fields:
    """ATTITUDE."""
    roll, pitch, yaw = vehicle.estimate.attitude
    return {"phi": roll, "psi": yaw, "theta": pitch}


def _centimetres(name: str, vector: Vector, fields: Fields) -> None:
    for axis, value in zip("xyz", vector, strict=True):
        fields[name.format(axis)] = counts(value, 100.0)


def gps_int(vehicle: Vehicle) -> Fields:
    """The receiver's last fix; without one what it was."""
    fix = vehicle.estimate.gps
    kind = rotorcraft_state.fix_type(vehicle)
    fields: Fields = {
        "lat": counts(fix.latitude, 1e7),
        "lon": counts(fix.longitude, 1e7),
        "alt": counts(fix.amsl, 1000.0),
        "hmsl": counts(fix.amsl, 1000.0),
        "pacc": whole(fix.h_acc * 100.0, 32),
        "sacc": whole(fix.speed_acc * 100.0, 32),
        "tow": whole(vehicle.uptime() // MS, 32),
        "pdop": whole(fix.eph * 100.0),
        "numsv": fix.satellites if kind else 0,
        "fix": kind,
    }
    _centimetres("ecef_{}", geodetic_to_ecef(fix.latitude, fix.longitude, fix.amsl), fields)
    _centimetres("ecef_{}d", _to_ecef(fix.velocity, fix.latitude, fix.longitude), fields)
    return fields


def _to_ecef(ned: Vector, latitude: float, longitude: float) -> Vector:
    """A vector north, east, down at a place along the axes of the earth."""
    north, east, down = ned
    sin_lat, cos_lat = sin(radians(latitude)), cos(radians(latitude))
    sin_lon, cos_lon = sin(radians(longitude)), cos(radians(longitude))
    across = -sin_lat * north - cos_lat * down
    return (
        cos_lon * across - sin_lon * east,
        sin_lon * across + cos_lon * east,
        cos_lat * north - sin_lat * down,
    )


def ins_ref(vehicle: Vehicle) -> Fields | None:
    """The local origin, once there is one."""
    if not vehicle.estimate.position_ok or vehicle.home is None:
        return None
    latitude, longitude, amsl = vehicle.estimate.origin
    fields: Fields = {
        "lat0": counts(latitude, 1e7),
        "lon0": counts(longitude, 1e7),
        "alt0": counts(amsl, 1000.0),
        "hmsl0": counts(amsl, 1000.0),
        "baro_qfe": vehicle.estimate.pressure * 100.0,
    }
    _centimetres("ecef_{}0", geodetic_to_ecef(latitude, longitude, amsl), fields)
    return fields


def rotorcraft_status(vehicle: Vehicle) -> Fields:
    """Mode, motors, arming."""
    plane, height = GUIDANCE[vehicle.mode.number]
    return {
        "rc_status": state_of(vehicle).radio.status(vehicle),
        "frame_rate": MAIN_LOOP_HZ,
        "gps_status": rotorcraft_state.fix_type(vehicle),
        "ap_mode": vehicle.mode.number,
        "ap_in_flight": int(modes.in_flight(vehicle)),
        "ap_motors_on": int(vehicle.armed),
        "arming_status": modes.arming_status(vehicle),
        "ap_h_mode": plane,
        "ap_v_mode": height,
        "cpu_time": whole(to_seconds(vehicle.uptime())),
        "vsupply": vehicle.estimate.battery_volts,
        "vboard": vehicle.estimate.battery_volts,
    }


def nav_status(vehicle: Vehicle) -> Fields:
    """Where it is in its flight plan."""
    navigation = state_of(vehicle).navigation
    return {
        "block_time": whole(navigation.block_time),
        "stage_time": whole(navigation.stage_time),
        "dist_home": navigation.from_home(),
        "dist_wp": navigation.from_goal(),
        "cur_block": navigation.block,
        "cur_stage": navigation.stage,
        "horizontal_mode": navigation.demand.horizontal,
    }


def alive(_vehicle: Vehicle) -> Fields:
    """ALIVE."""
    return {"md5sum": MD5SUM}


def energy(vehicle: Vehicle) -> Fields:
    """The battery."""
    estimate = vehicle.estimate
    power = estimate.battery_volts * estimate.battery_amps
    joules, seconds = estimate.battery_energy_j, max(1.0, to_seconds(vehicle.uptime()))
    return {
        "throttle": whole(estimate.throttle * 100.0, 8) if vehicle.armed else 0,
        "voltage": estimate.battery_volts,
        "current": estimate.battery_amps,
        "power": power,
        "avg_power": joules / seconds,
        "charge": estimate.battery_used_mah / 1000.0,
        "energy": joules / 3600.0,
    }


def datalink_report(vehicle: Vehicle) -> Fields:
    """How the ground is heard."""
    kept = state_of(vehicle)
    heard = kept.uplink_at != NEVER
    silence = vehicle.kernel.now() - kept.uplink_at if heard else vehicle.uptime()
    return {
        "uplink_lost_time": whole(to_seconds(silence)),
        "uplink_nb_msgs": kept.uplink_messages & 0xFFFF,
        "downlink_nb_msgs": kept.downlink_messages & 0xFFFF,
    }


def radio_control(vehicle: Vehicle) -> Fields:
    """The sticks."""
    radio = state_of(vehicle).radio
    return {**radio.frame._asdict(), "kill": FULL, "status": radio.status(vehicle)}


def waypoint(vehicle: Vehicle, number: int) -> Fields:
    """WP_MOVED_ENU of that number."""
    east, north, up = state_of(vehicle).navigation.waypoints[number]
    return {
        "wp_id": number,
        "east": counts(east, POSITION),
        "north": counts(north, POSITION),
        "up": counts(up, POSITION),
    }


def next_waypoint(vehicle: Vehicle) -> Fields:
    """WP_MOVED_ENU of one after the other."""
    kept = state_of(vehicle)
    kept.shown_waypoint = (kept.shown_waypoint + 1) % len(kept.navigation.waypoints)
    return waypoint(vehicle, kept.shown_waypoint)


def next_setting(vehicle: Vehicle) -> Fields | None:
    """DL_VALUE of one after the other."""
    kept = state_of(vehicle)
    kept.shown_setting = (kept.shown_setting + 1) % len(NUMBERED)
    value = read_setting(vehicle, kept.shown_setting)
    return None if value is None else {"index": kept.shown_setting, "value": value}


class Regular(NamedTuple):
    """A message that goes out each *period*; ``build`` returns ``None`` while there is nothing to say."""

    name: str
    period: Ns
    build: Callable[[Vehicle], Fields | None]


def _period(seconds: float) -> Ns:
    return round(seconds * S)


REGULAR = (
    Regular("ROTORCRAFT_FP", _period(0.25), rotorcraft_fp),
    Regular("GPS_INT", _period(0.25), gps_int),
    Regular("ATTITUDE", _period(0.5), attitude),
    Regular("ROTORCRAFT_RADIO_CONTROL", _period(0.5), radio_control),
    Regular("DL_VALUE", _period(1.1), next_setting),
    Regular("ROTORCRAFT_STATUS", _period(1.2), rotorcraft_status),
    Regular("WP_MOVED_ENU", _period(1.3), next_waypoint),
    Regular("ROTORCRAFT_NAV_STATUS", _period(1.6), nav_status),
    Regular("ALIVE", _period(2.1), alive),
    Regular("ENERGY", _period(2.5), energy),
    Regular("INS_REF", _period(5.1), ins_ref),
    Regular("DATALINK_REPORT", _period(5.1), datalink_report),
)
"""In the order of their periods, which is that of messages that fall due together."""
