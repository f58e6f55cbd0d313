"""Arming and mode changes of ArduPilot, with the firmware's wording of refusals.

Arming checks that fail only while the vehicle boots are data: an interval of uptime. The others inspect the
vehicle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from volery.base.time import Ns, S
from volery.simulation.autopilots.ardupilot.battery import left_mah
from volery.simulation.autopilots.ardupilot.feature import ArmingCheck, Kept, build_of
from volery.simulation.autopilots.manoeuvres.manual_flight import Stabilize
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, DENIED, FAILED
from volery.simulation.autopilots.onboard_mission import DELAY, TAKEOFF
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import FIX_3D, AutopilotVehicle, Mode
from volery.trace.events import CRITICAL, INFO, NOTICE, WARNING

FORCE, SKIP_CHECKS = 21_196, 2_989
"""Values of param2 that skip the checks: for both directions, and for arming only."""

LEARN_AND_SAVE = 2
"""MOT_HOVER_LEARN."""

DISPLAY_EVERY: Ns = 30 * S
DISPLAY_PAUSE: Ns = 4 * S


@dataclass
class Reports:
    """What ArduPilot has reported since boot. Uptimes in ns."""

    arming_checks_at: Ns = 0
    """Uptime of the last report of failed arming checks."""
    arming_checks_due: bool = False
    """Whether checks have begun to fail since then."""
    counters_at: Ns = 0
    """Uptime at which operating hours were last stored."""
    contacts: int = 0
    """Number of touch-downs reported."""
    parameters_erased: bool = False
    """Whether the parameters have their defaults from the next boot on."""


reports_of = Kept(Reports)


@dataclass
class ReceivedCommands:
    """What has been received since boot."""

    station_at: Ns = NEVER
    """Time of the last message of the ground station that controls the vehicle [ns]."""
    transmitter: bool = False
    """Whether a transmitter or overrides have been received."""


received_of = Kept(ReceivedCommands)


def between_uptimes(start: float, end: float) -> Callable[[AutopilotVehicle], bool]:
    """Return a check that fails between two uptimes [s]."""
    first, last = int(start * S), int(end * S)
    return lambda vehicle: first <= vehicle.uptime() < last


def in_position_modes(start: float, end: float) -> Callable[[AutopilotVehicle], bool]:
    """Return a check that fails between two uptimes [s] in modes that need a position."""
    within = between_uptimes(start, end)
    return lambda vehicle: vehicle.mode.needs_position and within(vehicle)


def in_other_modes(start: float, end: float) -> Callable[[AutopilotVehicle], bool]:
    """Return a check that fails between two uptimes [s] in modes that need no position."""
    within = between_uptimes(start, end)
    return lambda vehicle: not vehicle.mode.needs_position and within(vehicle)


def lost_position(vehicle: AutopilotVehicle) -> bool:
    """Return whether the mode needs a position, an origin is set, but there is no position."""
    settled = vehicle.uptime() >= vehicle.rules.startup.origin_after
    return vehicle.mode.needs_position and settled and not vehicle.has_position


def bad_fix(vehicle: AutopilotVehicle) -> bool:
    """Return whether there is a receiver of satellites that has no fix now."""
    known = vehicle.uptime() >= vehicle.rules.startup.position_after and vehicle.parameters["GPS_TYPE"] != 0.0
    return known and vehicle.estimate.fix_type < FIX_3D


def no_mission(vehicle: AutopilotVehicle) -> bool:
    """Return whether the mode is AUTO without a mission."""
    return vehicle.mode.name == "AUTO" and len(vehicle.mission) <= 1


def first_of(texts: Sequence[str], problem: Callable[[AutopilotVehicle], str]) -> tuple[ArmingCheck, ...]:
    """Return checks of which at most one fails: that with the text which *problem* returns."""
    return tuple(ArmingCheck(text, partial(_is_problem, text=text, problem=problem)) for text in texts)


def _is_problem(vehicle: AutopilotVehicle, text: str, problem: Callable[[AutopilotVehicle], str]) -> bool:
    return problem(vehicle) == text


_BATTERY_TEXTS = (
    "Battery 1 below minimum arming voltage",
    "Battery 1 below minimum arming capacity",
    "Battery 1 low voltage failsafe",
    "Battery 1 low capacity failsafe",
    "Battery 1 critical voltage failsafe",
    "Battery 1 critical capacity failsafe",
    "Battery 1 capacity failsafe critical >= low",
    "Battery 1 voltage failsafe critical >= low",
)


def _battery_problem(vehicle: AutopilotVehicle) -> str:
    """Return the first check of the battery that fails (AP_BattMonitor_Backend::arming_checks), or ""."""
    p, volts, charge = vehicle.parameters, vehicle.estimate.battery_volts, left_mah(vehicle)
    low, critical = p["BATT_LOW_VOLT"], p["BATT_CRT_VOLT"]
    low_mah, critical_mah = p["BATT_LOW_MAH"], p["BATT_CRT_MAH"]
    failed = (
        0.0 < volts < p["BATT_ARM_VOLT"],
        charge < p["BATT_ARM_MAH"],
        0.0 < volts < low,
        charge < low_mah and low_mah > 0.0,
        0.0 < volts < critical,
        charge < critical_mah and critical_mah > 0.0,
        0.0 < low_mah <= critical_mah,
        0.0 < low <= critical,
    )
    return next((text for text, fails in zip(_BATTERY_TEXTS, failed, strict=True) if fails), "")


SHARED_CHECKS = (
    *first_of(_BATTERY_TEXTS, _battery_problem),
    ArmingCheck("Need Position Estimate", lambda vehicle: lost_position(vehicle) and not bad_fix(vehicle)),
    ArmingCheck("Mode requires mission", no_mission),
    ArmingCheck("GPS 1: Bad fix", lambda vehicle: vehicle.mode.needs_position and bad_fix(vehicle)),
    ArmingCheck("Radio failsafe on", lambda vehicle: "radio" in vehicle.failsafes.active),
)
"""The last checks of copter and rover."""

THROTTLE_CHECKED, STICKS_UNCHECKED = 1 << 5, 1 << 6
"""Bits of RC_OPTIONS."""
RESTS_AT_MIDDLE = 1 << 0
"""Bit of PILOT_THR_BHV, of a copter."""


def sticks_not_neutral(vehicle: AutopilotVehicle, *, by_rudder: bool) -> list[str]:
    """Return the texts of the sticks that are not at rest, which arming requires while there is a receiver.

    Args:
        vehicle: The vehicle.
        by_rudder: Whether the yaw stick of a copter, the steering of a rover, arms and so is not checked.
    """
    if not received_of(vehicle).transmitter or "radio" in vehicle.failsafes.active:
        return []
    sticks, options = vehicle.tuning.sticks, round(vehicle.parameters["RC_OPTIONS"])
    read = sticks.read(vehicle.rc)
    found = []
    if not options & STICKS_UNCHECKED:
        arms = ("Yaw" if vehicle.flies else "Roll") if by_rudder else ""
        found = [
            ("Roll", sticks.roll, read.roll),
            ("Pitch", sticks.pitch, read.pitch),
            ("Yaw", sticks.yaw, read.yaw),
        ]
        found = [one for one in found if one[0] != arms]
    middle = vehicle.flies and round(vehicle.parameters["PILOT_THR_BHV"]) & RESTS_AT_MIDDLE
    if options & THROTTLE_CHECKED and not middle:
        throttle = sticks.travels[2]
        pulse = vehicle.rc[sticks.throttle]
        deflected = throttle.share(pulse) if vehicle.flies else throttle.deflection(pulse)
        found.append(("Throttle", sticks.throttle, deflected))
    return [f"{name} (RC{channel}) is not neutral" for name, channel, deflection in found if deflection]


def failing_prearm_checks(vehicle: AutopilotVehicle) -> list[str]:
    """Return the texts of the pre-arm checks that fail, in the firmware's order."""
    if vehicle.parameters["ARMING_CHECK"] == 0.0:
        return []
    build = build_of(vehicle)
    found = [check.text for check in build.checks if check.fails(vehicle)]
    return found + [text for problems in build.problems for text in problems(vehicle)]


def mode_not_armable(vehicle: AutopilotVehicle) -> list[str]:
    """Return the text that refuses the mode itself, if it does; a copter names the mode, a rover does not."""
    if vehicle.mode.armable:
        return []
    name = f"{vehicle.mode.name} mode not armable" if vehicle.flies else "Mode not armable"
    return [name]


def arm(vehicle: AutopilotVehicle, *, force: bool = False, by_rudder: bool = False) -> int:
    """Arm if no check forbids it, and return a MAV_RESULT.

    Args:
        vehicle: The vehicle.
        force: Skip the checks.
        by_rudder: Whether the yaw stick of a copter, the steering of a rover, arms.
    """
    if vehicle.armed:
        return ACCEPTED
    found = [] if force else build_of(vehicle).arming_problems(vehicle, by_rudder=by_rudder)
    if found:
        vehicle.arming.refused_at = vehicle.kernel.now()
        for text in found:
            vehicle.send_text(CRITICAL, f"Arm: {text}")
        return FAILED
    if not (vehicle.home and vehicle.home.by_user) and vehicle.has_position:
        vehicle.set_home_here()
    vehicle.arming.checks_passed = True
    vehicle.arm()
    vehicle.send_text(INFO, build_of(vehicle).words[0])
    return ACCEPTED


def disarm(vehicle: AutopilotVehicle, *, force: bool) -> int:
    """Disarm, in flight only by force, and return a MAV_RESULT. The mission begins anew then.

    A rover in AUTO keeps its item; a copter stores its hover throttle.
    """
    if not vehicle.armed:
        return ACCEPTED
    if vehicle.flies and not vehicle.landed and not force:
        return FAILED
    vehicle.disarm()
    if vehicle.flies or vehicle.mode.name != "AUTO":
        vehicle.mission.current = 0
    vehicle.send_text(INFO, build_of(vehicle).words[1])
    if vehicle.flies and vehicle.parameters["MOT_HOVER_LEARN"] == LEARN_AND_SAVE:
        vehicle.set_parameter("MOT_THST_HOVER", vehicle.estimate.stored_hover)
    return ACCEPTED


def update_prearm_state(vehicle: AutopilotVehicle) -> None:
    """Evaluate the pre-arm checks; report those that fail every 30 s, and once they have begun to fail."""
    if vehicle.armed:
        vehicle.arming.checks_passed = True
        return
    found, reports = failing_prearm_checks(vehicle), reports_of(vehicle)
    since = vehicle.uptime() - reports.arming_checks_at
    due = since >= DISPLAY_EVERY or (reports.arming_checks_due and since > DISPLAY_PAUSE)
    reports.arming_checks_due |= bool(found) and vehicle.arming.checks_passed
    vehicle.arming.checks_passed = not found
    if due:
        reports.arming_checks_at = vehicle.uptime()
        reports.arming_checks_due = False
        for text in found:
            vehicle.send_text(CRITICAL, f"PreArm: {text}")


CUSTOM_MODE_ENABLED = 1

AUTO, AUTO_RTL = 3, 27
"""Numbers of a copter's modes."""
MISSION_MODES = ("AUTO", "AUTO_RTL")
"""Names of the modes that fly the mission."""

WITHOUT_EFFECT = {
    15: ("AUTOTUNE", ""),
    22: ("FLOWHOLD", ""),
    25: ("SYSTEMID", "No axis selected, SID_AXIS = 0"),
    28: ("TURTLE", ""),
}
"""Modes of a copter that always refuse: name, and the text before the refusal."""

CUSTOM, GUIDED, STABILIZED, MANUAL = 1, 8, 16, 64
"""MAV_MODE_FLAG."""
MANUAL_BITS = CUSTOM | STABILIZED | MANUAL
AUTO_BITS = MANUAL_BITS | GUIDED
"""``base_mode`` of a disarmed copter, as recorded."""
RATE_CONTROL, ATTITUDE_CONTROL, YAW_CONTROL, Z_CONTROL, XY_CONTROL = (
    1 << 10,
    1 << 11,
    1 << 12,
    1 << 13,
    1 << 14,
)
"""MAV_SYS_STATUS_SENSOR."""
LEVEL_AND_HEIGHT = XY_CONTROL | Z_CONTROL


def set_mode(vehicle: AutopilotVehicle, base_mode: int, number: int) -> int:
    """Handle SET_MODE and DO_SET_MODE, and return a MAV_RESULT."""
    if not base_mode & CUSTOM_MODE_ENABLED:
        return DENIED
    return ACCEPTED if change_mode(vehicle, number) else FAILED


def change_mode(vehicle: AutopilotVehicle, number: int) -> bool:
    """Enter a mode if that is possible; otherwise report the reason. Return whether the mode is flown."""
    mode = vehicle.rules.modes.get(number)
    if mode is None and vehicle.flies and number in WITHOUT_EFFECT:
        name, reason = WITHOUT_EFFECT[number]
        if reason:
            vehicle.send_text(WARNING, reason)
        vehicle.send_text(WARNING, f"Mode change to {name} failed: init failed")
        return False
    if mode is None:
        vehicle.send_text(WARNING, f"No such mode {number}")
        return False
    entry = build_of(vehicle).entries.get(number)
    return enter(vehicle, mode) if entry is None else entry(vehicle, mode)


def enter(vehicle: AutopilotVehicle, mode: Mode, problem: str = "") -> bool:
    """Enter a mode unless the vehicle may not; then report the reason. Return whether the mode is flown.

    Args:
        vehicle: The vehicle.
        mode: The mode; if it is flown already, nothing changes.
        problem: Why a feature does not permit the mode, or empty.
    """
    if mode is vehicle.mode:
        return True
    reason = problem or _not_set_up(vehicle, mode) or (refusal(vehicle, mode) if vehicle.armed else "")
    if reason:
        words = (
            f"Mode change to {mode.name} failed: {reason}" if vehicle.flies else "Flight mode change failed"
        )
        vehicle.send_text(WARNING, words)
        return False
    vehicle.enter_mode(mode)
    return True


def _not_set_up(vehicle: AutopilotVehicle, mode: Mode) -> str:
    """Return why a vehicle may not enter a mode, armed or not, or an empty text."""
    if mode.name == "SMART_RTL" and not vehicle.ground.track:
        return "init failed"
    if mode.name == "AUTO" and not vehicle.flies and len(vehicle.mission) <= 1:
        vehicle.send_text(NOTICE, "No Mission. Can't set AUTO.")
        return "init failed"
    return ""


def refusal(vehicle: AutopilotVehicle, mode: Mode) -> str:
    """Return why an armed vehicle may not enter a mode, or an empty text."""
    if mode.needs_position and not vehicle.has_position:
        return "requires position"
    if mode.name == "AUTO" and len(vehicle.mission) <= 1:
        return "init failed"
    if vehicle.flies and vehicle.landed:
        return _refusal_on_ground(vehicle, mode)
    return ""


def _refusal_on_ground(vehicle: AutopilotVehicle, mode: Mode) -> str:
    if mode.name in MISSION_MODES and not _takes_off_first(vehicle):
        vehicle.send_text(CRITICAL, "Auto: Missing Takeoff Cmd")
        return "init failed"
    if mode.manual_throttle and not vehicle.mode.manual_throttle and Stabilize(vehicle).pilot.throttle > 0.5:
        return "throttle too high"
    return ""


def _takes_off_first(vehicle: AutopilotVehicle) -> bool:
    """Return whether the first item that navigates, except for delays, is a take-off."""
    plan = vehicle.mission
    ahead = (item for item in plan.items[max(1, plan.current) :] if item.navigates and item.command != DELAY)
    first = next(ahead, None)
    return first is not None and first.command == TAKEOFF
