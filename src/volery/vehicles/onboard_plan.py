"""The plan on board of an autopilot: upload, download and clear mission, geofence and rally points."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

from volery.base.errors import Refused, UsageError, choices
from volery.base.position import AMSL, AboveGround, AboveHome, Altitude, Position
from volery.links.mavlink_messages import constant, has_global_place
from volery.vehicles.limits import Fence as ClientFence
from volery.vehicles.services import FENCE, MISSION, RALLY, PlanItem, Services
from volery.vehicles.telemetry import Telemetry
from volery.vehicles.vehicle_plan import (
    AUTOPILOTS,
    DO_JUMP,
    GROUND_ROVER,
    QUADROTOR,
    Plan,
    areas_of,
    breach_return_items,
    breach_return_place,
    fence_areas,
    fence_items,
    rally_items,
    rally_places,
)

PARTS = ("mission", "fence", "rally")
_WAYPOINT = constant("MAV_CMD_NAV_WAYPOINT")
_LAST_NAVIGATION = 95
"""MAV_CMD_NAV_LAST: commands up to it lead to a place."""
_ABSOLUTE = (constant("MAV_FRAME_GLOBAL"), constant("MAV_FRAME_GLOBAL_INT"))
_TERRAIN = (constant("MAV_FRAME_GLOBAL_TERRAIN_ALT"), constant("MAV_FRAME_GLOBAL_TERRAIN_ALT_INT"))
_HOME = PlanItem(_WAYPOINT, 0, (0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
"""Item 0 of an ArduPilot, which it fills in itself."""

Check = Callable[[str, Position], None]
"""``check(asked, place)`` raises if a leg of the mission to *place* is out of bounds."""


class OnboardPlan:
    """Plan of one autopilot.

    Args:
        telemetry: telemetry of the vehicle.
        services: services of its autopilot.
        check: checks each place of a mission against limits and fence.
    """

    def __init__(self, telemetry: Telemetry, services: Services, check: Check) -> None:
        self._telemetry = telemetry
        self._services = services
        self._check = check

    def upload(self, plan: Plan | str | Path, only: Collection[str] = PARTS) -> Plan:
        """Replace what is on board by a plan, and return it.

        An empty part clears that list. The mission then begins with ``start_mission()``.

        Args:
            plan: the plan, or a ``.plan`` or ``QGC WPL 110`` file of a ground station.
            only: parts to replace: ``mission``, ``fence``, ``rally``.

        Raises:
            UsageError: the file is no plan.
            OutOfBounds: the mission or a rally point violates limits or fence.
            CapabilityError: the autopilot keeps no such list.
            Refused: the autopilot refuses an item.
        """
        found = plan if isinstance(plan, Plan) else Plan.read(plan)
        parts = _checked(only)
        if "mission" in parts:
            self._check_places(found)
            self._upload_mission(found.mission)
        if "fence" in parts:
            areas = [*fence_items(found.fence), *breach_return_items(found.breach_return)]
            self._services.upload_items(FENCE, areas)
        if "rally" in parts:
            self._check_rally(found)
            self._services.upload_items(RALLY, rally_items(found.rally))
        return found

    def upload_fence(self, fence: ClientFence) -> None:
        """Replace the geofence on board by one of volery, which the autopilot keeps without this program.

        Whether and how it reacts is set by its parameters (ArduPilot: ``FENCE_ENABLE``, PX4: ``GF_ACTION``).
        """
        self.upload(Plan(fence=areas_of(fence)), only=("fence",))

    def download(self, only: Collection[str] = PARTS) -> Plan:
        """Return what is on board; parts that are not asked for are empty."""
        parts = _checked(only)
        seen = self._telemetry
        mission, home = self._download_mission() if "mission" in parts else ((), None)
        areas = self._services.download_items(FENCE) if "fence" in parts else []
        places = rally_places(self._services.download_items(RALLY)) if "rally" in parts else ()
        return Plan(
            mission,
            fence_areas(areas),
            places,
            home or seen.home,
            breach_return_place(areas),
            AUTOPILOTS.get(seen.autopilot, 0),
            GROUND_ROVER if seen.kind == "rover" else QUADROTOR,
        )

    def clear(self, only: Collection[str] = PARTS) -> None:
        """Delete what is on board."""
        self.upload(Plan(), only)

    # -- the mission: item numbers in jumps, and an item for home

    def _upload_mission(self, items: tuple[PlanItem, ...]) -> None:
        first = 1 if self._services.home_first else 0
        numbered = [_jump_moved(item, first - 1) for item in items]
        home = [_HOME] if self._services.home_first and items else []
        self._services.upload_items(MISSION, [*home, *numbered])

    def _download_mission(self) -> tuple[tuple[PlanItem, ...], Position | None]:
        """Return the mission, and home where the list begins with it."""
        first = 1 if self._services.home_first else 0
        items = self._services.download_items(MISSION)
        home = None
        if first and items and (items[0].latitude or items[0].longitude):
            home = Position(items[0].latitude, items[0].longitude, AMSL(items[0].z))
        return tuple(_jump_moved(item, 1 - first) for item in items[first:]), home

    def _check_places(self, plan: Plan) -> None:
        places = [
            (f"mission item {number}", Position(item.latitude, item.longitude, _altitude(item)))
            for number, item in enumerate(plan.mission, 1)
            if item.command <= _LAST_NAVIGATION
            and has_global_place(item.command, item.frame)
            and (item.latitude or item.longitude)
        ]
        self._check_all("upload a mission", places)

    def _check_rally(self, plan: Plan) -> None:
        places = [(f"rally point {number}", place) for number, place in enumerate(plan.rally, 1)]
        self._check_all("upload rally points", places)

    def _check_all(self, asked: str, places: list[tuple[str, Position]]) -> None:
        """Check places against limits and fence, which count from home."""
        if places and (self._telemetry.position is None or self._telemetry.home is None):
            raise Refused(
                self._telemetry.name,
                asked,
                "its position is not known, so limits and fence cannot be checked; wait_ready() first",
            )
        for what, place in places:
            self._check(what, place)


def _altitude(item: PlanItem) -> Altitude:
    if item.frame in _TERRAIN:
        return AboveGround(item.z)
    return AMSL(item.z) if item.frame in _ABSOLUTE else AboveHome(item.z)


def _checked(only: Collection[str]) -> Collection[str]:
    parts = (only,) if isinstance(only, str) else tuple(only)
    for part in parts:
        if part not in PARTS:
            raise UsageError(f"no part {part!r} of a plan; there is {choices(PARTS)}")
    return parts


def _jump_moved(item: PlanItem, by: int) -> PlanItem:
    """Return the item with the number that a jump leads to moved by *by*."""
    if item.command != DO_JUMP or not by:
        return item
    target, *rest = item.parameters
    return item._replace(parameters=(target + by, rest[0], rest[1], rest[2]))
