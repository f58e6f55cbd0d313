"""ArduCopter's crash check: a copter that leans far from where it should is disarmed."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, hypot, radians

from volery.base.elementary import acos, cos, sin
from volery.base.frames import Vector, turn_clockwise
from volery.base.time import Ns, S
from volery.simulation.autopilots.ardupilot.failsafes import conditions_of
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept, build_of
from volery.simulation.autopilots.ardupilot.modes import disarm
from volery.simulation.autopilots.ardupilot.pilot_input import lacks_motor
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import EMERGENCY

CRASH_AFTER = 2 * S
CRASH_LEAN, CRASH_ERROR, CRASH_ACCEL, CRASH_SPEED = 15.0, 30.0, 3.0, 10.0
"""Lean and error of the lean [degrees], acceleration [m/s^2] and speed [m/s] of ArduCopter's crash check."""


@dataclass
class CrashState:
    """A crash that has begun."""

    since: Ns = NEVER
    """Since when [ns] the vehicle leans far from where it should."""


crash_of = Kept(CrashState)


def _down_axis(roll: float, pitch: float, yaw: float) -> Vector:
    """Return the direction of the body's down axis, north, east, down."""
    along, aside = cos(roll) * sin(pitch), -sin(roll)
    return *turn_clockwise((along, aside), yaw), cos(roll) * cos(pitch)


def _angle(a: Vector, b: Vector) -> float:
    return degrees(acos(max(-1.0, min(1.0, sum(x * y for x, y in zip(a, b, strict=True))))))


def check_crash(vehicle: AutopilotVehicle) -> None:
    """Disarm a vehicle in flight that leans far from its target for two seconds, as after a roll-over."""
    if not vehicle.armed or vehicle.landed or conditions_of(vehicle).suspended:
        return
    estimate, state, now = vehicle.estimate, crash_of(vehicle), vehicle.kernel.now()
    roll, pitch, _ = estimate.attitude
    if cos(roll) * cos(pitch) >= cos(radians(CRASH_LEAN)):
        state.since = NEVER
        return
    axis = _down_axis(*estimate.attitude)
    error = _angle(axis, _down_axis(*estimate.target_attitude))
    accel = hypot(*estimate.acceleration)
    crashing = (
        vehicle.parameters["FS_CRASH_CHECK"] > 0.0
        and vehicle.mode.name not in build_of(vehicle).tumbling
        and not lacks_motor(vehicle)
        and error > CRASH_ERROR
        and accel < CRASH_ACCEL
        and hypot(*estimate.velocity) < CRASH_SPEED
    )
    if not crashing:
        state.since = NEVER
    elif state.since == NEVER:
        state.since = now
    elif now - state.since >= CRASH_AFTER:
        limits = f"AngErr={error:.0f}>{CRASH_ERROR:.0f}, Accel={accel:.1f}<{CRASH_ACCEL:.1f}"
        vehicle.send_text(EMERGENCY, f"Crash: Disarming: {limits}")
        disarm(vehicle, force=True)


COPTER = Feature(
    parameters={
        "FS_CRASH_CHECK": (
            "",
            "0 switches the crash check off: a vehicle on its back keeps its motors running",
        ),
    },
    on_tick=check_crash,
)
