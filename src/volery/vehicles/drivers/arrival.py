"""When a vehicle counts as having arrived: near its goal, and nearly standing."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, inf, isnan

from volery.base.frames import LocalFrame
from volery.base.position import AboveHome, Position
from volery.vehicles.telemetry import Telemetry

DRONE_KIND, ROVER_KIND = "drone", "rover"
"""What ``Telemetry.kind`` says."""

NEAR_M, NEAR_UP_M = 0.6, 0.3
"""A drone, horizontally and vertically."""
STANDING_M_S = 0.5
ROVER_NEAR_M = 2.5
"""Rovers stop within their waypoint radius of a goal: 2 m in ArduRover (WP_RADIUS) and PX4 (NAV_ACC_RAD)."""
ROVER_STANDING_M_S = 0.3


def standing(seen: Telemetry) -> bool:
    """It hardly moves any more."""
    limit = STANDING_M_S if seen.kind == DRONE_KIND else ROVER_STANDING_M_S
    return hypot(seen.velocity.north, seen.velocity.east) <= limit and not abs(seen.velocity.up) > limit


def at(goal: Position, rover: bool) -> Callable[[Telemetry], bool]:
    """Near *goal* and nearly standing."""
    frame = LocalFrame(goal.latitude, goal.longitude, 0.0)
    near = ROVER_NEAR_M if rover else NEAR_M

    def arrived(seen: Telemetry) -> bool:
        if seen.position is None or not standing(seen):
            return False
        east, north, _ = frame.to_enu(seen.position.latitude, seen.position.longitude, 0.0)
        return hypot(east, north) <= near and (rover or _up_off(seen, goal) <= NEAR_UP_M)

    return arrived


def _up_off(seen: Telemetry, goal: Position) -> float:
    """Metres above or below the goal; 0 for kinds of altitude that telemetry does not tell."""
    if seen.position is None or isnan(seen.above_home):
        return 0.0
    if isinstance(goal.altitude, AboveHome):
        return abs(seen.above_home - goal.altitude.metres)
    return abs(seen.position.altitude.metres - goal.altitude.metres)


def distance(here: Position | None, there: Position) -> float:
    """Horizontal metres; infinite from nowhere."""
    if here is None:
        return inf
    east, north, _ = LocalFrame(there.latitude, there.longitude, 0.0).to_enu(
        here.latitude, here.longitude, 0.0
    )
    return hypot(east, north)


def risen(height: float) -> Callable[[Telemetry], bool]:
    """In the air, *height* metres above home, and no longer going up or down."""

    def up(seen: Telemetry) -> bool:
        near = abs(seen.above_home - height) <= NEAR_UP_M
        return seen.flying and near and abs(seen.velocity.up) <= STANDING_M_S

    return up
