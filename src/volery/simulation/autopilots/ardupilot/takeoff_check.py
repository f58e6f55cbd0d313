"""The take-off check of ArduCopter: motors stay idle until a rotor speed in range is reported.

The speed is that of the original's simulator: none, or SIM_ESC_ARM_RPM while the vehicle is armed.
"""

from __future__ import annotations

from dataclasses import dataclass

from volery.base.time import Ns, S
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept
from volery.simulation.autopilots.mavlink.messages import Fields, to_uint16
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import CRITICAL

TELEMETRY_FROM = 6 * S
"""Time after boot of the first report of a speed controller [ns]."""
WARNS_EVERY = 5 * S


@dataclass
class Warned:
    """The warning that the motors are blocked."""

    at: Ns = NEVER
    """Time of the last one [ns]."""


warned_of = Kept(Warned)


def has_speed_telemetry(vehicle: AutopilotVehicle) -> bool:
    """Return whether the speed controllers send telemetry."""
    return vehicle.parameters["SIM_ESC_TELEM"] != 0.0 and vehicle.uptime() >= TELEMETRY_FROM


def reported_rotor_speed(vehicle: AutopilotVehicle) -> float:
    """Return the rotor speed that the speed controllers report [1/min]."""
    return max(0.0, vehicle.parameters["SIM_ESC_ARM_RPM"]) if vehicle.armed else 0.0


def check_takeoff(vehicle: AutopilotVehicle) -> None:
    """Block the motors on the ground, or let them come up, at each tick; warn after each five seconds."""
    least, most = vehicle.parameters["TKOFF_RPM_MIN"], vehicle.parameters["TKOFF_RPM_MAX"]
    arming, warned, now = vehicle.arming, warned_of(vehicle), vehicle.kernel.now()
    if least <= 0.0 or (vehicle.armed and not vehicle.landed):
        arming.blocked = False
        return
    if not vehicle.armed:
        arming.blocked, warned.at = True, NEVER
        return
    if not arming.blocked:
        return
    reported, speed = has_speed_telemetry(vehicle), reported_rotor_speed(vehicle)
    if reported and speed >= least and (most <= 0.0 or speed <= most):
        arming.blocked = False
        return
    if warned.at == NEVER:
        warned.at = now
    if now - warned.at > WARNS_EVERY:
        warned.at = now
        reason = "ESC RPM out of range" if reported else "waiting for ESC RPM"
        vehicle.send_text(CRITICAL, f"Takeoff blocked: {reason}")


def esc_telemetry(vehicle: AutopilotVehicle) -> Fields | None:
    """Return ESC_TELEMETRY_1_TO_4 with the constants of the firmware's simulator."""
    if not has_speed_telemetry(vehicle):
        return None
    count = vehicle.uptime() // (S // 10) % 65_536
    return {
        "temperature": (32,) * 4,
        "voltage": (1679,) * 4,
        "current": (80,) * 4,
        "totalcurrent": (1,) * 4,
        "rpm": (to_uint16(reported_rotor_speed(vehicle)),) * 4,
        "count": (count,) * 4,
    }


COPTER = Feature(
    parameters={
        "TKOFF_RPM_MIN": ("1/min", "rotor speed below which a copter does not take off; 0: it always may"),
        "TKOFF_RPM_MAX": ("1/min", "rotor speed above which it does not; 0: any"),
        "SIM_ESC_TELEM": ("", "0: the speed controllers send no telemetry"),
        "SIM_ESC_ARM_RPM": ("1/min", "rotor speed that the speed controllers report while armed"),
    },
    on_tick=check_takeoff,
    telemetry={"ESC_TELEMETRY_1_TO_4": esc_telemetry},
)
