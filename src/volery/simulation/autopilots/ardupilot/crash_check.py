"""ArduCopter's crash check: a copter that leans far from where it should is disarmed."""

from __future__ import annotations

from math import degrees, hypot, radians

from volery.base.elementary import acos, cos, sin
from volery.base.frames import Vector
from volery.base.time import S
from volery.simulation.autopilots.ardupilot.modes import COPTER_DISARMED, disarm
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import Vehicle

CRASH_AFTER = 2 * S
CRASH_LEAN, CRASH_ERROR, CRASH_ACCEL, CRASH_SPEED = 15.0, 30.0, 3.0, 10.0
"""Lean and error of the lean [degrees], acceleration [m/s^2] and speed [m/s] of ArduCopter's crash check."""
UNCHECKED = ("ACRO", "FLIP", "THROW")
"""Modes without a crash check."""
EMERGENCY = 0
"""MAV_SEVERITY."""


LACKING = 0.3
"""Share of a motor's thrust up to which the copter cannot be held."""


def lacks_motor(vehicle: Vehicle) -> bool:
    """Return whether SIM_ENGINE_MUL has taken a motor from a copter.

    The original's simulator sets a falling copter level at its first contact, and its landed detector waits
    for the lower limit of the motors: such a copter is neither crashed nor landed, and stays armed.
    """
    return vehicle.parameters["SIM_ENGINE_MUL"] <= LACKING


def _down_axis(roll: float, pitch: float, yaw: float) -> Vector:
    """Return the direction of the body's down axis, north, east, down."""
    along, aside = cos(roll) * sin(pitch), -sin(roll)
    return along * cos(yaw) - aside * sin(yaw), along * sin(yaw) + aside * cos(yaw), cos(roll) * cos(pitch)


def _angle(a: Vector, b: Vector) -> float:
    return degrees(acos(max(-1.0, min(1.0, sum(x * y for x, y in zip(a, b, strict=True))))))


def check_crash(vehicle: Vehicle) -> None:
    """Disarm a vehicle that leans far from its target for two seconds, as after a roll-over."""
    estimate, now = vehicle.estimate, vehicle.kernel.now()
    roll, pitch, _ = estimate.attitude
    if cos(roll) * cos(pitch) >= cos(radians(CRASH_LEAN)):
        vehicle.failsafes.crashing_since = NEVER
        return
    axis = _down_axis(*estimate.attitude)
    error = _angle(axis, _down_axis(*estimate.target_attitude))
    accel = hypot(*estimate.acceleration)
    crashing = (
        vehicle.parameters["FS_CRASH_CHECK"] > 0.0
        and vehicle.mode.name not in UNCHECKED
        and not lacks_motor(vehicle)
        and error > CRASH_ERROR
        and accel < CRASH_ACCEL
        and hypot(*estimate.velocity) < CRASH_SPEED
    )
    if not crashing:
        vehicle.failsafes.crashing_since = NEVER
    elif vehicle.failsafes.crashing_since == NEVER:
        vehicle.failsafes.crashing_since = now
    elif now - vehicle.failsafes.crashing_since >= CRASH_AFTER:
        limits = f"AngErr={error:.0f}>{CRASH_ERROR:.0f}, Accel={accel:.1f}<{CRASH_ACCEL:.1f}"
        vehicle.send_text(EMERGENCY, f"Crash: Disarming: {limits}")
        disarm(vehicle, COPTER_DISARMED, force=True)
