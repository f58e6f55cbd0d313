"""Telemetry of PX4 about itself: heartbeat, health, battery, motors, mission, estimator, version, events."""

from __future__ import annotations

from volery.base.time import S
from volery.simulation.autopilots.mavlink.message_fields import Fields, boot_us, to_int16, to_uint16
from volery.simulation.autopilots.px4 import modes
from volery.simulation.autopilots.px4.commander import of
from volery.simulation.autopilots.vehicle_state import Vehicle

ARMED = 128
"""MAV_MODE_FLAG_SAFETY_ARMED."""

STANDBY, ACTIVE, CRITICAL = 3, 4, 5
"""MAV_STATE."""

ON_GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4
"""MAV_LANDED_STATE."""

NOT_THERE = 65_535

PRESENT, ENABLED, HEALTHY, PREARM, GPS = 35_651_629, 35_717_165, 572_555_327, 1 << 28, 1 << 5
"""Words of SYS_STATUS as recorded; the check before arming is a bit of its own."""

CAPABILITIES = 60_671
"""MAV_PROTOCOL_CAPABILITY bits, as recorded."""

VERSION, OS_VERSION = 17_694_975, 101_854_463
"""1.14.0, an official release, as recorded, and the recorded machine's kernel."""

GIT_HASH = (0, 0, 0, 114, 221, 65, 197, 184)
UID = 5_283_920_058_631_409_231

WITH_POSITION, WITHOUT_POSITION = 831, 1
"""ESTIMATOR_STATUS_FLAGS as recorded with a position; without one only the attitude counts."""


def heartbeat(vehicle: Vehicle, kind: int) -> Fields:
    """HEARTBEAT; *kind* is a MAV_TYPE."""
    commander, mode = of(vehicle), vehicle.mode
    base = mode.base_mode
    if mode.number == modes.OFFBOARD and commander.stream.target is None:
        base = modes.CUSTOM
    state = ACTIVE if vehicle.armed else STANDBY
    if vehicle.armed and commander.failsafe:
        state = CRITICAL
    return {
        "type": kind,
        "autopilot": 12,
        "base_mode": base | (ARMED if vehicle.armed else 0),
        "custom_mode": mode.number,
        "system_status": state,
        "mavlink_version": 3,
    }


def sys_status(vehicle: Vehicle) -> Fields:
    """SYS_STATUS."""
    estimate = vehicle.estimate
    healthy = HEALTHY
    if of(vehicle).armable or vehicle.armed:
        healthy |= PREARM
    if estimate.gps.fix_type == 0:
        healthy &= ~GPS
    return {
        "onboard_control_sensors_present": PRESENT,
        "onboard_control_sensors_enabled": ENABLED,
        "onboard_control_sensors_health": healthy,
        "load": 100,
        "voltage_battery": to_uint16(estimate.battery_volts * 1000.0),
        "current_battery": to_int16(estimate.battery_amps * 100.0),
        "battery_remaining": _percent(vehicle),
        "onboard_control_sensors_health_extended": 1,
    }


def _percent(vehicle: Vehicle) -> int:
    return min(100, max(0, int(vehicle.estimate.battery_left * 100.0)))


def battery_status(vehicle: Vehicle) -> Fields:
    """BATTERY_STATUS."""
    estimate = vehicle.estimate
    return {
        "id": 0,
        "battery_function": 1,
        "type": 1,
        "temperature": 32_767,
        "voltages": (to_uint16(estimate.battery_volts * 1000.0), *([NOT_THERE] * 9)),
        "current_battery": to_int16(estimate.battery_amps * 100.0),
        "current_consumed": int(estimate.battery_used_mah),
        "energy_consumed": -1,
        "battery_remaining": _percent(vehicle),
        "charge_state": _charge_state(vehicle),
    }


def _charge_state(vehicle: Vehicle) -> int:
    """MAV_BATTERY_CHARGE_STATE."""
    left, p = vehicle.estimate.battery_left, vehicle.parameters
    levels = (p["BAT_LOW_THR"], p["BAT_CRIT_THR"], p["BAT_EMERGEN_THR"])
    return 1 + sum(left < level for level in levels)


def extended_sys_state(vehicle: Vehicle) -> Fields:
    """EXTENDED_SYS_STATE."""
    manoeuvre = vehicle.manoeuvre
    state = IN_AIR
    if not vehicle.firmware.stands or not of(vehicle).flying:
        state = ON_GROUND
    elif manoeuvre.taking_off:
        state = TAKING_OFF
    elif manoeuvre.landing:
        state = LANDING
    return {"vtol_state": 0, "landed_state": state}


def estimator_status(vehicle: Vehicle) -> Fields:
    """ESTIMATOR_STATUS."""
    estimate = vehicle.estimate
    plane, height, _, _ = estimate.spread
    return {
        "time_usec": boot_us(vehicle),
        "flags": WITH_POSITION if vehicle.has_position else WITHOUT_POSITION,
        "vel_ratio": 0.06,
        "pos_horiz_ratio": min(1.0, abs(estimate.gps_innovation) / 5.0) ** 2,
        "pos_vert_ratio": 0.035,
        "mag_ratio": min(1.0, abs(estimate.heading_error)),
        "pos_horiz_accuracy": plane,
        "pos_vert_accuracy": height,
    }


def servo_output(vehicle: Vehicle) -> Fields:
    """SERVO_OUTPUT_RAW: 900 is off."""
    pulses = vehicle.estimate.motor_pwm if vehicle.armed else (900,) * 4
    fields: Fields = {"time_usec": boot_us(vehicle), "port": 0}
    for place, pulse in enumerate((*pulses, *([900] * 12)), start=1):
        fields[f"servo{place}_raw"] = pulse
    return fields


def vibration(vehicle: Vehicle) -> Fields:
    """VIBRATION: the law of the body has none."""
    return {"time_usec": boot_us(vehicle), "vibration_x": 0.0, "vibration_y": 0.1, "vibration_z": 1.3}


def mission_current(vehicle: Vehicle) -> Fields | None:
    """MISSION_CURRENT: only while there is a mission."""
    plan = vehicle.plan
    return {"seq": plan.current} if len(plan) else None


def ping(vehicle: Vehicle) -> Fields:
    """PING, to anyone."""
    return {"time_usec": boot_us(vehicle), "seq": vehicle.uptime() // S}


def timesync(vehicle: Vehicle) -> Fields:
    """TIMESYNC, as a question."""
    return {"tc1": 0, "ts1": vehicle.uptime()}


def event_sequence(vehicle: Vehicle) -> Fields:
    """CURRENT_EVENT_SEQUENCE: by it a listener notices that it missed events."""
    return {"sequence": of(vehicle).log.latest}


def autopilot_version(vehicle: Vehicle) -> Fields:
    """AUTOPILOT_VERSION."""
    return {
        "capabilities": CAPABILITIES,
        "flight_sw_version": VERSION,
        "middleware_sw_version": VERSION,
        "os_sw_version": OS_VERSION,
        "board_version": 1,
        "flight_custom_version": GIT_HASH,
        "middleware_custom_version": GIT_HASH,
        "uid": UID + vehicle.system - 1,
    }
