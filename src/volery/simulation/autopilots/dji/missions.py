"""Waypoint missions: what is taken, and how it lies on board as items of the flight stack."""

from __future__ import annotations

from math import isfinite
from typing import Any

from volery.ros.messages.dji_constants import MISSION_SPEEDS
from volery.simulation.autopilots.onboard_mission import GLOBAL_RELATIVE, WAYPOINT, MissionItem

FEWEST, MOST = 2, 99
"""Waypoints of a mission: assumed."""
STAY = 0
"""A waypoint's action: stay for so many milliseconds. The number is assumed."""
NO_ACTION, GO_HOME, LAND, TO_FIRST, NO_EXIT = range(5)
"""What is done at the end of a mission."""
YAW_LOCKED, YAW_BY_WAYPOINT = 1, 3
STOPS_S = 0.1
"""Flown from point to point it stands at each of them; coordinated it does not."""


def refusal(task: Any) -> str:
    """Why a mission is not taken; empty if it is."""
    points = task.mission_waypoint
    low, high = MISSION_SPEEDS
    if not FEWEST <= len(points) <= MOST:
        return f"{len(points)} waypoints; {FEWEST} to {MOST}"
    if not (low <= task.velocity_range <= high and low <= task.idle_velocity <= task.velocity_range):
        return f"speeds {task.idle_velocity:g} and {task.velocity_range:g} m/s; {low:g} to {high:g}"
    for number, point in enumerate(points, start=1):
        place = (point.latitude, point.longitude, point.altitude)
        if not all(isfinite(value) for value in place) or abs(place[0]) > 90.0 or abs(place[1]) > 180.0:
            return f"waypoint {number} is nowhere"
    return ""


def items_of(task: Any) -> list[MissionItem]:
    """The items of a mission that is taken."""
    once = [_item(point, coordinated=task.trace_mode == 1) for point in task.mission_waypoint]
    items = once * max(1, min(2, task.mission_exec_times))
    return [*items, items[0]] if task.action_on_finish == TO_FIRST else items


def _item(point: Any, coordinated: bool) -> MissionItem:
    stay = _stay(point)
    return MissionItem(
        WAYPOINT,
        GLOBAL_RELATIVE,
        param1=stay or (0.0 if coordinated else STOPS_S),
        x=round(point.latitude * 1e7),
        y=round(point.longitude * 1e7),
        z=point.altitude,
    )


def _stay(point: Any) -> float:
    """Seconds that its actions have it stay."""
    action = point.waypoint_action
    count = action.action_repeat & 0x0F if point.has_action else 0
    listed = zip(action.command_list[:count], action.command_parameter[:count], strict=True)
    return sum(int(milliseconds) for command, milliseconds in listed if command == STAY) / 1000.0
