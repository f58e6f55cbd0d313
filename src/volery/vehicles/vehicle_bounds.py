"""What is checked before an operation: that its path keeps limits and fence about the present home.

Time-outs of movements are here as well: they follow from the same paths.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite

from volery.base.errors import CapabilityError, OutOfBounds, Refused, UsageError
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.base.time import Ns, from_seconds
from volery.vehicles.driver import (
    Capability,
    Land,
    MissionItem,
    ReturnHome,
    TakeOff,
    Waypoint,
    item_problem,
)
from volery.vehicles.limits import Bounds, Fence, Limits, Path, states_amsl
from volery.vehicles.monitors import Goal
from volery.vehicles.telemetry import Telemetry
from volery.vehicles.vehicle_connection import VehicleConnection

SLOWEST_TRAVEL = 2.5
"""Speed over ground, m/s, that a time-out assumes where no speed is stated."""
SLOWEST_CLIMB = 0.5
MARGIN_S = 30.0


def travel_timeout(distance: float, climb: float, speed: float | None = None) -> Ns:
    """Return the time-out of a movement: half the speed, a climb rate of 0.5 m/s, and a margin.

    Args:
        distance: horizontal distance, m.
        climb: difference of height, m.
        speed: speed over ground, m/s; ``None`` means the autopilot's own.
    """
    across = distance / (speed / 2.0 if speed is not None else SLOWEST_TRAVEL)
    return from_seconds(MARGIN_S + across + abs(climb) / SLOWEST_CLIMB)


def path_timeout(path: Path, speed: float | None) -> Ns:
    """Return the time-out of a movement along a straight path at *speed* m/s."""
    start, end = path
    return travel_timeout(hypot(end[0] - start[0], end[1] - start[1]), end[2] - start[2], speed)


class VehicleBounds:
    """Limits and fence of a vehicle, which nothing that it is commanded to do may leave.

    Args:
        connection: names the vehicle and what it supports.
        telemetry: its telemetry.
        limits: limits about home; may be replaced.
        fence: geofence, if any; may be replaced.
    """

    def __init__(
        self, connection: VehicleConnection, telemetry: Telemetry, limits: Limits, fence: Fence | None
    ) -> None:
        self.limits = limits
        self.fence = fence
        self._connection = connection
        self._telemetry = telemetry
        self._bounds: Bounds | None = None

    def home_bounds(self) -> Bounds | None:
        """Return the bounds about the present home; ``None`` without a home.

        Raises:
            UsageError: the fence excludes home.
        """
        frame = self._telemetry.home_frame
        if frame is None:
            return None
        bounds = self._bounds
        if (
            bounds is None
            or bounds.limits is not self.limits
            or bounds.fence is not self.fence
            or bounds.frame is not frame
        ):
            bounds = self._bounds = Bounds(frame, self.limits, self.fence)
        seen = self._telemetry
        if not seen.amsl_known and self.fence is not None and states_amsl(self.fence):
            raise UsageError(f"{self._connection.name}: the fence states altitudes AMSL: {seen.amsl_remedy}")
        if bounds.home_violation:
            raise UsageError(f"{self._connection.name}: the fence excludes home: {bounds.home_violation}")
        return bounds

    def usable_bounds(self) -> Bounds | None:
        """Return the bounds about the present home; ``None`` without a home, or if they exclude it."""
        try:
            return self.home_bounds()
        except UsageError:
            return None

    def check_path(self, asked: str, start: Position | None, goal: Position) -> Path:
        """Return the straight path; raise ``OutOfBounds`` if it violates limits or fence. *start* is AMSL."""
        if start is None:
            raise self._connection.unknown("its position")
        bounds = self.home_bounds()
        if bounds is None:
            raise self._connection.unknown("its home")
        path = bounds.path(start, goal)
        violation = bounds.path_violation(path, goal)
        if violation:
            raise OutOfBounds(self._connection.name, asked, violation)
        return path

    def timeout_to(self, goal: Position, speed: float | None = None) -> Ns:
        """Return the time-out of a movement from the present position to *goal*."""
        here, bounds = self._telemetry.position, self.home_bounds()
        if here is None or bounds is None:
            return from_seconds(MARGIN_S)
        return path_timeout(bounds.path(here, goal), speed)

    def landing_timeout(self, climb: float) -> Ns:
        """Return the time-out of a landing at 0.5 m/s, as of ArduPilot; an unknown height is the highest."""
        height = self._telemetry.above_home
        height = max(height, 0.0) if isfinite(height) else self.limits.highest
        return travel_timeout(0.0, 2.0 * (height + climb))

    def check_leg(self, asked: str, place: Position) -> None:
        """Raise ``OutOfBounds`` if *place* is out of bounds by itself."""
        self.check_path(asked, self._amsl(place), place)

    def check_altitude(self, goal: Position) -> None:
        """Raise an error if the autopilot cannot go to the altitude of *goal* as it is stated."""
        if isinstance(goal.altitude, Ellipsoidal):
            raise CapabilityError(
                f"{self._connection.name}: {goal.altitude} cannot be flown to: autopilots count from the "
                "geoid; subtract its height there and say AMSL"
            )
        if isinstance(goal.altitude, AboveGround):
            self._connection.require(Capability.TERRAIN)
        seen = self._telemetry
        if isinstance(goal.altitude, AMSL) and not seen.amsl_known:
            raise Refused(self._connection.name, f"go to {goal}", seen.amsl_remedy)

    def check_mission(self, items: Sequence[MissionItem]) -> None:
        """Raise an error if an item is not valid, or the straight path to it leaves the bounds."""
        start = self._connection.known("its position", self._telemetry.position)
        for number, item in enumerate(items, 1):
            asked = f"mission item {number} ({type(item).__name__})"
            problem = item_problem(item)
            if problem:
                raise UsageError(f"{self._connection.name}: {asked}: {problem}")
            if isinstance(item, TakeOff):
                start = Position(start.latitude, start.longitude, AboveHome(item.height))
                self.check_path(asked, self._amsl(start), start)
            elif isinstance(item, Waypoint | Land) and item.position is not None:
                self.check_altitude(item.position)
                self.check_path(asked, self._amsl(start), item.position)
                start = item.position
            elif isinstance(item, ReturnHome):
                home = self._connection.known("its home", self._telemetry.home)
                goal = Position(home.latitude, home.longitude, self._amsl(start).altitude)
                self.check_path(asked, self._amsl(start), goal)
                start = home

    def is_out_of_bounds(self) -> bool:
        """Return whether the vehicle is out of bounds now, so that any way back is allowed."""
        here, bounds = self._telemetry.position, self.home_bounds()
        return here is not None and bounds is not None and bool(bounds.violations(here))

    def _amsl(self, position: Position) -> Position:
        """Return the same place with an AMSL altitude; above ground is taken as above home."""
        if isinstance(position.altitude, AMSL):
            return position
        home = self._connection.known("its home", self._telemetry.home)
        metres = position.altitude.metres + home.altitude.metres
        return Position(position.latitude, position.longitude, AMSL(metres))

    def goal(self, position: Position) -> Goal:
        """Return *position* as the goal of an operation."""
        return Goal(position.latitude, position.longitude, self._amsl(position).altitude.metres)
