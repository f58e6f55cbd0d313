"""Missions as ArduPilot wants them: item 0 is home, which it fills in itself."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan

from volery.vehicles.drivers.mavlink.commands import Item
from volery.vehicles.drivers.mavlink.items import item
from volery.vehicles.drivers.mavlink.vocabulary import GROUND_SPEED, UNCHANGED
from volery.vehicles.mission import ChangeSpeed, Land, MissionItem, ReturnHome, TakeOff, Waypoint


def items_of(mission: Sequence[MissionItem]) -> list[Item]:
    """The items on the wire, home first."""
    items = [item("MAV_CMD_NAV_WAYPOINT")]
    for one in mission:
        items += _translated(one)
    return items


def _translated(one: MissionItem) -> list[Item]:
    if isinstance(one, TakeOff):
        return [item("MAV_CMD_NAV_TAKEOFF", z=one.height)]
    if isinstance(one, ChangeSpeed):
        return [item("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, one.speed, UNCHANGED)]
    if isinstance(one, ReturnHome):
        return [item("MAV_CMD_NAV_RETURN_TO_LAUNCH")]
    if isinstance(one, Land):
        return [item("MAV_CMD_NAV_LAND", at=one.position)]
    return _waypoint(one)


def _waypoint(one: Waypoint) -> list[Item]:
    point = item("MAV_CMD_NAV_WAYPOINT", one.stay_s, at=one.position)
    if isnan(one.heading):
        return [point]
    return [item("MAV_CMD_CONDITION_YAW", one.heading), point]
