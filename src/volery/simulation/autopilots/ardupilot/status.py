"""Telemetry of ArduPilot about itself: heartbeat, health, battery, channels, mission, estimator, version."""

from __future__ import annotations

from typing import NamedTuple

from volery.base.time import S
from volery.simulation.autopilots.ardupilot.motion import FIX_AFTER, NO_FIX_AFTER
from volery.simulation.autopilots.mavlink.message_fields import Fields, boot_ms, boot_us, to_int16, to_uint16
from volery.simulation.autopilots.onboard_mission import OnboardMission
from volery.simulation.autopilots.vehicle_state import Vehicle

ARMED = 128
"""MAV_MODE_FLAG_SAFETY_ARMED."""

CALIBRATING, STANDBY, ACTIVE, CRITICAL = 2, 3, 4, 5
"""MAV_STATE."""

MEASURED_AFTER = int(2.4 * S)
"""From this uptime on battery and compass have been read, and the copter's terrain follower runs."""

ON_GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4
"""MAV_LANDED_STATE."""

NOT_THERE = 65_535

# MAV_SYS_STATUS_SENSOR
MAG, GPS = 1 << 2, 1 << 5
RATE_CONTROL, ATTITUDE_CONTROL, YAW_CONTROL, Z_CONTROL, XY_CONTROL = (
    1 << 10,
    1 << 11,
    1 << 12,
    1 << 13,
    1 << 14,
)
AHRS, TERRAIN, LOGGING, BATTERY, PREARM = 1 << 21, 1 << 22, 1 << 24, 1 << 25, 1 << 28


class Health(NamedTuple):
    """The three words of SYS_STATUS when all is well, disarmed, in a mode without controls of its own."""

    present: int
    enabled: int
    healthy: int
    estimator_enabled_after: int
    """Uptime from which the attitude estimator counts as enabled [ns], and as healthy."""
    estimator_healthy_after: int


def logs(vehicle: Vehicle) -> bool:
    """Whether the log is written: armed, and 15 s after that and after a refusal."""
    now = vehicle.kernel.now()
    return vehicle.armed or now - vehicle.refused_at < 15 * S or now - vehicle.disarmed_at < 15 * S


def sys_status(vehicle: Vehicle, health: Health) -> Fields:
    """SYS_STATUS."""
    age, controls = vehicle.uptime(), vehicle.mode.controls
    present, enabled, healthy = health.present, health.enabled | controls, health.healthy | controls
    missing = 0
    if age < NO_FIX_AFTER:
        missing |= GPS
    if age < MEASURED_AFTER:
        missing |= TERRAIN
        healthy &= ~(MAG | BATTERY)
    if age < health.estimator_enabled_after:
        enabled &= ~AHRS
    if age < health.estimator_healthy_after or not vehicle.estimate.attitude_ok:
        healthy &= ~AHRS
    if not logs(vehicle):
        enabled &= ~LOGGING
    if not vehicle.prearm_ok:
        healthy &= ~PREARM
    if age > FIX_AFTER and vehicle.estimate.gps.fix_type == 0:
        healthy &= ~GPS
    volts, amps, left = _battery(vehicle)
    return {
        "onboard_control_sensors_present": present & ~missing,
        "onboard_control_sensors_enabled": enabled & ~missing,
        "onboard_control_sensors_health": healthy & ~missing,
        "load": 0,
        "voltage_battery": volts,
        "current_battery": amps,
        "battery_remaining": left,
    }


def _battery(vehicle: Vehicle) -> tuple[int, int, int]:
    """Millivolts, hundredths of an ampere, percent."""
    if vehicle.uptime() < MEASURED_AFTER:
        return 0, -1, -1
    estimate = vehicle.estimate
    capacity = vehicle.parameters["BATT_CAPACITY"]
    left = 1.0 - estimate.battery_used_mah / capacity if capacity > 0.0 else 0.0
    return (
        to_uint16(estimate.battery_volts * 1000.0),
        to_int16(estimate.battery_amps * 100.0),
        int(max(0.0, left) * 100.0),
    )


def battery_status(vehicle: Vehicle) -> Fields:
    """BATTERY_STATUS."""
    volts, amps, left = _battery(vehicle)
    estimate = vehicle.estimate
    return {
        "id": 0,
        "temperature": 32_767,
        "voltages": (volts or NOT_THERE, *([NOT_THERE] * 9)),
        "current_battery": max(0, amps),
        "current_consumed": int(estimate.battery_used_mah),
        "energy_consumed": int(estimate.battery_energy_j / 100.0),
        "battery_remaining": left,
        "charge_state": 1,
    }


def heartbeat(vehicle: Vehicle, kind: int, system_status: int) -> Fields:
    """HEARTBEAT of a vehicle of MAV_TYPE *kind*."""
    return {
        "type": kind,
        "autopilot": 3,
        "base_mode": vehicle.mode.base_mode | (ARMED if vehicle.armed else 0),
        "custom_mode": vehicle.mode.number,
        "system_status": system_status,
        "mavlink_version": 3,
    }


def extended_sys_state(vehicle: Vehicle) -> Fields:
    """EXTENDED_SYS_STATE."""
    if vehicle.landed:
        landed = ON_GROUND
    elif vehicle.manoeuvre.taking_off:
        landed = TAKING_OFF
    else:
        landed = LANDING if vehicle.manoeuvre.landing else IN_AIR
    return {"vtol_state": 3, "landed_state": landed}


def rc_channels(vehicle: Vehicle) -> Fields:
    """RC_CHANNELS: what the autopilot hears, overrides included."""
    fields: Fields = {"time_boot_ms": boot_ms(vehicle), "chancount": 16, "rssi": 255}
    for number, pulse in enumerate(vehicle.sticks.pulses(), start=1):
        fields[f"chan{number}_raw"] = pulse
    return fields


def rc_channels_raw(vehicle: Vehicle) -> Fields:
    """RC_CHANNELS_RAW: the first eight."""
    fields: Fields = {"time_boot_ms": boot_ms(vehicle), "port": 0, "rssi": 255}
    for number, pulse in enumerate(vehicle.sticks.pulses()[:8], start=1):
        fields[f"chan{number}_raw"] = pulse
    return fields


def rc_channels_scaled(vehicle: Vehicle) -> Fields:
    """RC_CHANNELS_SCALED: steering and throttle outputs in 1/10000."""
    steering, throttle, _, _ = vehicle.estimate.motors
    return {
        "time_boot_ms": boot_ms(vehicle),
        "chan1_scaled": round(steering * 10_000.0),
        "chan3_scaled": round(throttle * 10_000.0),
        "rssi": 255,
    }


def servo_output(vehicle: Vehicle) -> Fields:
    """SERVO_OUTPUT_RAW."""
    first, second, third, fourth = vehicle.estimate.motor_pwm
    return {
        "time_usec": boot_us(vehicle),
        "port": 0,
        "servo1_raw": first,
        "servo2_raw": second,
        "servo3_raw": third,
        "servo4_raw": fourth,
    }


NO_MISSION, NOT_STARTED, IN_PROGRESS, COMPLETE = 1, 2, 3, 5
"""MISSION_STATE."""


def _mission_state(plan: OnboardMission) -> int:
    if len(plan) <= 1:
        return NO_MISSION
    if plan.complete:
        return COMPLETE
    return IN_PROGRESS if plan.current else NOT_STARTED


def mission_current(vehicle: Vehicle) -> Fields:
    """MISSION_CURRENT: home is not counted among the items."""
    plan = vehicle.plan
    return {
        "seq": plan.current,
        "total": max(0, len(plan) - 1),
        "mission_state": _mission_state(plan),
        "mission_mode": int(vehicle.mode.name == "AUTO"),
    }


WITHOUT_POSITION, WITH_POSITION, STARTING = 167, 831, 1024
"""EKF_STATUS_FLAGS as recorded: attitude and height only; with positions; not initialised."""

EKF_REPORTS_AFTER, EKF_STARTS_AFTER, EKF_ALIGNED_AFTER = int(3.3 * S), int(5.3 * S), int(5.75 * S)


def ekf_status(vehicle: Vehicle) -> Fields | None:
    """EKF_STATUS_REPORT."""
    age = vehicle.uptime()
    if age < EKF_REPORTS_AFTER:
        return None
    if age < EKF_ALIGNED_AFTER:
        return {"flags": STARTING if age < EKF_STARTS_AFTER else 0}
    estimate = vehicle.estimate
    return {
        "flags": WITH_POSITION if vehicle.has_position else WITHOUT_POSITION,
        "velocity_variance": 0.007,
        "pos_horiz_variance": min(1.0, abs(estimate.gps_innovation) / 5.0) ** 2,
        "pos_vert_variance": 0.002,
        "compass_variance": min(1.0, abs(estimate.heading_error)),
    }


def vibration(vehicle: Vehicle) -> Fields:
    """VIBRATION: the law of the body has none."""
    return {"time_usec": boot_us(vehicle), "vibration_x": 0.003, "vibration_y": 0.003, "vibration_z": 0.003}


def wind(vehicle: Vehicle) -> Fields | None:
    """WIND: without an airspeed sensor the firmware estimates none."""
    return {"direction": -180.0, "speed": 0.0, "speed_z": 0.0} if vehicle.has_position else None


def terrain_report(vehicle: Vehicle) -> Fields:
    """TERRAIN_REPORT: no data on board."""
    if vehicle.uptime() < FIX_AFTER:
        return {"spacing": 100, "pending": 56}
    latitude, longitude, amsl = vehicle.estimate.geodetic
    return {
        "lat": round(latitude * 1e7),
        "lon": round(longitude * 1e7),
        "current_height": amsl,
        "pending": 504,
    }


def esc_telemetry(vehicle: Vehicle) -> Fields | None:
    """ESC_TELEMETRY_1_TO_4: as the firmware's simulator makes it up."""
    age = vehicle.uptime()
    if age < 6 * S:
        return None
    count = age // (S // 10) % 65_536
    return {
        "temperature": (32,) * 4,
        "voltage": (1679,) * 4,
        "current": (80,) * 4,
        "totalcurrent": (1,) * 4,
        "rpm": (0,) * 4,
        "count": (count,) * 4,
    }


def power_status(_vehicle: Vehicle) -> Fields:
    """POWER_STATUS."""
    return {"Vcc": 5000}


def meminfo(_vehicle: Vehicle) -> Fields:
    """MEMINFO."""
    return {"brkval": 0, "freemem": 65_535, "freemem32": 131_072}


FLIGHT_SW_VERSION = 67_438_335
"""4.5.6, an official release, as recorded."""

GIT_HASH = tuple(b"7ce11b41")


def autopilot_version(_vehicle: Vehicle, capabilities: int, board: bytes) -> Fields:
    """AUTOPILOT_VERSION; *board* is the board's own number, as text."""
    return {
        "capabilities": capabilities,
        "flight_sw_version": FLIGHT_SW_VERSION,
        "flight_custom_version": GIT_HASH,
        "uid2": tuple(board.ljust(18, b"\0")[:18]),
    }
