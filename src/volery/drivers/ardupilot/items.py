"""Missions as ArduPilot wants them: item 0 is home, which it fills in itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isnan

from volery.base.errors import UsageError
from volery.base.position import AMSL, AboveGround, AboveHome, Position
from volery.drivers.ardupilot.commands import Item
from volery.links.mavlink import constant
from volery.vehicles.mission import ChangeSpeed, Land, MissionItem, ReturnHome, TakeOff, Waypoint

GROUND_SPEED = 1.0
UNCHANGED_THROTTLE = -1.0


INT_FRAMES: Mapping[int, int] = {
    constant("MAV_FRAME_GLOBAL"): constant("MAV_FRAME_GLOBAL_INT"),
    constant("MAV_FRAME_GLOBAL_RELATIVE_ALT"): constant("MAV_FRAME_GLOBAL_RELATIVE_ALT_INT"),
    constant("MAV_FRAME_GLOBAL_TERRAIN_ALT"): constant("MAV_FRAME_GLOBAL_TERRAIN_ALT_INT"),
}
"""Of a global frame in degrees, the one whose latitude and longitude are whole numbers."""


def frame_of(position: Position) -> int:
    """The MAV_FRAME of a global position, in the form that all of ArduPilot's messages take."""
    if isinstance(position.altitude, AMSL):
        return constant("MAV_FRAME_GLOBAL")
    if isinstance(position.altitude, AboveHome):
        return constant("MAV_FRAME_GLOBAL_RELATIVE_ALT")
    if isinstance(position.altitude, AboveGround):
        return constant("MAV_FRAME_GLOBAL_TERRAIN_ALT")
    raise UsageError(f"{position}: ArduPilot takes AMSL, AboveHome and AboveGround")


def items_of(mission: Sequence[MissionItem]) -> list[Item]:
    """The items on the wire, home first."""
    items = [_item("MAV_CMD_NAV_WAYPOINT")]
    for item in mission:
        items += _translated(item)
    return items


def _item(command: str, *parameters: float, at: Position | None = None, z: float = 0.0) -> Item:
    first, second, third, fourth = (*parameters, 0.0, 0.0, 0.0, 0.0)[:4]
    stated = (first, second, third, fourth)
    if at is None:
        return Item(constant(command), constant("MAV_FRAME_GLOBAL_RELATIVE_ALT"), stated, 0.0, 0.0, z)
    height = at.altitude.metres
    return Item(constant(command), frame_of(at), stated, at.latitude, at.longitude, height)


def _translated(item: MissionItem) -> list[Item]:
    if isinstance(item, TakeOff):
        return [_item("MAV_CMD_NAV_TAKEOFF", z=item.height)]
    if isinstance(item, ChangeSpeed):
        speed = (GROUND_SPEED, item.speed, UNCHANGED_THROTTLE)
        return [_item("MAV_CMD_DO_CHANGE_SPEED", *speed)]
    if isinstance(item, ReturnHome):
        return [_item("MAV_CMD_NAV_RETURN_TO_LAUNCH")]
    if isinstance(item, Land):
        return [_item("MAV_CMD_NAV_LAND", at=item.position)]
    return _waypoint(item)


def _waypoint(item: Waypoint) -> list[Item]:
    point = _item("MAV_CMD_NAV_WAYPOINT", item.stay_s, at=item.position)
    if isnan(item.heading):
        return [point]
    return [_item("MAV_CMD_CONDITION_YAW", item.heading), point]
