"""Rally points of ArduPilot: where a vehicle returns, and the deprecated messages that carry the points.

They are stored like the fence, by MISSION messages or by RALLY_POINT.
"""

from __future__ import annotations

from math import hypot
from typing import Any

from volery.base.frames import Vector
from volery.simulation.autopilots.ardupilot.feature import Feature
from volery.simulation.autopilots.ardupilot.fence_points import RALLY, RALLY_POINT
from volery.simulation.autopilots.mavlink.channel import Peer
from volery.simulation.autopilots.onboard_mission import GLOBAL_RELATIVE, MissionItem
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import WARNING


def return_point(vehicle: AutopilotVehicle) -> Vector | None:
    """Return the rally point to which the vehicle returns, north, east, down [m]; ``None``: it returns home.

    It is the nearest one, within RALLY_LIMIT_KM where that is positive; with RALLY_INCL_HOME only if it is
    nearer than home. Its height replaces RTL_ALT.
    """
    here = vehicle.estimate.position

    def away(point: Vector) -> float:
        return hypot(point[0] - here[0], point[1] - here[1])

    stored = vehicle.points.get(RALLY, [])
    points = [vehicle.point(item.frame, item.x / 1e7, item.y / 1e7, item.z) for item in stored]
    if not points or vehicle.home is None:
        return None
    nearest = min(points, key=away)
    limit = 1000.0 * vehicle.parameters["RALLY_LIMIT_KM"]
    too_far = 0.0 < limit < away(nearest)
    home_is_nearer = vehicle.parameters["RALLY_INCL_HOME"] != 0.0 and away(vehicle.home.ned) <= away(nearest)
    return None if too_far or home_is_nearer else nearest


def on_rally_fetch(vehicle: AutopilotVehicle, fields: dict[str, Any], sender: Peer) -> None:
    """Handle RALLY_FETCH_POINT, the deprecated form."""
    points, index = vehicle.points.get(RALLY, []), fields["idx"]
    if index >= len(points):
        vehicle.send_text(WARNING, "Bad rally point ID")
        return
    point = points[index]
    place = {"lat": point.x, "lng": point.y, "alt": round(point.z), "break_alt": 0, "land_dir": 0, "flags": 0}
    sender.answer("RALLY_POINT", idx=index, count=round(vehicle.parameters["RALLY_TOTAL"]), **place)


def on_rally_point(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle RALLY_POINT, the deprecated form: RALLY_TOTAL states the number of points first."""
    points, index = vehicle.points.get(RALLY, []), fields["idx"]
    if index >= vehicle.parameters["RALLY_TOTAL"]:
        vehicle.send_text(WARNING, "Bad rally point message ID")
    elif fields["count"] != vehicle.parameters["RALLY_TOTAL"]:
        vehicle.send_text(WARNING, "Bad rally point message count")
    else:
        blank = MissionItem(RALLY_POINT, GLOBAL_RELATIVE)
        points = [*points, *([blank] * (index + 1 - len(points)))]
        points[index] = blank._replace(x=fields["lat"], y=fields["lng"], z=float(fields["alt"]))
        vehicle.points[RALLY] = points


COPTER = ROVER = Feature(
    parameters={
        "RALLY_INCL_HOME": ("", "any value but 0: home counts as a rally point of the return"),
        "RALLY_LIMIT_KM": ("km", "distance beyond which a rally point is not used; 0: none"),
        "RALLY_TOTAL": ("", "number of rally points"),
    },
    messages={"RALLY_POINT": on_rally_point},
    questions={"RALLY_FETCH_POINT": on_rally_fetch},
    return_point=return_point,
)
