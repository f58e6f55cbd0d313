"""ArduPilot's missions: which items are accepted, how they are read back, and what is reported in flight."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import dist, isinf, isnan

from volery.base.time import from_seconds, to_seconds
from volery.simulation.autopilots.ardupilot.commands import (
    HIGHEST,
    SET_REVERSE,
    change_speed,
    turn_to,
)
from volery.simulation.autopilots.ardupilot.feature import Kept, MissionCommand, build_of
from volery.simulation.autopilots.ardupilot.modes import MISSION_MODES, change_mode, disarm
from volery.simulation.autopilots.manoeuvres.manual_flight import RoverHold
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import (
    FlyMission,
    Leg,
    MissionRules,
    copter_leg,
)
from volery.simulation.autopilots.manoeuvres.rover_driving import Stand
from volery.simulation.autopilots.manoeuvres.to_point import ToPoint, quarter_time
from volery.simulation.autopilots.mavlink.messages import EPOCH_US, finite
from volery.simulation.autopilots.onboard_mission import (
    CHANGE_SPEED,
    CONDITION_DELAY,
    CONDITION_DISTANCE,
    CONDITION_YAW,
    DELAY,
    GLOBAL,
    GLOBAL_INT,
    GLOBAL_RELATIVE,
    GLOBAL_RELATIVE_INT,
    GLOBAL_TERRAIN,
    GLOBAL_TERRAIN_INT,
    JUMP,
    JUMP_TAG,
    LAND,
    LAND_START,
    LOITER_TIME,
    LOITER_TO_ALTITUDE,
    LOITER_TURNS,
    LOITER_UNLIMITED,
    MISSION_FRAME,
    RETURN,
    SET_HOME,
    SET_YAW_SPEED,
    SPLINE_WAYPOINT,
    TAKEOFF,
    WAYPOINT,
    MissionItem,
)
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, FlightManoeuvre
from volery.trace.events import INFO, NOTICE

UNSUPPORTED_FRAME, UNSUPPORTED, INVALID_PARAM1, INVALID_X, INVALID_Y, INVALID_Z = 2, 3, 6, 10, 11, 12
"""MAV_MISSION_RESULT."""

STORED_FRAMES = {
    GLOBAL: GLOBAL,
    GLOBAL_INT: GLOBAL,
    GLOBAL_RELATIVE: GLOBAL_RELATIVE,
    GLOBAL_RELATIVE_INT: GLOBAL_RELATIVE,
    GLOBAL_TERRAIN: GLOBAL_TERRAIN,
    GLOBAL_TERRAIN_INT: GLOBAL_TERRAIN,
}
"""The frame that is read back for the frame that was sent."""


def stored_item(item: MissionItem, items: Mapping[int, MissionCommand]) -> MissionItem | int:
    """Return an item as stored (frames without their INT variants, NaN as 0), or the MAV_MISSION_RESULT.

    Args:
        item: The item.
        items: Items that the firmware knows.
    """
    known = items.get(item.command)
    if known is None:
        return UNSUPPORTED
    if item.frame not in STORED_FRAMES and item.frame != MISSION_FRAME:
        return UNSUPPORTED_FRAME
    wrong = _wrong_parameter(item) or (_wrong_place(item) if known.placed else 0)
    if wrong:
        return wrong
    frame = STORED_FRAMES.get(item.frame, GLOBAL) if known.placed or known.keeps_frame else GLOBAL
    return item._replace(
        frame=frame,
        param1=finite(item.param1),
        param2=finite(item.param2),
        param3=finite(item.param3),
        param4=finite(item.param4),
        z=finite(item.z),
    )


def _wrong_parameter(item: MissionItem) -> int:
    """Return the result that names the first parameter that is not finite, or 0.

    The heading (param4) of WAYPOINT, LAND and TAKEOFF may be NaN.
    """
    for place, value in enumerate((item.param1, item.param2, item.param3, item.param4)):
        may_be_none = place == 3 and item.command in (WAYPOINT, LAND, TAKEOFF)
        if isinf(value) or (isnan(value) and not may_be_none):
            return INVALID_PARAM1 + place
    return 0


def _wrong_place(item: MissionItem) -> int:
    if abs(item.x) > 900_000_000:
        return INVALID_X
    if abs(item.y) > 1_800_000_000:
        return INVALID_Y
    return 0 if abs(item.z) < HIGHEST else INVALID_Z  # a NaN is not less


def home_item(vehicle: AutopilotVehicle) -> MissionItem | None:
    """Return item 0, the home position."""
    home = vehicle.home
    if home is None:
        return None
    return MissionItem(
        WAYPOINT, GLOBAL, x=round(home.latitude * 1e7), y=round(home.longitude * 1e7), z=home.amsl
    )


def mission_grew(vehicle: AutopilotVehicle, count: int) -> None:
    """Store the number of items in MIS_TOTAL."""
    vehicle.set_parameter("MIS_TOTAL", count)


@dataclass
class ReachedItem:
    """What of a mission has been reported."""

    number: int | None = None
    """Number of an action that was reported instead of the waypoint before it."""


reached_of = Kept(ReachedItem)


def item_begins(vehicle: AutopilotVehicle, index: int, item: MissionItem) -> None:
    """Report the item that begins."""
    known = build_of(vehicle).items.get(item.command)
    vehicle.send_text(INFO, f"Mission: {index} {known.name if known else 'Unknown'}")


def _is_reported(vehicle: AutopilotVehicle, item: MissionItem) -> bool:
    """Return whether the end of an action is reported by its number."""
    known = build_of(vehicle).items.get(item.command)
    return known is None or not known.silent


def item_done(vehicle: AutopilotVehicle, index: int, item: MissionItem) -> None:
    """Send MISSION_ITEM_REACHED, and a status text for items that reach a place or wait.

    The first action after the item is done in the same step of the original, which keeps one number to be
    sent: the action's replaces the item's.
    """
    plan, following = vehicle.mission, index + 1
    action = plan[following] if following < len(plan) else None
    at_once = action is not None and not (action.navigates or action.is_condition or action.command == JUMP)
    replaced = action is not None and at_once and _is_reported(vehicle, action)
    reached_of(vehicle).number = following if replaced else None
    vehicle.output.send_event("MISSION_ITEM_REACHED", {"seq": following if replaced else index})
    if item.command in (WAYPOINT, SPLINE_WAYPOINT, LOITER_TIME, LOITER_TURNS, LOITER_TO_ALTITUDE, DELAY):
        words = "command" if vehicle.flies else "waypoint"
        vehicle.send_text(INFO, f"Reached {words} #{index}")


def action_done(vehicle: AutopilotVehicle, index: int, item: MissionItem) -> None:
    """Report an action by its number, unless that has been sent instead of the item before it."""
    if reached_of(vehicle).number == index:
        reached_of(vehicle).number = None
    elif _is_reported(vehicle, item):
        vehicle.output.send_event("MISSION_ITEM_REACHED", {"seq": index})


def jumped(vehicle: AutopilotVehicle, index: int, times: int, of: int) -> None:
    """Report a jump."""
    vehicle.send_text(INFO, f"Mission: {index} Jump {times}/{of if of >= 0 else 'unlimited'}")


def _change_speed(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    if change_speed(vehicle, round(item.param1), item.param2) and not vehicle.flies:
        vehicle.send_text(INFO, f"speed: {item.param2:.1f} m/s")


def _turn(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    turn_to(vehicle, item.param1, item.param2, item.param3, relative=item.param4 == 1.0)


def _set_home(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    if item.param1 == 1.0 or not item.has_place:
        vehicle.set_home_here()
    else:
        vehicle.set_home(item.x / 1e7, item.y / 1e7, item.z)


def _reverse(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    vehicle.commanded.backwards = item.param1 == 1.0


ITEMS: Mapping[int, MissionCommand] = {
    WAYPOINT: MissionCommand("WP", placed=True),
    SPLINE_WAYPOINT: MissionCommand("SplineWP", placed=True),
    LOITER_UNLIMITED: MissionCommand("LoitUnlim", placed=True),
    LOITER_TURNS: MissionCommand("LoitTurns", placed=True),
    LOITER_TIME: MissionCommand("LoitTime", placed=True),
    LOITER_TO_ALTITUDE: MissionCommand("LoitAltitude", placed=True),
    RETURN: MissionCommand("RTL"),
    LAND: MissionCommand("Land", placed=True),
    TAKEOFF: MissionCommand("Takeoff", placed=True),
    DELAY: MissionCommand("Delay"),
    SET_YAW_SPEED: MissionCommand("SetYawSpd"),
    CONDITION_DELAY: MissionCommand("CondDelay"),
    CONDITION_DISTANCE: MissionCommand("CondDist"),
    CONDITION_YAW: MissionCommand("CondYaw", _turn),
    CHANGE_SPEED: MissionCommand("ChangeSpeed", _change_speed),
    SET_HOME: MissionCommand("SetHome", _set_home, placed=True),
    JUMP: MissionCommand("Jump"),
    SET_REVERSE: MissionCommand("SetReverse", _reverse),
    JUMP_TAG: MissionCommand("Tag", silent=True),
    LAND_START: MissionCommand("LandStart", keeps_frame=True),
}
"""Items of the core."""


def act(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    """Execute an item that does not navigate; one without an action only marks a place."""
    known = build_of(vehicle).items.get(item.command)
    if known is not None and known.act is not None:
        known.act(vehicle, item)


DAY_S = 86_400
LEAST_JERK = 0.1
"""Lower limit of WPNAV_JERK [m/s^3]."""
UNSTATED = -1.0
"""Hour, minute or second of NAV_DELAY that is not stated."""


def leg_of_feature(vehicle: AutopilotVehicle, item: MissionItem) -> Leg | None:
    """Return the leg of an item of a feature; ``None``: it is one of the core."""
    known = build_of(vehicle).items.get(item.command)
    return known.leg(vehicle, item) if known is not None and known.leg is not None else None


def leg_of_copter(vehicle: AutopilotVehicle, item: MissionItem, goes_on: bool) -> Leg:
    """Return the leg of an item. A delay without a duration lasts until a time of day."""
    stated = leg_of_feature(vehicle, item)
    if stated is not None:
        return stated
    if item.command == DELAY:
        if item.param1 <= 0.0:
            item = item._replace(param1=_seconds_until(vehicle, item))
        vehicle.send_text(INFO, f"Delaying {int(item.param1)} sec")
    leg = copter_leg(vehicle, item, goes_on)
    going = leg.manoeuvre
    if item.command in (WAYPOINT, SPLINE_WAYPOINT) and isinstance(going, ToPoint) and going.point is not None:
        length = dist(vehicle.estimate.position, going.point)
        return leg if length > vehicle.tuning.waypoint_radius else _not_before(leg, vehicle, length)
    return leg


def path_jerk(vehicle: AutopilotVehicle) -> float:
    """Return the jerk of ways between waypoints [m/s^3]."""
    return max(LEAST_JERK, vehicle.parameters["WPNAV_JERK"])


def _not_before(leg: Leg, vehicle: AutopilotVehicle, length: float) -> Leg:
    """Return a leg that takes at least the time for its *length* [m] from rest to rest within WPNAV_JERK.

    A waypoint within the waypoint radius takes a moment, too, as ArduCopter's path of limited jerk does.
    """
    earliest = vehicle.kernel.now() + from_seconds(4.0 * quarter_time(length, path_jerk(vehicle)))
    done = leg.done
    return replace(leg, done=lambda: vehicle.kernel.now() >= earliest and done())


def _seconds_until(vehicle: AutopilotVehicle, item: MissionItem) -> float:
    """Return the time [s] until hour, minute and second of UTC, the first of them that is not -1 onwards.

    The time of day comes next: on the next day, in the next hour or in the next minute, if it has passed.
    """
    now = (EPOCH_US / 1e6 + to_seconds(vehicle.kernel.now())) % DAY_S
    for place, period in ((item.param2, DAY_S), (item.param3, 3600), (item.param4, 60)):
        if place != UNSTATED:
            of_day = 3600.0 * item.param2 + 60.0 * item.param3 + item.param4
            return (of_day - now) % period
    return 0.0


def leaves_ground(vehicle: AutopilotVehicle) -> bool:
    """Return whether AUTO takes off without MISSION_START: raised throttle or bit 1 of AUTO_OPTIONS."""
    raised = vehicle.tuning.sticks.read(vehicle.rc).throttle > 0.0
    return raised or bool(round(vehicle.parameters["AUTO_OPTIONS"]) & 2)


def runs(vehicle: AutopilotVehicle) -> bool:
    """Return whether the mission is being flown."""
    plan = vehicle.mission
    return vehicle.armed and vehicle.mode.name in MISSION_MODES and plan.current > 0 and not plan.complete


def copter_ended(vehicle: AutopilotVehicle) -> FlightManoeuvre | None:
    """Disarm on the ground; hold the position in the air."""
    if vehicle.landed and vehicle.armed:
        disarm(vehicle, force=True)
    return ToPoint(vehicle) if vehicle.armed else None


DONE_LOITER = 1
DONE_MODES = {2: 1, 3: 0}
"""MIS_DONE_BEHAVE to the number of the mode that is entered: ACRO, MANUAL."""


def _leave(vehicle: AutopilotVehicle, mode: int) -> None:
    change_mode(vehicle, mode)


def rover_ended(vehicle: AutopilotVehicle) -> FlightManoeuvre | None:
    """Report the end, and stop, loiter or change the mode as MIS_DONE_BEHAVE demands."""
    vehicle.send_text(NOTICE, "Mission Complete")
    after = round(vehicle.parameters["MIS_DONE_BEHAVE"])
    if after in DONE_MODES:
        vehicle.kernel.call_at(vehicle.kernel.now(), lambda: _leave(vehicle, DONE_MODES[after]))
    return RoverHold(vehicle) if after == DONE_LOITER else Stand(vehicle)


def _rules(ended: Callable[[AutopilotVehicle], FlightManoeuvre | None]) -> MissionRules:
    return MissionRules(
        restarts=True,
        item_begins=item_begins,
        item_done=item_done,
        act=act,
        action_begins=item_begins,
        action_done=action_done,
        jumped=jumped,
        ended=ended,
    )


COPTER_MISSION = _rules(copter_ended)
ROVER_MISSION = _rules(rover_ended)


def fly_mission(vehicle: AutopilotVehicle) -> FlyMission:
    """Return the manoeuvre of the modes of a copter that fly the mission."""
    return FlyMission(vehicle, leg_of_copter, COPTER_MISSION, leaves_ground)
