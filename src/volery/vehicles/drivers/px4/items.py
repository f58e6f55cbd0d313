"""Missions as PX4 wants them: no item for home; what has no place is in MAVLink's mission frame.

As recorded of PX4 1.14, which refuses commands without a place in a global frame, and flies to latitude and
longitude 0 of an item that does not state them.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import nan

from volery.base.position import AboveHome, Position
from volery.links.mavlink import constant
from volery.vehicles.drivers.mavlink.commands import Item
from volery.vehicles.drivers.mavlink.items import item
from volery.vehicles.drivers.mavlink.vocabulary import GROUND_SPEED, UNCHANGED
from volery.vehicles.mission import ChangeSpeed, Land, MissionItem, ReturnHome, TakeOff, Waypoint

NO_PLACE = constant("MAV_FRAME_MISSION")
WITHIN_M = 2.0
"""A waypoint counts as reached so near; PX4's own NAV_ACC_RAD is the same."""


def items_of(mission: Sequence[MissionItem], here: Position) -> list[Item]:
    """The items on the wire for a mission that begins at *here*."""
    items: list[Item] = []
    at = here
    for one in mission:
        items.append(_translated(one, at))
        at = getattr(one, "position", None) or at
    return items


def _translated(one: MissionItem, at: Position) -> Item:
    if isinstance(one, TakeOff):
        up = Position(at.latitude, at.longitude, AboveHome(one.height))
        return item("MAV_CMD_NAV_TAKEOFF", 0.0, 0.0, 0.0, nan, at=up)
    if isinstance(one, ChangeSpeed):
        return item("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, one.speed, UNCHANGED, frame=NO_PLACE)
    if isinstance(one, ReturnHome):
        return item("MAV_CMD_NAV_RETURN_TO_LAUNCH", frame=NO_PLACE)
    if isinstance(one, Land):
        down = one.position or Position(at.latitude, at.longitude, AboveHome(0.0))
        return item("MAV_CMD_NAV_LAND", 0.0, 0.0, 0.0, nan, at=down)
    return _waypoint(one)


def _waypoint(one: Waypoint) -> Item:
    return item("MAV_CMD_NAV_WAYPOINT", one.stay_s, WITHIN_M, 0.0, one.heading, at=one.position)
