"""The take-off check of ArduCopter: motors stay idle until a rotor speed in range is reported.

The speed is that of the original's simulator: none, or SIM_ESC_ARM_RPM while the vehicle is armed.
"""

from __future__ import annotations

from volery.base.time import S
from volery.simulation.autopilots.ardupilot.modes import CRITICAL
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import Vehicle

TELEMETRY_FROM = 6 * S
"""Time after boot of the first report of a speed controller [ns]."""
WARNS_EVERY = 5 * S


def has_speed_telemetry(vehicle: Vehicle) -> bool:
    """Return whether the speed controllers send telemetry."""
    return vehicle.parameters["SIM_ESC_TELEM"] != 0.0 and vehicle.uptime() >= TELEMETRY_FROM


def reported_rotor_speed(vehicle: Vehicle) -> float:
    """Return the rotor speed that the speed controllers report [1/min]."""
    return max(0.0, vehicle.parameters["SIM_ESC_ARM_RPM"]) if vehicle.armed else 0.0


def check_takeoff(vehicle: Vehicle) -> None:
    """Block the motors on the ground, or let them come up, at each tick; warn after each five seconds."""
    least, most = vehicle.parameters["TKOFF_RPM_MIN"], vehicle.parameters["TKOFF_RPM_MAX"]
    arming, now = vehicle.arming, vehicle.kernel.now()
    if least <= 0.0 or (vehicle.armed and not vehicle.landed):
        arming.blocked = False
        return
    if not vehicle.armed:
        arming.blocked, arming.warned_at = True, NEVER
        return
    if not arming.blocked:
        return
    reported, speed = has_speed_telemetry(vehicle), reported_rotor_speed(vehicle)
    if reported and speed >= least and (most <= 0.0 or speed <= most):
        arming.blocked = False
        return
    if arming.warned_at == NEVER:
        arming.warned_at = now
    if now - arming.warned_at > WARNS_EVERY:
        arming.warned_at = now
        reason = "ESC RPM out of range" if reported else "waiting for ESC RPM"
        vehicle.send_text(CRITICAL, f"Takeoff blocked: {reason}")
