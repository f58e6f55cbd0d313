"""A plan: mission, geofence and rally points, as QGroundControl keeps them in a ``.plan`` file.

The items of the mission are MAVLink's own, so that a plan goes through unchanged whatever it contains. Item
numbers in jumps count as in the file, from 1.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite, isnan, nan
from pathlib import Path
from typing import Any

from volery.base.errors import UsageError
from volery.base.position import AMSL, AboveHome, Position
from volery.links.mavlink_messages import constant
from volery.vehicles.limits import Fence as ClientFence
from volery.vehicles.limits import Zone
from volery.vehicles.services import Item

LARGEST_FILE = 20_000_000
ABOVE_HOME = constant("MAV_FRAME_GLOBAL_RELATIVE_ALT")
DO_JUMP = constant("MAV_CMD_DO_JUMP")
_POLYGON_IN = constant("MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION")
_POLYGON_OUT = constant("MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION")
_CIRCLE_IN = constant("MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION")
_CIRCLE_OUT = constant("MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION")
_RALLY = constant("MAV_CMD_NAV_RALLY_POINT")
_NO_PARAMETERS = (0.0, 0.0, 0.0, 0.0)

_ARDUPILOT, _PX4 = 3, 12
"""MAV_AUTOPILOT in a file."""

Corner = tuple[float, float]


@dataclass(frozen=True)
class Polygon:
    """An area of a geofence: corners as (latitude, longitude) in degrees; to stay in, or to keep out of."""

    corners: tuple[Corner, ...]
    stay_in: bool = True

    def __post_init__(self) -> None:
        if len(self.corners) < 3:
            raise UsageError(f"an area of a geofence has {len(self.corners)} corners; it takes at least 3")
        for latitude, longitude in self.corners:
            Position(latitude, longitude, AMSL(0.0))


@dataclass(frozen=True)
class Circle:
    """A circle of a geofence: centre as (latitude, longitude) in degrees, radius in m."""

    centre: Corner
    radius: float
    stay_in: bool = True

    def __post_init__(self) -> None:
        Position(*self.centre, AMSL(0.0))
        if not (isfinite(self.radius) and self.radius > 0):
            raise UsageError(f"a circle of a geofence has a radius of {self.radius:g} m; give one above 0")


Area = Polygon | Circle


@dataclass(frozen=True)
class Plan:
    """What an autopilot keeps on board to fly by itself.

    Args:
        mission: items in order, without one for home.
        fence: areas to stay in and to keep out of.
        rally: places to return to instead of home; altitudes above home.
        home: planned home (AMSL), for the file; an autopilot sets its own.
    """

    mission: tuple[Item, ...] = ()
    fence: tuple[Area, ...] = ()
    rally: tuple[Position, ...] = ()
    home: Position | None = None

    def __post_init__(self) -> None:
        for place in self.rally:
            if not isinstance(place.altitude, AboveHome):
                raise UsageError(f"rally point {place}: its altitude is AboveHome(...)")

    @classmethod
    def read(cls, file: str | Path) -> Plan:
        """Return the plan in a ``.plan`` file of QGroundControl.

        Raises:
            UsageError: the file is none; the error names what is wrong and where.
        """
        path = Path(file)
        try:
            if not path.is_file():
                raise UsageError(f"{path}: there is no such file")
            if path.stat().st_size > LARGEST_FILE:
                raise UsageError(f"{path}: larger than {LARGEST_FILE} bytes; this is no plan")
            document = json.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
        except (ValueError, RecursionError) as error:
            raise UsageError(f"{path}: this is not JSON: {error}") from None
        try:
            return _plan_of(document)
        except UsageError as error:
            raise UsageError(f"{path}: {error}") from None
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            raise UsageError(f"{path}: no plan of QGroundControl: {type(error).__name__} {error}") from None

    def write(self, file: str | Path) -> None:
        """Write a ``.plan`` file that QGroundControl reads."""
        path = Path(file)
        try:
            path.write_text(json.dumps(_document_of(self), indent=4) + "\n", encoding="utf-8")
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}") from None


def areas_of(fence: ClientFence) -> tuple[Area, ...]:
    """Return a fence of volery as areas that an autopilot keeps.

    Raises:
        UsageError: it states heights, which autopilots keep as parameters instead.
    """
    bounded: tuple[ClientFence | Zone, ...] = (fence, *fence.no_fly)
    if any(one.floor is not None or one.ceiling is not None for one in bounded):
        raise UsageError(
            "the fence states heights; an autopilot keeps them as parameters (ArduPilot: FENCE_ALT_MAX and "
            "FENCE_ALT_MIN, PX4: GF_MAX_VER_DIST); upload a fence without floor and ceiling"
        )
    outer = (Polygon(fence.polygon),) if fence.polygon else ()
    return (*outer, *(Polygon(zone.corners, stay_in=False) for zone in fence.no_fly))


# -- as items of MAVLink


def fence_items(areas: Iterable[Area]) -> list[Item]:
    """Return areas as the items of MAV_MISSION_TYPE_FENCE."""
    items = []
    for area in areas:
        if isinstance(area, Circle):
            command = _CIRCLE_IN if area.stay_in else _CIRCLE_OUT
            items.append(Item(command, 0, (area.radius, 0.0, 0.0, 0.0), *area.centre, 0.0))
        else:
            command = _POLYGON_IN if area.stay_in else _POLYGON_OUT
            count = float(len(area.corners))
            items += [Item(command, 0, (count, 0.0, 0.0, 0.0), *corner, 0.0) for corner in area.corners]
    return items


def fence_areas(items: Iterable[Item]) -> tuple[Area, ...]:
    """Return the areas in items of MAV_MISSION_TYPE_FENCE; items of other commands are left out."""
    areas: list[Area] = []
    corners: list[Corner] = []
    for item in items:
        place = (item.latitude, item.longitude)
        if item.command in (_CIRCLE_IN, _CIRCLE_OUT):
            areas.append(Circle(place, item.parameters[0], item.command == _CIRCLE_IN))
        elif item.command in (_POLYGON_IN, _POLYGON_OUT):
            corners.append(place)
            if len(corners) >= item.parameters[0]:
                areas.append(Polygon(tuple(corners), item.command == _POLYGON_IN))
                corners = []
    return tuple(areas)


def rally_items(places: Iterable[Position]) -> list[Item]:
    """Return rally points as items of MAV_MISSION_TYPE_RALLY."""
    return [
        Item(_RALLY, ABOVE_HOME, _NO_PARAMETERS, one.latitude, one.longitude, one.altitude.metres)
        for one in places
    ]


def rally_places(items: Iterable[Item]) -> tuple[Position, ...]:
    """Return the places in items of MAV_MISSION_TYPE_RALLY."""
    return tuple(Position(one.latitude, one.longitude, AboveHome(one.z)) for one in items)


# -- as a file


def _plan_of(document: Any) -> Plan:
    if not isinstance(document, dict) or document.get("fileType") != "Plan":
        raise UsageError('no plan of QGroundControl: its "fileType" is not "Plan"')
    mission = document.get("mission", {})
    items = [
        item for number, one in enumerate(mission.get("items", []), 1) for item in _items_of(one, number)
    ]
    fence, rally = document.get("geoFence", {}), document.get("rallyPoints", {})
    circles = [
        Circle(_corner(one["circle"]["center"]), float(one["circle"]["radius"]), bool(one["inclusion"]))
        for one in fence.get("circles", [])
    ]
    polygons = [
        Polygon(tuple(_corner(each) for each in one["polygon"]), bool(one["inclusion"]))
        for one in fence.get("polygons", [])
    ]
    places = [Position(float(a), float(b), AboveHome(float(c))) for a, b, c in rally.get("points", [])]
    at = mission.get("plannedHomePosition")
    home = Position(float(at[0]), float(at[1]), AMSL(float(at[2]))) if at else None
    return Plan(tuple(items), (*polygons, *circles), tuple(places), home)


def _corner(place: Any) -> Corner:
    latitude, longitude = place
    return float(latitude), float(longitude)


def _items_of(one: Mapping[str, Any], number: int) -> list[Item]:
    """Return the items of an entry of a mission; a survey holds its own."""
    if one.get("type") == "SimpleItem":
        first, second, third, fourth, latitude, longitude, height = (
            nan if value is None else float(value) for value in one["params"]
        )
        place = [0.0 if isnan(value) else value for value in (latitude, longitude, height)]
        if place[0] or place[1]:
            Position(place[0], place[1], AMSL(0.0))
        return [Item(int(one["command"]), int(one["frame"]), (first, second, third, fourth), *place)]
    held = one.get("TransectStyleComplexItem", {}).get("Items")
    if held is None:
        kind = one.get("complexItemType", one.get("type"))
        raise UsageError(f"item {number} is a {kind!r}, which only QGroundControl computes")
    return [item for each in held for item in _items_of(each, number)]


def _document_of(plan: Plan) -> dict[str, Any]:
    home = plan.home or next((_place_of(item) for item in plan.mission if item.latitude), None)
    at = [home.latitude, home.longitude, home.altitude.metres] if home else [0.0, 0.0, 0.0]
    polygons = [
        {"polygon": [list(corner) for corner in one.corners], "inclusion": one.stay_in, "version": 1}
        for one in plan.fence
        if isinstance(one, Polygon)
    ]
    circles = [
        {
            "circle": {"center": list(one.centre), "radius": one.radius},
            "inclusion": one.stay_in,
            "version": 1,
        }
        for one in plan.fence
        if isinstance(one, Circle)
    ]
    return {
        "fileType": "Plan",
        "geoFence": {"circles": circles, "polygons": polygons, "version": 2},
        "groundStation": "volery",
        "mission": {
            "cruiseSpeed": 15,
            "firmwareType": _PX4,
            "globalPlanAltitudeMode": 1,
            "hoverSpeed": 5,
            "items": [_entry_of(item, number) for number, item in enumerate(plan.mission, 1)],
            "plannedHomePosition": at,
            "vehicleType": 2,
            "version": 2,
        },
        "rallyPoints": {
            "points": [[one.latitude, one.longitude, one.altitude.metres] for one in plan.rally],
            "version": 2,
        },
        "version": 1,
    }


def _place_of(item: Item) -> Position:
    return Position(item.latitude, item.longitude, AMSL(0.0))


def _entry_of(item: Item, number: int) -> dict[str, Any]:
    values = [*item.parameters, item.latitude, item.longitude, item.z]
    return {
        "AMSLAltAboveTerrain": None,
        "Altitude": item.z,
        "AltitudeMode": 1 if item.frame == ABOVE_HOME else 2,
        "autoContinue": True,
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [value if isfinite(value) else None for value in values],
        "type": "SimpleItem",
    }
