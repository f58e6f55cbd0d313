"""What is checked before an operation: bounds, altitudes, speeds, missions and other arguments.

Time-outs of movements are here as well: they follow from the same paths.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite

from volery.base.errors import CapabilityError, OutOfBounds, Refused, UsageError
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.base.time import Ns, from_seconds
from volery.kernel.api import Kernel
from volery.vehicles.driver import (
    Capability,
    Driver,
    Land,
    MissionItem,
    ReturnHome,
    TakeOff,
    Waypoint,
    item_problem,
)
from volery.vehicles.executor import Goal
from volery.vehicles.limits import Bounds, Fence, Limits, Path, is_number, states_amsl
from volery.vehicles.observed_vehicle import ObservedVehicle

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


class BoundedVehicle(ObservedVehicle):
    """A vehicle with limits and a fence, which nothing that it is commanded to do may leave.

    Args:
        kernel: clock and tasks.
        name: name of the vehicle in messages and in the trace.
        driver: driver of its autopilot.
        link_timeout: time without a message after which the link counts as lost, ns.
        limits: limits about home.
        fence: geofence, if any.
    """

    def __init__(
        self, kernel: Kernel, name: str, driver: Driver, link_timeout: Ns, limits: Limits, fence: Fence | None
    ) -> None:
        super().__init__(kernel, name, driver, link_timeout)
        self.limits = limits
        self.fence = fence
        self._bounds: Bounds | None = None

    def _home_bounds(self) -> Bounds | None:
        """Return the bounds about the present home; ``None`` without a home.

        Raises:
            UsageError: the fence excludes home.
        """
        home = self._driver.telemetry.home
        if home is None:
            return None
        bounds = self._bounds
        if (
            bounds is None
            or bounds.limits is not self.limits
            or bounds.fence is not self.fence
            or bounds.home != home
        ):
            bounds = self._bounds = Bounds(home, self.limits, self.fence)
        seen = self._driver.telemetry
        if not seen.amsl_known and self.fence is not None and states_amsl(self.fence):
            raise UsageError(f"{self.name}: the fence states altitudes AMSL: {seen.amsl_remedy}")
        if bounds.home_violation:
            raise UsageError(f"{self.name}: the fence excludes home: {bounds.home_violation}")
        return bounds

    def _usable_bounds(self) -> Bounds | None:
        """Return the bounds about the present home; ``None`` without a home, or if they exclude it."""
        try:
            return self._home_bounds()
        except UsageError:
            return None

    def _check_path(self, asked: str, start: Position | None, goal: Position) -> Path:
        """Return the straight path; raise ``OutOfBounds`` if it violates limits or fence. *start* is AMSL."""
        if start is None:
            raise self._unknown("its position")
        bounds = self._home_bounds()
        if bounds is None:
            raise self._unknown("its home")
        path = bounds.path(start, goal)
        violation = bounds.path_violation(path, goal)
        if violation:
            raise OutOfBounds(self.name, asked, violation)
        return path

    def _timeout_to(self, goal: Position, speed: float | None = None) -> Ns:
        """Return the time-out of a movement from the present position to *goal*."""
        here, bounds = self._driver.telemetry.position, self._home_bounds()
        if here is None or bounds is None:
            return from_seconds(MARGIN_S)
        return path_timeout(bounds.path(here, goal), speed)

    def _landing_timeout(self, climb: float) -> Ns:
        """Return the time-out of a landing at 0.5 m/s, as of ArduPilot; an unknown height is the highest."""
        height = self._driver.telemetry.above_home
        height = max(height, 0.0) if isfinite(height) else self.limits.highest
        return travel_timeout(0.0, 2.0 * (height + climb))

    def _check_leg(self, asked: str, place: Position) -> None:
        self._check_path(asked, self._amsl(place), place)

    def _check_altitude(self, goal: Position) -> None:
        if isinstance(goal.altitude, Ellipsoidal):
            raise CapabilityError(
                f"{self.name}: {goal.altitude} cannot be flown to: autopilots count from the geoid; "
                f"subtract its height there and say AMSL"
            )
        if isinstance(goal.altitude, AboveGround):
            self._connect(Capability.TERRAIN)
        seen = self._driver.telemetry
        if isinstance(goal.altitude, AMSL) and not seen.amsl_known:
            raise Refused(self.name, f"go to {goal}", seen.amsl_remedy)

    def _check_numbers(self, call: str, *numbers: object, example: str) -> None:
        """Raise ``UsageError`` unless all are finite numbers: programs and consoles have no type checker.

        Args:
            call: the call as it was written.
            numbers: the arguments that are numbers.
            example: a valid call.
        """
        for number in numbers:
            if not is_number(number):
                raise UsageError(
                    f"{self.name}: {call}: {number!r} is not a finite number; write it as in {example}"
                )

    def _check_speed(self, asked: str, speed: float) -> None:
        self._connect(Capability.SPEED)
        self._check_numbers(f"{asked}: speed={speed!r}", speed, example="speed=5.0, in m/s")
        if speed <= 0:
            raise UsageError(f"{self.name}: {asked}: a speed of {speed:g} m/s; give one above 0")

    def _check_mission(self, items: Sequence[MissionItem]) -> None:
        start = self._known("its position", self._driver.telemetry.position)
        for number, item in enumerate(items, 1):
            asked = f"mission item {number} ({type(item).__name__})"
            problem = item_problem(item)
            if problem:
                raise UsageError(f"{self.name}: {asked}: {problem}")
            if isinstance(item, TakeOff):
                start = Position(start.latitude, start.longitude, AboveHome(item.height))
                self._check_path(asked, self._amsl(start), start)
            elif isinstance(item, Waypoint | Land) and item.position is not None:
                self._check_altitude(item.position)
                self._check_path(asked, self._amsl(start), item.position)
                start = item.position
            elif isinstance(item, ReturnHome):
                home = self._known("its home", self._driver.telemetry.home)
                goal = Position(home.latitude, home.longitude, self._amsl(start).altitude)
                self._check_path(asked, self._amsl(start), goal)
                start = home

    def _is_out_of_bounds(self) -> bool:
        """Return whether the vehicle is out of bounds now, so that any way back is allowed."""
        here, bounds = self._driver.telemetry.position, self._home_bounds()
        return here is not None and bounds is not None and bool(bounds.violations(here))

    def _amsl(self, position: Position) -> Position:
        """Return the same place with an AMSL altitude; above ground is taken as above home."""
        if isinstance(position.altitude, AMSL):
            return position
        home = self._known("its home", self._driver.telemetry.home)
        metres = position.altitude.metres + home.altitude.metres
        return Position(position.latitude, position.longitude, AMSL(metres))

    def _goal(self, position: Position) -> Goal:
        return Goal(position.latitude, position.longitude, self._amsl(position).altitude.metres)
