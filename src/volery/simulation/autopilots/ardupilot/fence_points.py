"""Points of ArduPilot's fence and rally points: what an upload accepts, and the deprecated FENCE_POINT.

By FENCE_POINT a station transfers one inclusion polygon: point 0 is the return point, the last point closes
the polygon, and FENCE_TOTAL states the number of both and the corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from volery.simulation.autopilots.ardupilot.feature import Kept
from volery.simulation.autopilots.mavlink.channel import Peer
from volery.simulation.autopilots.mavlink.messages import finite
from volery.simulation.autopilots.onboard_mission import (
    GLOBAL,
    GLOBAL_INT,
    GLOBAL_RELATIVE,
    GLOBAL_RELATIVE_INT,
    MissionItem,
)
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import INFO, WARNING

FENCE, RALLY = 1, 2
"""MAV_MISSION_TYPE."""

RETURN_POINT, INCLUSION, EXCLUSION, CIRCLE_INCLUSION, CIRCLE_EXCLUSION = 5000, 5001, 5002, 5003, 5004
RALLY_POINT = 5100

UNSUPPORTED_FRAME, UNSUPPORTED, INVALID_PARAM1 = 2, 3, 6
"""MAV_MISSION_RESULT."""

STORED = {GLOBAL: GLOBAL, GLOBAL_INT: GLOBAL, GLOBAL_RELATIVE: 3, GLOBAL_RELATIVE_INT: 3}

TYPES = {
    CIRCLE_INCLUSION: 92,
    CIRCLE_EXCLUSION: 93,
    RETURN_POINT: 95,
    EXCLUSION: 97,
    INCLUSION: 98,
}
"""Numbers of the items in the firmware's status texts."""
LEAST_CORNERS, LEAST_TOTAL = 3, 5


@dataclass
class Stated:
    """FENCE_TOTAL as it was stated last."""

    total: int = 0


stated_of = Kept(Stated)


def stored_fence_point(kind: int, item: MissionItem) -> MissionItem | int:
    """Return a point of the fence or a rally point as stored, or the MAV_MISSION_RESULT that refuses it."""
    known = (RALLY_POINT,) if kind == RALLY else range(RETURN_POINT, CIRCLE_EXCLUSION + 1)
    if item.command not in known:
        return UNSUPPORTED
    if item.frame not in STORED:
        return UNSUPPORTED_FRAME
    first = finite(item.param1)
    if item.command in (INCLUSION, EXCLUSION) and not LEAST_CORNERS <= first <= 255.0:
        return INVALID_PARAM1
    return item._replace(
        frame=STORED[item.frame], param1=first, param2=0.0, param3=0.0, param4=0.0, z=finite(item.z)
    )


def refuse_points(vehicle: AutopilotVehicle, kind: int, points: list[MissionItem]) -> bool:
    """Report why a list cannot be a fence; return whether it is refused."""
    problem = _problem(points) if kind == FENCE else ""
    if problem:
        vehicle.send_text(INFO if problem == "Incorrect item count" else WARNING, problem)
    return bool(problem)


def _problem(points: list[MissionItem]) -> str:
    """Return what forbids a list as a fence: corners that are not in succession, or two return points."""
    first: MissionItem | None = None
    corners_left, returns = 0, 0
    for point in points:
        corner = point.command in (INCLUSION, EXCLUSION)
        if first is not None and corners_left and point.command != first.command:
            words = "vertex type" if corner else "type"
            return f"Received incorrect {words} (want={TYPES[first.command]} got={TYPES[point.command]})"
        if corner and corners_left and first is not None and point.param1 != first.param1:
            return f"Unexpected vertex count want={first.param1:.0f} got={point.param1:.0f}"
        if corner:
            first, corners_left = (first, corners_left) if corners_left else (point, round(point.param1))
            corners_left -= 1
        elif point.command == RETURN_POINT:
            returns += 1
        elif point.param1 <= 0.0:
            return "Non-positive circle radius"
        if returns > 1:
            return "Multiple return points"
    return "Incorrect item count" if corners_left else ""


def points_changed(vehicle: AutopilotVehicle, kind: int) -> None:
    """Store the number of rally points in RALLY_TOTAL, or of corners and two more points in FENCE_TOTAL."""
    points = vehicle.points.get(kind, [])
    if kind == RALLY:
        vehicle.set_parameter("RALLY_TOTAL", len(points))
        return
    corners = sum(point.command in (INCLUSION, EXCLUSION) for point in points)
    total = corners + 2 if corners >= LEAST_CORNERS else 0
    vehicle.set_parameter("FENCE_TOTAL", total)
    stated_of(vehicle).total = total


def clear_if_emptied(vehicle: AutopilotVehicle) -> None:
    """Remove the fence once a station has set FENCE_TOTAL to 0."""
    total = round(vehicle.parameters["FENCE_TOTAL"])
    if total != stated_of(vehicle).total:
        stated_of(vehicle).total = total
        if not total:
            vehicle.points[FENCE] = []


def _wrong_total(total: int) -> str:
    return "Invalid FENCE_TOTAL" if 0 < total < LEAST_TOTAL else ""


def _simple(points: list[MissionItem]) -> bool:
    """Return whether a fence is one inclusion polygon with a return point at most."""
    corners = [point for point in points if point.command == INCLUSION]
    others = [point for point in points if point.command != INCLUSION]
    one = not corners or round(corners[0].param1) == len(corners)
    return one and len(others) <= 1 and all(point.command == RETURN_POINT for point in others)


def on_fence_point(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle FENCE_POINT, the deprecated form: FENCE_TOTAL states the number of points first."""
    total, index = round(vehicle.parameters["FENCE_TOTAL"]), fields["idx"]
    problem = _wrong_total(total)
    if not problem and fields["count"] != total:
        problem = f"Invalid fence point, bad count ({fields['count']} vs {total})"
    if not problem and index >= total:
        problem = f"Invalid fence point, index past total ({index} >= {total})"
    if not problem and not (abs(fields["lat"]) <= 90.0 and abs(fields["lng"]) <= 180.0):
        problem = "Invalid fence point, bad lat or lng"
    if problem:
        vehicle.send_text(WARNING, problem)
        return
    points = vehicle.points.get(FENCE, [])
    points = points if _simple(points) else []
    returns = [point for point in points if point.command == RETURN_POINT]
    corners = [point for point in points if point.command == INCLUSION]
    place = {"x": int(fields["lat"] * 1e7), "y": int(fields["lng"] * 1e7)}
    if index == 0:
        returns = [MissionItem(RETURN_POINT, GLOBAL, **place)]
    else:
        closing = index == total - 1
        count = index - 1 if closing else max(len(corners), index)
        blank = MissionItem(INCLUSION, GLOBAL)
        corners = [*corners, *([blank] * (count - len(corners)))][:count]
        if not closing:
            corners[index - 1] = blank._replace(**place)
    corners = [corner._replace(param1=float(len(corners))) for corner in corners]
    vehicle.points[FENCE] = [*returns, *corners]
    stated_of(vehicle).total = total


def on_fence_fetch(vehicle: AutopilotVehicle, fields: dict[str, Any], sender: Peer) -> None:
    """Handle FENCE_FETCH_POINT, the deprecated form."""
    total, index = round(vehicle.parameters["FENCE_TOTAL"]), fields["idx"]
    points = vehicle.points.get(FENCE, [])
    problem = "" if _simple(points) else "Vehicle contains advanced fences"
    problem = problem or _wrong_total(total)
    if not problem and index >= total:
        problem = f"Invalid fence point, index past total({index} >= {total})"
    if problem:
        vehicle.send_text(WARNING, problem)
        return
    corners = [(point.x, point.y) for point in points if point.command == INCLUSION]
    if index == 0:
        place = _return_point(points, corners)
        if place is None:
            vehicle.send_text(WARNING, "Failed to get return point")
    else:
        corner = 0 if index == total - 1 else index - 1
        place = corners[corner] if corner < len(corners) else None
    latitude, longitude = place or (0, 0)
    sender.answer("FENCE_POINT", idx=index, count=total, lat=latitude * 1e-7, lng=longitude * 1e-7)


def _return_point(points: list[MissionItem], corners: list[tuple[int, int]]) -> tuple[int, int] | None:
    """Return the stored return point, else the middle of the polygon's extent; ``None`` without a polygon."""
    stored = [(point.x, point.y) for point in points if point.command == RETURN_POINT]
    if stored:
        return stored[0]
    if len(corners) < LEAST_CORNERS or (0, 0) in corners:
        return None
    (south, north), (west, east) = ((min(axis), max(axis)) for axis in zip(*corners, strict=True))
    return (south + north) // 2, (west + east) // 2
