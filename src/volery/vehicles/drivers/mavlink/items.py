"""Missions as items of MAVLink's mission protocol."""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.errors import UsageError
from volery.base.position import AMSL, AboveGround, AboveHome, Position
from volery.links.mavlink import constant
from volery.vehicles.drivers.mavlink.commands import Item

GLOBAL = constant("MAV_FRAME_GLOBAL")
ABOVE_HOME = constant("MAV_FRAME_GLOBAL_RELATIVE_ALT")
ABOVE_GROUND = constant("MAV_FRAME_GLOBAL_TERRAIN_ALT")

INT_FRAMES: Mapping[int, int] = {
    GLOBAL: constant("MAV_FRAME_GLOBAL_INT"),
    ABOVE_HOME: constant("MAV_FRAME_GLOBAL_RELATIVE_ALT_INT"),
    ABOVE_GROUND: constant("MAV_FRAME_GLOBAL_TERRAIN_ALT_INT"),
}
"""Of a global frame in degrees, the one whose latitude and longitude are whole numbers."""


def frame_of(position: Position) -> int:
    """The MAV_FRAME of a global position, in degrees."""
    if isinstance(position.altitude, AMSL):
        return GLOBAL
    if isinstance(position.altitude, AboveHome):
        return ABOVE_HOME
    if isinstance(position.altitude, AboveGround):
        return ABOVE_GROUND
    raise UsageError(f"{position}: autopilots take AMSL, AboveHome and AboveGround")


def item(
    command: str, *parameters: float, at: Position | None = None, z: float = 0.0, frame: int = ABOVE_HOME
) -> Item:
    """An item; *at* states place, altitude and frame at once."""
    first, second, third, fourth = (*parameters, 0.0, 0.0, 0.0, 0.0)[:4]
    stated = (first, second, third, fourth)
    if at is None:
        return Item(constant(command), frame, stated, 0.0, 0.0, z)
    height = at.altitude.metres
    return Item(constant(command), frame_of(at), stated, at.latitude, at.longitude, height)
