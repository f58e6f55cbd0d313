"""ArduPilot's way of changing modes: who may enter which, and the words of a refusal."""

from __future__ import annotations

from volery.simulation.autopilots.ardupilot.arming import CRITICAL, WARNING
from volery.simulation.autopilots.manoeuvres.manual_flight import Stabilize
from volery.simulation.autopilots.mavlink.command import ACCEPTED, DENIED, FAILED
from volery.simulation.autopilots.onboard_mission import DELAY, TAKEOFF
from volery.simulation.autopilots.vehicle_state import Mode, Vehicle

CUSTOM_MODE_ENABLED = 1

CUSTOM, GUIDED, STABILIZED, MANUAL = 1, 8, 16, 64
"""MAV_MODE_FLAG."""


def set_mode(vehicle: Vehicle, base_mode: int, number: int) -> int:
    """SET_MODE and DO_SET_MODE; returns a MAV_RESULT."""
    if not base_mode & CUSTOM_MODE_ENABLED:
        return DENIED
    return ACCEPTED if switch(vehicle, number) else FAILED


def switch(vehicle: Vehicle, number: int) -> bool:
    """Enter that mode if it may be; else say why not."""
    mode = vehicle.firmware.modes.get(number)
    if mode is None:
        vehicle.say(WARNING, f"No such mode {number}")
        return False
    if mode is vehicle.mode:
        return True
    reason = refusal(vehicle, mode) if vehicle.armed else ""
    if reason:
        words = (
            f"Mode change to {mode.name} failed: {reason}"
            if vehicle.firmware.stands
            else "Flight mode change failed"
        )
        vehicle.say(WARNING, words)
        return False
    vehicle.enter(mode)
    return True


def refusal(vehicle: Vehicle, mode: Mode) -> str:
    """Why an armed vehicle may not enter that mode; empty if it may. Disarmed it may enter any."""
    if mode.needs_position and not vehicle.has_position:
        return "requires position"
    if mode.name == "AUTO" and len(vehicle.plan) <= 1:
        return "init failed"
    if vehicle.firmware.stands and vehicle.landed:
        return _refusal_on_ground(vehicle, mode)
    return ""


def _refusal_on_ground(vehicle: Vehicle, mode: Mode) -> str:
    if mode.name == "AUTO" and not _takes_off_first(vehicle):
        vehicle.say(CRITICAL, "Auto: Missing Takeoff Cmd")
        return "init failed"
    if mode.manual_throttle and not vehicle.mode.manual_throttle and Stabilize(vehicle).pilot.throttle > 0.5:
        return "throttle too high"
    return ""


def _takes_off_first(vehicle: Vehicle) -> bool:
    """Whether the first item that navigates, but for waiting, is a take-off."""
    plan = vehicle.plan
    ahead = (item for item in plan.items[max(1, plan.current) :] if item.navigates and item.command != DELAY)
    first = next(ahead, None)
    return first is not None and first.command == TAKEOFF
