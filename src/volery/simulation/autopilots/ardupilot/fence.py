"""ArduPilot's fence on board and its rally points: upload, breach, action, and points that are not flown to.

The breach of a recorded copter said "Fence Breached" and began the return; a guided point beyond the fence is
ignored without a word. Avoidance, which slows a vehicle down at the fence, is not modelled.
"""

from __future__ import annotations

from itertools import pairwise
from math import hypot

from volery.base.frames import Vector
from volery.simulation.autopilots.ardupilot.modes import change_mode
from volery.simulation.autopilots.firmware import Failsafe
from volery.simulation.autopilots.mavlink.command import ACCEPTED, FAILED, Command
from volery.simulation.autopilots.mavlink.message_fields import Fields, finite
from volery.simulation.autopilots.onboard_mission import (
    GLOBAL,
    GLOBAL_INT,
    GLOBAL_RELATIVE,
    GLOBAL_RELATIVE_INT,
    MissionItem,
)
from volery.simulation.autopilots.vehicle_state import Vehicle

FENCE, RALLY = 1, 2
"""MAV_MISSION_TYPE."""

RETURN_POINT, INCLUSION, EXCLUSION, CIRCLE_INCLUSION, CIRCLE_EXCLUSION = 5000, 5001, 5002, 5003, 5004
RALLY_POINT = 5100

UNSUPPORTED_FRAME, UNSUPPORTED, INVALID_PARAM1 = 2, 3, 6
"""MAV_MISSION_RESULT."""

ALTITUDE, CIRCLE, POLYGON, FLOOR = 1, 2, 4, 8
"""Bits of FENCE_TYPE."""

NO_BREACH, BELOW, ABOVE, BOUNDARY = 0, 1, 2, 3
"""FENCE_BREACH."""

GIVE_UP = 100.0
"""Distance beyond the fence [m] at which a copter lands."""

NOTICE = 5
"""MAV_SEVERITY."""

STORED = {GLOBAL: GLOBAL, GLOBAL_INT: GLOBAL, GLOBAL_RELATIVE: 3, GLOBAL_RELATIVE_INT: 3}


def stored_point(kind: int, item: MissionItem) -> MissionItem | int:
    """Return a point of the fence or a rally point as stored, or the MAV_MISSION_RESULT that refuses it."""
    known = (RALLY_POINT,) if kind == RALLY else range(RETURN_POINT, CIRCLE_EXCLUSION + 1)
    if item.command not in known:
        return UNSUPPORTED
    if item.frame not in STORED:
        return UNSUPPORTED_FRAME
    first = finite(item.param1)
    if item.command in (INCLUSION, EXCLUSION) and not 3.0 <= first <= 255.0:
        return INVALID_PARAM1
    return item._replace(
        frame=STORED[item.frame], param1=first, param2=0.0, param3=0.0, param4=0.0, z=finite(item.z)
    )


def points_changed(vehicle: Vehicle, kind: int) -> None:
    """Store the number of points in FENCE_TOTAL or RALLY_TOTAL."""
    name = "FENCE_TOTAL" if kind == FENCE else "RALLY_TOTAL"
    vehicle.set_parameter(name, len(vehicle.points.get(kind, [])))


def on_fence_enable(vehicle: Vehicle, command: Command) -> int:
    """Handle DO_FENCE_ENABLE: 0 switches off, 1 on."""
    if command.param1 not in (0.0, 1.0):
        return FAILED
    vehicle.parameters.set("FENCE_ENABLE", command.param1)
    return ACCEPTED


def _active(vehicle: Vehicle, kind: int) -> bool:
    enabled = vehicle.parameters["FENCE_ENABLE"] > 0.0
    return enabled and vehicle.home is not None and bool(round(vehicle.parameters["FENCE_TYPE"]) & kind)


def _inside(corners: list[Vector], point: Vector) -> bool:
    """Return whether a point lies within a polygon, seen from above."""
    inside = False
    for (north, east, _), (before_north, before_east, _) in pairwise([*corners, corners[0]]):
        if (east > point[1]) != (before_east > point[1]):
            along = (point[1] - east) / (before_east - east)
            inside ^= point[0] < north + along * (before_north - north)
    return inside


def _beyond_polygons(vehicle: Vehicle, point: Vector) -> bool:
    """Return whether a point is outside an inclusion or inside an exclusion."""
    corners: list[Vector] = []
    for item in vehicle.points.get(FENCE, []):
        place = vehicle.point(item.frame, item.x / 1e7, item.y / 1e7, item.z)
        if item.command in (CIRCLE_INCLUSION, CIRCLE_EXCLUSION):
            within = hypot(point[0] - place[0], point[1] - place[1]) <= item.param1
            if within != (item.command == CIRCLE_INCLUSION):
                return True
        elif item.command in (INCLUSION, EXCLUSION):
            corners.append(place)
            if len(corners) == round(item.param1):
                if _inside(corners, point) != (item.command == INCLUSION):
                    return True
                corners = []
    return False


def breach(vehicle: Vehicle, point: Vector) -> int:
    """Return the FENCE_BREACH of a point north, east, down about the estimator's origin [m]."""
    home = vehicle.home
    if home is None:
        return NO_BREACH
    if vehicle.flies:
        height = home.ned[2] - point[2]
        if _active(vehicle, ALTITUDE) and height > vehicle.parameters["FENCE_ALT_MAX"]:
            return ABOVE
        if _active(vehicle, FLOOR) and not vehicle.landed and height < vehicle.parameters["FENCE_ALT_MIN"]:
            return BELOW
    away = hypot(point[0] - home.ned[0], point[1] - home.ned[1])
    if _active(vehicle, CIRCLE) and away > vehicle.parameters["FENCE_RADIUS"]:
        return BOUNDARY
    return BOUNDARY if _active(vehicle, POLYGON) and _beyond_polygons(vehicle, point) else NO_BREACH


def breached(vehicle: Vehicle) -> bool:
    """Return whether an armed vehicle is beyond the fence."""
    if not vehicle.armed or (vehicle.flies and vehicle.landed) or not vehicle.estimate.position_ok:
        return False
    return breach(vehicle, vehicle.estimate.position) != NO_BREACH


def outside_fence(vehicle: Vehicle) -> bool:
    """Return whether the vehicle stands outside the fence, which forbids arming."""
    return vehicle.has_position and breach(vehicle, vehicle.estimate.position) != NO_BREACH


def admits(vehicle: Vehicle, point: Vector) -> bool:
    """Return whether a guided point may be flown to."""
    return breach(vehicle, point) == NO_BREACH


def _far_beyond(vehicle: Vehicle) -> bool:
    home = vehicle.home
    if home is None or not _active(vehicle, CIRCLE):
        return False
    north, east, _ = vehicle.estimate.position
    return hypot(north - home.ned[0], east - home.ned[1]) > vehicle.parameters["FENCE_RADIUS"] + GIVE_UP


def fence_failsafe(actions: dict[int, tuple[int, ...]], last: tuple[int, ...]) -> Failsafe:
    """Return the failsafe of the fence.

    Args:
        actions: FENCE_ACTION to the modes that are tried in order.
        last: Modes that are tried far beyond the fence.
    """

    def begins(vehicle: Vehicle) -> None:
        vehicle.reports.fence_breaches += 1
        vehicle.reports.fence_breached_at = vehicle.uptime()
        vehicle.send_text(NOTICE, "Fence Breached")
        action = round(vehicle.parameters["FENCE_ACTION"])
        modes = last if action and _far_beyond(vehicle) else actions.get(action, ())
        any(change_mode(vehicle, mode) for mode in modes)

    return Failsafe("fence", breached, begins)


def fence_status(vehicle: Vehicle) -> Fields | None:
    """Return FENCE_STATUS while the fence is enabled."""
    if not vehicle.parameters["FENCE_ENABLE"]:
        return None
    active = "fence" in vehicle.failsafes.active
    return {
        "breach_status": int(active),
        "breach_count": vehicle.reports.fence_breaches,
        "breach_type": breach(vehicle, vehicle.estimate.position) if active else NO_BREACH,
        "breach_time": vehicle.reports.fence_breached_at // 1_000_000,
    }
