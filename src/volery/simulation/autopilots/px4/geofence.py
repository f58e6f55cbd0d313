"""PX4's geofence: distance and height from home, and uploaded polygons and circles; rally points are stored.

What a breach does stands in ``failsafes``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import dist

from volery.base.frames import Vector
from volery.simulation.autopilots.mavlink.microservices import FENCE, MISSION_UNSUPPORTED, RALLY
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

POLYGON_INSIDE, POLYGON_OUTSIDE, CIRCLE_INSIDE, CIRCLE_OUTSIDE, RALLY_POINT = 5001, 5002, 5003, 5004, 5100
"""MAV_CMD of fence and rally points; the vehicle must stay inside or outside."""

BREACHED, TOO_FAR, TOO_HIGH = "fence", "distance", "height"
"""Limits that a point may be beyond."""


def fence_breach(vehicle: AutopilotVehicle, point: Vector) -> str:
    """Return which limit of the geofence a point is beyond, or an empty text.

    Args:
        vehicle: The vehicle; without a home position nothing is outside.
        point: North, east, down about the estimator's origin [m].
    """
    farthest, highest = vehicle.parameters["GF_MAX_HOR_DIST"], vehicle.parameters["GF_MAX_VER_DIST"]
    if vehicle.home is None:
        return ""
    if farthest > 0.0 and dist(point[:2], vehicle.home.ned[:2]) > farthest:
        return TOO_FAR
    if highest > 0.0 and vehicle.home.ned[2] - point[2] > highest:
        return TOO_HIGH
    return "" if _within_points(vehicle, point) else BREACHED


def stored_fence_point(kind: int, item: MissionItem) -> MissionItem | int:
    """Return a point of the fence or a rally point as sent, or the MAV_MISSION_RESULT that refuses it."""
    known = {FENCE: range(POLYGON_INSIDE, CIRCLE_OUTSIDE + 1), RALLY: (RALLY_POINT,)}
    return item if item.command in known.get(kind, ()) else MISSION_UNSUPPORTED


def _within_points(vehicle: AutopilotVehicle, point: Vector) -> bool:
    """Return whether a point is in one area of the uploaded fence to stay in, and in none to avoid."""
    if not vehicle.points.get(FENCE):
        return True
    kept_in: list[bool] = []
    for command, corners, radius in _areas(vehicle):
        if command in (CIRCLE_INSIDE, CIRCLE_OUTSIDE):
            inside = dist(point[:2], corners[0][:2]) <= radius
        else:
            inside = _in_polygon(point, corners)
        if command in (POLYGON_INSIDE, CIRCLE_INSIDE):
            kept_in.append(inside)
        elif inside:
            return False
    return any(kept_in) or not kept_in


def _areas(vehicle: AutopilotVehicle) -> Iterator[tuple[int, Sequence[Vector], float]]:
    """Yield command, corners or centre, and radius [m] of each area; corners follow each other."""
    items = vehicle.points.get(FENCE, [])
    place = 0
    while place < len(items):
        item = items[place]
        circle = item.command in (CIRCLE_INSIDE, CIRCLE_OUTSIDE)
        count = 1 if circle else max(1, round(item.param1))
        corners = [
            vehicle.point(item.frame, item.x / 1e7, item.y / 1e7, item.z)
            for item in items[place : place + count]
        ]
        yield item.command, corners, item.param1
        place += count


def _in_polygon(point: Vector, corners: Sequence[Vector]) -> bool:
    """Return whether a point is in a polygon, by the number of edges north of it."""
    inside = False
    for (north, east, _), (to_north, to_east, _) in pairwise((*corners, corners[0])):
        if (east > point[1]) != (to_east > point[1]):
            crossing = north + (point[1] - east) / (to_east - east) * (to_north - north)
            inside ^= point[0] < crossing
    return inside
