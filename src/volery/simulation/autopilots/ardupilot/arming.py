"""ArduPilot's arming: which checks fail, in which order and words, and what arming and disarming say and do.

The checks that fail only because the vehicle has just booted are data: from when to when. The rest look at
the vehicle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from volery.base.time import Ns, S
from volery.simulation.autopilots.mavlink.command import ACCEPTED, FAILED
from volery.simulation.autopilots.vehicle_state import Vehicle

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
    settled = vehicle.uptime() >= vehicle.firmware.origin_after
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
    name = f"{vehicle.mode.name} mode not armable" if vehicle.firmware.stands else "Mode not armable"
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
    if vehicle.firmware.stands and not vehicle.landed and not force:
        return FAILED
    vehicle.disarm()
    vehicle.say(INFO, words)
    vehicle.firmware.on_disarmed(vehicle)
    return ACCEPTED


def look_before_arming(vehicle: Vehicle, problems: Callable[[Vehicle], list[str]]) -> None:
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
