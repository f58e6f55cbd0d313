"""ArduPilot's failsafes: ground station, radio, battery, estimator. Parameters set triggers and actions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from volery.base.time import Ns, S, from_seconds
from volery.simulation.autopilots.ardupilot.battery import left_mah, used_mah
from volery.simulation.autopilots.ardupilot.feature import Kept
from volery.simulation.autopilots.ardupilot.modes import AUTO_RTL, change_mode, disarm, received_of
from volery.simulation.autopilots.autopilot import WatchedCondition
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission
from volery.simulation.autopilots.manoeuvres.to_point import DescendAndLand
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import CRITICAL, WARNING

LOST_FOR: Ns = S
"""Ten checks, ten a second (EKF_CHECK_ITERATIONS_MAX)."""
WARNED_EVERY: Ns = 30 * S
LAND_IN_ANY_MODE = 3
"""Value of FS_EKF_ACTION."""
LANDS_AFTER: Ns = 4 * S
"""Time for which LAND by a failsafe holds its height first (LAND_WITH_DELAY_MS)."""
BATTERY_FAILSAFES = frozenset({"battery low", "battery critical"})

CONTINUE_MISSION_ON_RADIO, CONTINUE_MISSION_ON_STATION = 1 << 0, 1 << 1
CONTINUE_GUIDED_ON_RADIO, CONTINUE_LANDING, CONTINUE_PILOT_ON_STATION = 1 << 2, 1 << 3, 1 << 4
"""Bits of FS_OPTIONS."""


@dataclass
class FailsafeConditions:
    """What the conditions of failsafes remember."""

    true_since: dict[str, Ns] = field(default_factory=dict)
    """Since when [ns] a condition has been true that must last before a failsafe acts, by its name."""
    suspended: bool = False
    """Whether the failsafes of station and transmitter do not act: a feature drives the motors itself."""


conditions_of = Kept(FailsafeConditions)


def station_lost(vehicle: AutopilotVehicle) -> bool:
    """Return whether a ground station that was received is silent for longer than FS_GCS_TIMEOUT."""
    if vehicle.parameters["FS_GCS_ENABLE"] == 0.0 or received_of(vehicle).station_at == NEVER:
        return False
    if conditions_of(vehicle).suspended:
        return False
    silence = vehicle.kernel.now() - received_of(vehicle).station_at
    return silence > from_seconds(vehicle.parameters["FS_GCS_TIMEOUT"])


def radio_lost(vehicle: AutopilotVehicle) -> bool:
    """Return whether the throttle channel is below FS_THR_VALUE."""
    if vehicle.parameters["FS_THR_ENABLE"] == 0.0 or conditions_of(vehicle).suspended:
        return False
    return vehicle.rc[vehicle.tuning.sticks.throttle] < vehicle.parameters["FS_THR_VALUE"]


def radio_never_received(vehicle: AutopilotVehicle) -> bool:
    """Return whether FS_THR_ENABLE expects a transmitter and none was received since boot."""
    return vehicle.parameters["FS_THR_ENABLE"] != 0.0 and not received_of(vehicle).transmitter


def radio_too_low(vehicle: AutopilotVehicle) -> bool:
    """Return whether a transmitter that was received is lost now."""
    return received_of(vehicle).transmitter and radio_lost(vehicle)


def _battery_below(vehicle: AutopilotVehicle, volts: str, charge: str) -> bool:
    parameters, estimate = vehicle.parameters, vehicle.estimate
    if vehicle.uptime() < 3 * S:
        return False
    sagged = parameters[volts] > 0.0 and estimate.battery_volts < parameters[volts]
    if not sagged:
        conditions_of(vehicle).true_since.pop(volts, None)
        return parameters[charge] > 0.0 and left_mah(vehicle) < parameters[charge]
    since = conditions_of(vehicle).true_since.setdefault(volts, vehicle.kernel.now())
    return vehicle.kernel.now() - since >= from_seconds(parameters["BATT_LOW_TIMER"])


def battery_low(vehicle: AutopilotVehicle) -> bool:
    """Return whether BATT_LOW_VOLT or BATT_LOW_MAH was crossed; the state does not clear."""
    return "battery low" in vehicle.failsafes.active or _battery_below(
        vehicle, "BATT_LOW_VOLT", "BATT_LOW_MAH"
    )


def battery_critical(vehicle: AutopilotVehicle) -> bool:
    """Return whether BATT_CRT_VOLT or BATT_CRT_MAH was crossed; the state does not clear."""
    return "battery critical" in vehicle.failsafes.active or _battery_below(
        vehicle, "BATT_CRT_VOLT", "BATT_CRT_MAH"
    )


def estimator_lost(vehicle: AutopilotVehicle) -> bool:
    """Return whether the estimator has had a position, and has had none for a second."""
    since, reported = conditions_of(vehicle).true_since, vehicle.reports.sent_once
    if vehicle.parameters["FS_EKF_THRESH"] <= 0.0:
        return False
    has_position = vehicle.has_position
    if has_position:
        reported.add("position")
    if has_position or "position" not in reported:
        since.pop("estimator", None)
        return False
    now = vehicle.kernel.now()
    return now - since.setdefault("estimator", now) >= LOST_FOR


def _report_battery(vehicle: AutopilotVehicle, level: str) -> int:
    """Report a low or critical battery, and return the action of BATT_FS_LOW_ACT or BATT_FS_CRT_ACT."""
    volts, used = vehicle.estimate.battery_volts, used_mah(vehicle)
    vehicle.send_text(WARNING, f"Battery 1 is {level} {volts:.2f}V used {used:.0f} mAh")
    return round(vehicle.parameters["BATT_FS_LOW_ACT" if level == "low" else "BATT_FS_CRT_ACT"])


def _report_cleared(vehicle: AutopilotVehicle, what: str) -> None:
    vehicle.send_text(WARNING, f"{what} Failsafe Cleared")


def _enter_first(vehicle: AutopilotVehicle, modes: tuple[int, ...]) -> None:
    """Enter the first of these modes that is possible."""
    any(_change_mode(vehicle, mode) for mode in modes)


def _change_mode(vehicle: AutopilotVehicle, number: int) -> bool:
    """Enter a mode if that is possible; a landing that begins so waits first. Return whether it is flown."""
    before = vehicle.mode
    if not change_mode(vehicle, number):
        return False
    if vehicle.mode is not before and isinstance(vehicle.manoeuvre, DescendAndLand):
        vehicle.manoeuvre.waits_until = vehicle.kernel.now() + LANDS_AFTER
    return True


# -- copter

RTL, LAND, BRAKE, ALT_HOLD, SMART_RTL = 6, 9, 17, 2, 21
STATION_ACTIONS = {
    3: (SMART_RTL, RTL, LAND),
    4: (SMART_RTL, LAND),
    5: (LAND,),
    6: (AUTO_RTL, RTL, LAND),
    7: (BRAKE, LAND),
}
"""FS_GCS_ENABLE to the modes that are tried in order; all other values: RTL, LAND."""
RADIO_ACTIONS = {
    1: (RTL, LAND),
    2: (RTL, LAND),
    4: (SMART_RTL, RTL, LAND),
    5: (SMART_RTL, LAND),
    6: (AUTO_RTL, RTL, LAND),
    7: (BRAKE, LAND),
}
"""The same for FS_THR_ENABLE; all other values: LAND."""
BATTERY_ACTIONS = {
    1: (LAND,),
    2: (RTL, LAND),
    3: (SMART_RTL, RTL, LAND),
    4: (SMART_RTL, LAND),
    6: (AUTO_RTL, RTL, LAND),
    7: (BRAKE, LAND),
}
"""The same for BATT_FS_LOW_ACT and BATT_FS_CRT_ACT."""
LAND_ACTION, DISARM_ACTION = 1, 5
"""Values of BATT_FS_LOW_ACT and BATT_FS_CRT_ACT; a rover's FS_ACTION 5 disarms, too."""


def _on_station_lost(vehicle: AutopilotVehicle) -> None:
    vehicle.rc.release()
    options = round(vehicle.parameters["FS_OPTIONS"])
    exception = ""
    if options & CONTINUE_MISSION_ON_STATION and vehicle.mode.name == "AUTO":
        exception = "Continuing Auto Mode"
    elif options & CONTINUE_PILOT_ON_STATION and vehicle.mode.pilot:
        exception = "Continuing Pilot Control"
    _respond(
        vehicle,
        "GCS",
        STATION_ACTIONS.get(round(vehicle.parameters["FS_GCS_ENABLE"]), (RTL, LAND)),
        exception,
    )


def _on_radio_lost(vehicle: AutopilotVehicle) -> None:
    options = round(vehicle.parameters["FS_OPTIONS"])
    exception = ""
    if options & CONTINUE_MISSION_ON_RADIO and vehicle.mode.name == "AUTO":
        exception = "Continuing Auto"
    elif options & CONTINUE_GUIDED_ON_RADIO and vehicle.mode.name == "GUIDED":
        exception = "Continuing Guided Mode"
    _respond(
        vehicle, "Radio", RADIO_ACTIONS.get(round(vehicle.parameters["FS_THR_ENABLE"]), (LAND,)), exception
    )


def _on_copter_battery(vehicle: AutopilotVehicle, level: str) -> None:
    action = _report_battery(vehicle, level)
    if action == DISARM_ACTION:
        disarm(vehicle, force=True)
    elif action:
        _respond(vehicle, "Battery", BATTERY_ACTIONS.get(action, ()), "")


def _respond(vehicle: AutopilotVehicle, what: str, modes: tuple[int, ...], exception: str) -> None:
    """Report a failsafe and act.

    Args:
        vehicle: The vehicle.
        what: Name of the failsafe in the status text.
        modes: Modes that are tried in order.
        exception: Status text of the option that changes nothing, or empty.
    """
    manoeuvre = vehicle.manoeuvre
    mission_started = isinstance(manoeuvre, FlyMission) and manoeuvre.started
    if not vehicle.armed:
        vehicle.send_text(WARNING, f"{what} Failsafe")
    elif vehicle.landed and not mission_started:
        vehicle.send_text(WARNING, f"{what} Failsafe - Disarming")
        disarm(vehicle, force=True)
    elif manoeuvre.landing and what != "Battery" and _battery_lands(vehicle):
        vehicle.send_text(WARNING, f"{what} + Battery Failsafe - Continuing Landing")
    elif manoeuvre.landing and round(vehicle.parameters["FS_OPTIONS"]) & CONTINUE_LANDING:
        vehicle.send_text(WARNING, f"{what} Failsafe - Continuing Landing")
    elif exception:
        vehicle.send_text(WARNING, f"{what} Failsafe - {exception}")
    else:
        _enter_first(vehicle, modes)
        vehicle.send_text(WARNING, f"{what} Failsafe")


def _battery_lands(vehicle: AutopilotVehicle) -> bool:
    """Return whether the battery is at a level at which it must land: no other failsafe ends that landing."""
    actions = {"battery low": "BATT_FS_LOW_ACT", "battery critical": "BATT_FS_CRT_ACT"}
    reached = (
        vehicle.parameters[name] for level, name in actions.items() if level in vehicle.failsafes.active
    )
    return any(action in (LAND_ACTION, DISARM_ACTION) for action in reached)


def _on_estimator_lost(vehicle: AutopilotVehicle) -> None:
    """Report it; enter LAND or ALT_HOLD as FS_EKF_ACTION demands, if the vehicle is armed and needs it."""
    now, since = vehicle.kernel.now(), conditions_of(vehicle).true_since
    if now - since.get("estimator warned", NEVER) > WARNED_EVERY:
        since["estimator warned"] = now
        vehicle.send_text(CRITICAL, "EKF variance")
    action = round(vehicle.parameters["FS_EKF_ACTION"])
    if not vehicle.armed or not (vehicle.mode.needs_position or action == LAND_IN_ANY_MODE):
        return
    mode = {1: LAND, 2: ALT_HOLD, LAND_IN_ANY_MODE: LAND}.get(action)
    if mode is not None and _change_mode(vehicle, mode):
        vehicle.send_text(CRITICAL, f"EKF Failsafe: changed to {vehicle.mode.name} Mode")


COPTER_FAILSAFES = (
    WatchedCondition("station", station_lost, _on_station_lost, partial(_report_cleared, what="GCS")),
    WatchedCondition("radio", radio_lost, _on_radio_lost, partial(_report_cleared, what="Radio")),
    WatchedCondition("battery low", battery_low, partial(_on_copter_battery, level="low")),
    WatchedCondition("battery critical", battery_critical, partial(_on_copter_battery, level="critical")),
    WatchedCondition(
        "estimator",
        estimator_lost,
        _on_estimator_lost,
        lambda vehicle: vehicle.send_text(CRITICAL, "EKF Failsafe Cleared"),
    ),
)


# -- rover

ROVER_HOLD, ROVER_RTL, ROVER_SMART_RTL = 4, 11, 12
ROVER_ACTIONS = {
    1: (ROVER_RTL, ROVER_HOLD),
    2: (ROVER_HOLD,),
    3: (ROVER_SMART_RTL, ROVER_RTL, ROVER_HOLD),
    4: (ROVER_SMART_RTL, ROVER_HOLD),
    6: (ROVER_HOLD,),
}
"""FS_ACTION and the battery actions to the modes that are tried in order."""


def _act_on_rover(vehicle: AutopilotVehicle, action: int) -> None:
    if action == DISARM_ACTION:
        disarm(vehicle, force=True)
    else:
        _enter_first(vehicle, ROVER_ACTIONS.get(action, ()))


CONTINUE_MISSION = 2
"""Value of FS_THR_ENABLE that continues in AUTO."""
ACTIVE_IN_HOLD = 1 << 0
"""Bit of FS_OPTIONS."""


def _lost_for_long(vehicle: AutopilotVehicle, name: str, lost: Callable[[AutopilotVehicle], bool]) -> bool:
    """Return whether a link is lost for FS_TIMEOUT in a mode that a failsafe may end."""
    since = conditions_of(vehicle).true_since
    if not lost(vehicle):
        since.pop(name, None)
        return False
    if name in vehicle.failsafes.active:
        return True
    now = vehicle.kernel.now()
    stands = vehicle.mode.name == "HOLD" and not round(vehicle.parameters["FS_OPTIONS"]) & ACTIVE_IN_HOLD
    long = now - since.setdefault(name, now) > from_seconds(vehicle.parameters["FS_TIMEOUT"])
    return long and not stands and vehicle.mode.name != "RTL"


def _on_rover_link_lost(vehicle: AutopilotVehicle) -> None:
    """Act on a lost link.

    The original tells the two links apart by the check that finds the time-out first, and that of the radio
    is made most often: a lost ground station is reported, and continues, as a lost radio.
    """
    vehicle.send_text(WARNING, "Radio Failsafe")
    vehicle.rc.release()
    if vehicle.mode.name == "AUTO" and vehicle.parameters["FS_THR_ENABLE"] == CONTINUE_MISSION:
        vehicle.send_text(WARNING, "Failsafe - Continuing Auto Mode")
    else:
        _act_on_rover(vehicle, round(vehicle.parameters["FS_ACTION"]))


def _on_rover_battery(vehicle: AutopilotVehicle, level: str) -> None:
    _act_on_rover(vehicle, _report_battery(vehicle, level))


ROVER_FAILSAFES = (
    WatchedCondition(
        "station",
        partial(_lost_for_long, name="station", lost=station_lost),
        _on_rover_link_lost,
        partial(_report_cleared, what="GCS"),
    ),
    WatchedCondition(
        "radio",
        partial(_lost_for_long, name="radio", lost=radio_lost),
        _on_rover_link_lost,
        partial(_report_cleared, what="Radio"),
    ),
    WatchedCondition("battery low", battery_low, partial(_on_rover_battery, level="low")),
    WatchedCondition("battery critical", battery_critical, partial(_on_rover_battery, level="critical")),
)
