"""A plan: mission, geofence and rally points, as QGroundControl keeps them in a ``.plan`` file.

The items of the mission are MAVLink's own, so that a plan goes through unchanged whatever it contains. Item
numbers in jumps count from 1, in the order of the items; a file states the ``doJumpId`` of an item instead.
The text files of Mission Planner and MAVProxy (``QGC WPL 110``), which hold a mission only, are read, too.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite, isnan, nan
from pathlib import Path
from typing import Any

from volery.base.errors import UsageError
from volery.base.files import replace_text
from volery.base.position import AMSL, AboveHome, Position
from volery.links.mavlink_messages import constant, has_global_place, item_scale
from volery.vehicles.limits import Fence as ClientFence
from volery.vehicles.limits import Zone
from volery.vehicles.services import PlanItem

LARGEST_FILE = 20_000_000
ABOVE_HOME = constant("MAV_FRAME_GLOBAL_RELATIVE_ALT")
DO_JUMP = constant("MAV_CMD_DO_JUMP")
_POLYGON_IN = constant("MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION")
_POLYGON_OUT = constant("MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION")
_CIRCLE_IN = constant("MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION")
_CIRCLE_OUT = constant("MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION")
_BREACH_RETURN = constant("MAV_CMD_NAV_FENCE_RETURN_POINT")
_RALLY = constant("MAV_CMD_NAV_RALLY_POINT")
_WAYPOINT = constant("MAV_CMD_NAV_WAYPOINT")
_NO_PARAMETERS = (0.0, 0.0, 0.0, 0.0)

AUTOPILOTS: Mapping[str, int] = {"ArduPilot": 3, "PX4": 12}
"""MAV_AUTOPILOT in a file, by the name in telemetry."""
QUADROTOR = constant("MAV_TYPE_QUADROTOR")
GROUND_ROVER = constant("MAV_TYPE_GROUND_ROVER")
VERSION, PART_VERSION = 1, 2
"""Versions of a file, and of its mission, geofence and rally points, that are read and written."""
_ALTITUDE_MODES: Mapping[int, int] = {0: 2, 3: 1, 5: 2, 6: 1, 10: 4, 11: 4}
"""MAV_FRAME to QGroundControl's mode of altitude: 1 above home, 2 AMSL, 4 above terrain."""
_WPL = "QGC WPL 110"
_LARGEST_COMMAND, _LARGEST_FRAME = 65_535, 255

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
        breach_return: place to return to when the geofence is breached, above home; ``None`` for home.
        autopilot: MAV_AUTOPILOT that the file is for.
        vehicle: MAV_TYPE that the file is for.
    """

    mission: tuple[PlanItem, ...] = ()
    fence: tuple[Area, ...] = ()
    rally: tuple[Position, ...] = ()
    home: Position | None = None
    breach_return: Position | None = None
    autopilot: int = AUTOPILOTS["PX4"]
    vehicle: int = QUADROTOR

    def __post_init__(self) -> None:
        for place in (*self.rally, *((self.breach_return,) if self.breach_return else ())):
            if not isinstance(place.altitude, AboveHome):
                raise UsageError(f"rally point or place of return {place}: its altitude is AboveHome(...)")
        for number, item in enumerate(self.mission, 1):
            _check_item(item, number)

    @classmethod
    def read(cls, file: str | Path) -> Plan:
        """Return the plan in a ``.plan`` file of QGroundControl, or the mission of a ``QGC WPL 110`` file.

        Raises:
            UsageError: the file is none; the error names what is wrong and where.
        """
        path = Path(file)
        try:
            if not path.is_file():
                raise UsageError(f"{path}: there is no such file")
            if path.stat().st_size > LARGEST_FILE:
                raise UsageError(f"{path}: larger than {LARGEST_FILE} bytes; this is no plan")
            text = path.read_text(encoding="utf-8")
            document = None if text.startswith(_WPL) else json.loads(text)
        except OSError as error:
            raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
        except (ValueError, RecursionError) as error:
            raise UsageError(f"{path}: this is not JSON: {error}") from None
        try:
            return _plan_of_text(text) if text.startswith(_WPL) else _plan_of(document)
        except UsageError as error:
            raise UsageError(f"{path}: {error}") from None
        except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
            raise UsageError(f"{path}: no plan of QGroundControl: {type(error).__name__} {error}") from None

    def write(self, file: str | Path) -> None:
        """Write a ``.plan`` file that QGroundControl reads."""
        path = Path(file)
        try:
            replace_text(path, json.dumps(_document_of(self), indent=4) + "\n")
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}") from None


def _check_item(item: PlanItem, number: int) -> None:
    """Refuse an item that MAVLink cannot carry, or that has a place and no altitude."""
    if not (0 <= item.command <= _LARGEST_COMMAND and 0 <= item.frame <= _LARGEST_FRAME):
        stated = f"command {item.command:.9g}, frame {item.frame:.9g}"
        raise UsageError(f"item {number} ({stated}): MAVLink has no such command or frame")
    what = f"item {number} (command {item.command})"
    scale = item_scale(item.command, item.frame)
    for place, value in ((5, item.latitude), (6, item.longitude)):
        placed = scale == 1 and has_global_place(item.command, 0)  # DO_LAND_START in the frame MISSION
        if not isfinite(value) or (scale == 1 and not placed and value != round(value)):
            raise UsageError(f"{what}: parameter {place} = {value:g}; MAVLink carries whole numbers there")
    if has_global_place(item.command, item.frame) and (item.latitude or item.longitude):
        Position(item.latitude, item.longitude, AMSL(0.0))
        if not isfinite(item.z):
            raise UsageError(f"{what} has a place and no altitude; state one")


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


def fence_items(areas: Iterable[Area]) -> list[PlanItem]:
    """Return areas as the items of MAV_MISSION_TYPE_FENCE."""
    items = []
    for area in areas:
        if isinstance(area, Circle):
            command = _CIRCLE_IN if area.stay_in else _CIRCLE_OUT
            items.append(PlanItem(command, 0, (area.radius, 0.0, 0.0, 0.0), *area.centre, 0.0))
        else:
            command = _POLYGON_IN if area.stay_in else _POLYGON_OUT
            count = float(len(area.corners))
            items += [PlanItem(command, 0, (count, 0.0, 0.0, 0.0), *corner, 0.0) for corner in area.corners]
    return items


def fence_areas(items: Iterable[PlanItem]) -> tuple[Area, ...]:
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


def breach_return_items(place: Position | None) -> list[PlanItem]:
    """Return the place to return to from a breach as an item of MAV_MISSION_TYPE_FENCE."""
    if place is None:
        return []
    at = place.latitude, place.longitude, place.altitude.metres
    return [PlanItem(_BREACH_RETURN, ABOVE_HOME, _NO_PARAMETERS, *at)]


def breach_return_place(items: Iterable[PlanItem]) -> Position | None:
    """Return the place to return to from a breach among items of MAV_MISSION_TYPE_FENCE."""
    found = [item for item in items if item.command == _BREACH_RETURN]
    return Position(found[0].latitude, found[0].longitude, AboveHome(found[0].z)) if found else None


def rally_items(places: Iterable[Position]) -> list[PlanItem]:
    """Return rally points as items of MAV_MISSION_TYPE_RALLY."""
    return [
        PlanItem(_RALLY, ABOVE_HOME, _NO_PARAMETERS, one.latitude, one.longitude, one.altitude.metres)
        for one in places
    ]


def rally_places(items: Iterable[PlanItem]) -> tuple[Position, ...]:
    """Return the places in items of MAV_MISSION_TYPE_RALLY."""
    return tuple(Position(item.latitude, item.longitude, AboveHome(item.z)) for item in items)


# -- as a file


def _plan_of(document: Any) -> Plan:
    if not isinstance(document, dict) or document.get("fileType") != "Plan":
        raise UsageError('no plan of QGroundControl: its "fileType" is not "Plan"')
    _check_version("plan", document, VERSION)
    mission = document.get("mission", {})
    fence, rally = document.get("geoFence", {}), document.get("rallyPoints", {})
    for name, part in (("mission", mission), ("geofence", fence), ("list of rally points", rally)):
        _check_version(name, part, PART_VERSION)
    entries = [
        entry for number, one in enumerate(mission.get("items", []), 1) for entry in _entries_of(one, number)
    ]
    numbered = list(enumerate(entries, 1))
    places_by_id = {entry["doJumpId"]: number for number, entry in numbered if "doJumpId" in entry}
    items = [_item_of(entry, number, places_by_id) for number, entry in numbered]
    circles = [
        Circle(_corner(one["circle"]["center"]), float(one["circle"]["radius"]), bool(one["inclusion"]))
        for one in fence.get("circles", [])
    ]
    polygons = [
        Polygon(tuple(_corner(each) for each in one["polygon"]), bool(one["inclusion"]))
        for one in fence.get("polygons", [])
    ]
    places = [Position(float(a), float(b), AboveHome(float(c))) for a, b, c in rally.get("points", [])]
    back, at = fence.get("breachReturn"), mission.get("plannedHomePosition")
    return Plan(
        tuple(items),
        (*polygons, *circles),
        tuple(places),
        Position(float(at[0]), float(at[1]), AMSL(float(at[2]))) if at and None not in at else None,
        Position(float(back[0]), float(back[1]), AboveHome(float(back[2]))) if back else None,
        int(mission.get("firmwareType", AUTOPILOTS["PX4"])),
        int(mission.get("vehicleType", QUADROTOR)),
    )


def _check_version(name: str, part: Any, known: int) -> None:
    """Refuse another version of a part of a file: its fields may have other meanings."""
    stated = part.get("version", known)
    if stated != known:
        raise UsageError(
            f"a {name} of version {stated!r}; {known} is read: open it in QGroundControl and save it again"
        )


def _plan_of_text(text: str) -> Plan:
    """Return the mission of a ``QGC WPL 110`` file: a row for each item, of twelve columns.

    The columns are number, current, frame, command, seven parameters and continuation. The first row is home
    if it is a waypoint AMSL, as Mission Planner and MAVProxy write it; jumps count from there.
    """
    items: list[PlanItem] = []
    for number, line in enumerate(text.splitlines()[1:], 2):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            frame, command = int(words[2]), int(words[3])
            first, second, third, fourth, x, y, z = (float(word) for word in words[4:11])
        except (ValueError, IndexError):
            raise UsageError(f"line {number}: {line.strip()!r} is no item of a {_WPL} file") from None
        items.append(PlanItem(command, frame, (first, second, third, fourth), x, y, z))
    at = items[0] if items and (items[0].command, items[0].frame) == (_WAYPOINT, 0) else None
    home = Position(at.latitude, at.longitude, AMSL(at.z)) if at and (at.latitude or at.longitude) else None
    first_number = 0 if at else 1
    mission = [
        item._replace(parameters=(item.parameters[0] + first_number, *item.parameters[1:]))
        if item.command == DO_JUMP
        else item
        for item in items[1 if at else 0 :]
    ]
    return Plan(tuple(mission), home=home, autopilot=AUTOPILOTS["ArduPilot"])


def _corner(place: Any) -> Corner:
    latitude, longitude = place
    return float(latitude), float(longitude)


def _entries_of(one: Mapping[str, Any], number: int) -> list[Mapping[str, Any]]:
    """Return the simple items of an entry of a mission; a survey holds its own."""
    if one.get("type") == "SimpleItem":
        return [one]
    held = one.get("TransectStyleComplexItem", {}).get("Items")
    if held is None:
        kind = one.get("complexItemType", one.get("type"))
        raise UsageError(f"item {number} is a {kind!r}, which only QGroundControl computes")
    return [entry for each in held for entry in _entries_of(each, number)]


def _item_of(entry: Mapping[str, Any], number: int, places_by_id: Mapping[Any, int]) -> PlanItem:
    """Return an item. *places_by_id*: the numbers of all by ``doJumpId``, empty if none states it."""
    first, second, third, fourth, x, y, z = (
        nan if value is None else float(value) for value in entry["params"]
    )
    command, frame = int(entry["command"]), int(entry["frame"])
    if command == DO_JUMP and places_by_id:
        if first not in places_by_id:
            raise UsageError(f"item {number} jumps to doJumpId {first:g}, which no item has")
        first = float(places_by_id[first])
    x, y = (0.0 if isnan(value) else value for value in (x, y))
    if isnan(z) and not (has_global_place(command, frame) and (x or y)):
        z = 0.0
    return PlanItem(command, frame, (first, second, third, fourth), x, y, z)


def _document_of(plan: Plan) -> dict[str, Any]:
    places = (one for one in plan.mission if has_global_place(one.command, one.frame) and one.latitude)
    home = plan.home or next((Position(one.latitude, one.longitude, AMSL(0.0)) for one in places), None)
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
    place = plan.breach_return
    back = {"breachReturn": [place.latitude, place.longitude, place.altitude.metres]} if place else {}
    return {
        "fileType": "Plan",
        "geoFence": {"circles": circles, "polygons": polygons, "version": PART_VERSION, **back},
        "groundStation": "volery",
        "mission": {
            "cruiseSpeed": 15,
            "firmwareType": plan.autopilot,
            "globalPlanAltitudeMode": 1,
            "hoverSpeed": 5,
            "items": [_entry_of(item, number) for number, item in enumerate(plan.mission, 1)],
            "plannedHomePosition": at,
            "vehicleType": plan.vehicle,
            "version": PART_VERSION,
        },
        "rallyPoints": {
            "points": [[one.latitude, one.longitude, one.altitude.metres] for one in plan.rally],
            "version": PART_VERSION,
        },
        "version": VERSION,
    }


def _entry_of(item: PlanItem, number: int) -> dict[str, Any]:
    values = [*item.parameters, item.latitude, item.longitude, item.z]
    return {
        "AMSLAltAboveTerrain": None,
        "Altitude": item.z,
        "AltitudeMode": _ALTITUDE_MODES.get(item.frame, 2),
        "autoContinue": True,
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [value if isfinite(value) else None for value in values],
        "type": "SimpleItem",
    }
