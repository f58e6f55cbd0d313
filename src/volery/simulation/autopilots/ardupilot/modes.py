"""ArduPilot's arming: which checks fail, in which order and words, and what arming and disarming say and do.

The checks that fail only because the vehicle has just booted are data: from when to when. The rest look at
the vehicle.

ArduPilot's way of changing modes: who may enter which, and the words of a refusal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from volery.base.time import Ns, S
from volery.simulation.autopilots.manoeuvres.manual_flight import Stabilize
from volery.simulation.autopilots.mavlink.command import ACCEPTED, DENIED, FAILED
from volery.simulation.autopilots.onboard_mission import DELAY, TAKEOFF
from volery.simulation.autopilots.vehicle_state import Mode, Vehicle

CRITICAL, WARNING, INFO = 2, 4, 6
"""MAV_SEVERITY."""

FORCE, SKIP_CHECKS = 21_196, 2_989
"""Values of param2 that overrule checks: both directions, and arming only."""

DISPLAY_EVERY: Ns = 30 * S


class Check(NamedTuple):
    """One arming check: what it says, and whether it fails now."""

    text: str
    fails: Callable[[Vehicle], bool]


def between(start: float, end: float) -> Callable[[Vehicle], bool]:
    """Fails from *start* to *end* seconds after boot."""
    first, last = int(start * S), int(end * S)
    return lambda vehicle: first <= vehicle.uptime() < last


def flies_by_position(start: float, end: float) -> Callable[[Vehicle], bool]:
    """The same, in modes that need a position."""
    within = between(start, end)
    return lambda vehicle: vehicle.mode.needs_position and within(vehicle)


def needs_no_position(start: float, end: float) -> Callable[[Vehicle], bool]:
    """The same, in modes that need none."""
    within = between(start, end)
    return lambda vehicle: not vehicle.mode.needs_position and within(vehicle)


def lost_position(vehicle: Vehicle) -> bool:
    """The mode needs a position, home is set, but there is no position."""
    settled = vehicle.uptime() >= vehicle.rules.startup.origin_after
    return vehicle.mode.needs_position and settled and not vehicle.has_position


def no_mission(vehicle: Vehicle) -> bool:
    """AUTO without anything to do."""
    return vehicle.mode.name == "AUTO" and len(vehicle.plan) <= 1


def low_battery(vehicle: Vehicle) -> bool:
    """Below the voltage or the charge that arming asks for, where it asks."""
    volts, charge = vehicle.parameters["BATT_ARM_VOLT"], vehicle.parameters["BATT_ARM_MAH"]
    left = vehicle.parameters["BATT_CAPACITY"] - vehicle.estimate.battery_used_mah
    return 0.0 < vehicle.estimate.battery_volts < volts or left < charge


def failing(vehicle: Vehicle, checks: Sequence[Check]) -> list[str]:
    """The texts of the checks that fail, in the firmware's order."""
    if vehicle.parameters["ARMING_CHECK"] == 0.0:
        return []
    return [check.text for check in checks if check.fails(vehicle)]


def not_armable(vehicle: Vehicle) -> list[str]:
    """The text that refuses the mode itself; copter names it, rover does not."""
    if vehicle.mode.armable:
        return []
    name = f"{vehicle.mode.name} mode not armable" if vehicle.flies else "Mode not armable"
    return [name]


def arm(vehicle: Vehicle, problems: Callable[[Vehicle], list[str]], words: str, force: bool) -> int:
    """Arm if nothing speaks against it; returns a MAV_RESULT."""
    if vehicle.armed:
        return ACCEPTED
    found = [] if force else problems(vehicle)
    if found:
        vehicle.refused_at = vehicle.kernel.now()
        for text in found:
            vehicle.say(CRITICAL, f"Arm: {text}")
        return FAILED
    if not vehicle.home_by_user and vehicle.has_position:
        vehicle.home_is_here()
    vehicle.prearm_ok = True
    vehicle.arm()
    vehicle.say(INFO, words)
    return ACCEPTED


def disarm(vehicle: Vehicle, words: str, force: bool) -> int:
    """Disarm, in the air only by force; returns a MAV_RESULT."""
    if not vehicle.armed:
        return ACCEPTED
    if vehicle.flies and not vehicle.landed and not force:
        return FAILED
    vehicle.disarm()
    vehicle.say(INFO, words)
    if vehicle.flies:
        vehicle.set_parameter("MOT_THST_HOVER", vehicle.estimate.hover_throttle)
    return ACCEPTED


def update_prearm_state(vehicle: Vehicle, problems: Callable[[Vehicle], list[str]]) -> None:
    """Once a second: whether it could be armed; each half minute it says why not."""
    if vehicle.armed:
        vehicle.prearm_ok = True
        return
    found = problems(vehicle)
    vehicle.prearm_ok = not found
    if vehicle.uptime() - vehicle.displayed_at >= DISPLAY_EVERY:
        vehicle.displayed_at = vehicle.uptime()
        for text in found:
            vehicle.say(CRITICAL, f"PreArm: {text}")


CUSTOM_MODE_ENABLED = 1

CUSTOM, GUIDED, STABILIZED, MANUAL = 1, 8, 16, 64
"""MAV_MODE_FLAG."""


def set_mode(vehicle: Vehicle, base_mode: int, number: int) -> int:
    """SET_MODE and DO_SET_MODE; returns a MAV_RESULT."""
    if not base_mode & CUSTOM_MODE_ENABLED:
        return DENIED
    return ACCEPTED if change_mode(vehicle, number) else FAILED


def change_mode(vehicle: Vehicle, number: int) -> bool:
    """Enter that mode if it may be; else say why not."""
    mode = vehicle.rules.modes.get(number)
    if mode is None:
        vehicle.say(WARNING, f"No such mode {number}")
        return False
    if mode is vehicle.mode:
        return True
    reason = refusal(vehicle, mode) if vehicle.armed else ""
    if reason:
        words = (
            f"Mode change to {mode.name} failed: {reason}" if vehicle.flies else "Flight mode change failed"
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
    if vehicle.flies and vehicle.landed:
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
