"""Flight plans as data (waypoints, blocks of stages), and ``Navigation``, which runs them at 16 Hz.

Stages, exceptions and calls have the meaning of Paparazzi's flight plans. Each run of the navigation executes
one stage; a finished stage is followed by the next one, the last stage by the next block. Exceptions are
checked before the stage and lead to another block. The navigation runs in every mode but HOME, as in the
firmware; only NAV flies its demand. Coordinates are east-north-up about the local origin [m].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import dist, hypot, pi, radians
from typing import TYPE_CHECKING, NamedTuple, Protocol

from volery.base.elementary import atan2, cos, sin
from volery.base.frames import Vector, ned_to_enu, wrap
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

if TYPE_CHECKING:
    pass

Condition = Callable[["Navigation"], bool]
Call = Callable[["Navigation"], None]


def never(_navigation: Navigation) -> bool:
    """Return False: the stage lasts until another block is entered."""
    return False


class PlanStage(Protocol):
    """One element of a block."""

    def run(self, nav: Navigation) -> bool:
        """Set the demand, and return whether the stage is done."""


@dataclass(frozen=True)
class While:
    """Wait while a condition holds."""

    condition: Condition

    def run(self, nav: Navigation) -> bool:
        """Return whether the condition has ended."""
        return not self.condition(nav)


@dataclass(frozen=True)
class Once:
    """Call a function once."""

    call: Call

    def run(self, nav: Navigation) -> bool:
        """Call the function, and return True."""
        self.call(nav)
        return True


@dataclass(frozen=True)
class MotorsIdle:
    """Level with closed throttle: running motors idle."""

    def run(self, nav: Navigation) -> bool:
        """Close the throttle; the stage lasts until another block is entered."""
        nav.close_throttle()
        return False


@dataclass(frozen=True)
class Stay:
    """Stay over a waypoint at its height, or climb at the rate of the parameter ``climb`` [m/s]."""

    waypoint: str
    climb: str | None = None
    until: Condition = never

    def run(self, nav: Navigation) -> bool:
        """Stay until the condition holds."""
        if self.until(nav):
            return True
        nav.fly_to(self.waypoint, climb=self.climb)
        return False


@dataclass(frozen=True)
class Go:
    """Fly to a waypoint, straight or along the line from another waypoint."""

    waypoint: str
    start: str | None = None

    def run(self, nav: Navigation) -> bool:
        """Fly until the waypoint is near or passed."""
        if nav.approaching(self.waypoint, self.start):
            return True
        if self.start is None:
            nav.fly_to(self.waypoint)
        else:
            nav.fly_route(nav.point(self.start), nav.point(self.waypoint))
        return False


@dataclass(frozen=True)
class CircleWaypoint:
    """Circle a waypoint with the radius of a parameter; clockwise if positive."""

    waypoint: str
    radius: str = "DEFAULT_CIRCLE_RADIUS"
    until: Condition = never

    def run(self, nav: Navigation) -> bool:
        """Circle until the condition holds."""
        if self.until(nav):
            return True
        nav.fly_circle(nav.point(self.waypoint), nav.vehicle.parameters[self.radius])
        return False


@dataclass(frozen=True)
class Oval:
    """Two legs beside the line between two waypoints, and a half circle about each."""

    first: str
    second: str
    radius: str = "DEFAULT_CIRCLE_RADIUS"

    def run(self, nav: Navigation) -> bool:
        """Fly the oval; the stage lasts until another block is entered."""
        nav.fly_oval(nav.point(self.first), nav.point(self.second), nav.vehicle.parameters[self.radius])
        return False


@dataclass(frozen=True)
class Heading:
    """Point the nose to a course [deg clockwise from north] over a waypoint."""

    course: float
    waypoint: str
    until: Condition

    def run(self, nav: Navigation) -> bool:
        """Hold the heading until the condition holds."""
        if self.until(nav):
            return True
        nav.head_for(self.course)
        nav.fly_to(self.waypoint)
        return False


@dataclass(frozen=True)
class Deroute:
    """Continue with another block."""

    block: str

    def run(self, nav: Navigation) -> bool:
        """Enter the block."""
        nav.go_to_block(self.block)
        return False


@dataclass(frozen=True)
class PlanBlock:
    """Stages in order, and exceptions as pairs of condition and block."""

    name: str
    stages: tuple[PlanStage, ...]
    exceptions: tuple[tuple[Condition, str], ...] = ()


@dataclass(frozen=True)
class FlightPlan:
    """Waypoints (numbered from 1 in order) and blocks."""

    waypoints: dict[str, Vector]
    blocks: tuple[PlanBlock, ...]

    def block_number(self, name: str) -> int:
        """Return the number of a block."""
        return next(number for number, block in enumerate(self.blocks) if block.name == name)

    def waypoint_number(self, name: str) -> int:
        """Return the number of a waypoint."""
        return 1 + list(self.waypoints).index(name)


CARROT_M = 12.0
"""Distance of the target point ahead on a line or circle (Paparazzi's carrot) [m]."""
WAYPOINT, ROUTE, CIRCLE, ATTITUDE = range(4)
"""Values of ROTORCRAFT_NAV_STATUS.horizontal_mode."""
HOME_WAYPOINT = "HOME"


class Vertical(Enum):
    """What controls the height."""

    ALTITUDE = "altitude"
    CLIMB = "climb"
    THROTTLE = "throttle"
    """Closed throttle."""


class PlanDemand(NamedTuple):
    """Demand of the flight plan: target, the waypoint behind it, and climb rate [m/s]."""

    horizontal: int
    vertical: Vertical
    target: Vector = (0.0, 0.0, 0.0)
    goal: Vector = (0.0, 0.0, 0.0)
    climb: float = 0.0


CLOSED = PlanDemand(ATTITUDE, Vertical.THROTTLE)


class Navigation:
    """One vehicle's flight plan and its progress."""

    def __init__(self, vehicle: AutopilotVehicle, plan: FlightPlan) -> None:
        self.vehicle = vehicle
        self.plan = plan
        self.waypoints: list[Vector] = [(0.0, 0.0, 0.0), *plan.waypoints.values()]
        """By number; number 0 is unused."""
        self.block = 0
        self.stage = 0
        self.demand = CLOSED
        self.heading = 0.0
        self._block_at: Ns = vehicle.kernel.now()
        self._stage_at: Ns = self._block_at
        self._oval_leg = 0

    # -- progress

    def step(self) -> None:
        """Check the exceptions, then run the stage."""
        block = self.plan.blocks[self.block]
        for condition, instead in block.exceptions:
            if condition(self):
                self.go_to_block(instead)
                return
        if self.stage < len(block.stages):
            if block.stages[self.stage].run(self):
                self.stage += 1
                self._begin_stage()
        elif self.block + 1 < len(self.plan.blocks):
            self.jump(self.block + 1)

    def jump(self, number: int) -> None:
        """Enter a block by number; an invalid number has no effect."""
        if 0 <= number < len(self.plan.blocks):
            self.block, self.stage = number, 0
            self._block_at = self.vehicle.kernel.now()
            self._begin_stage()

    def go_to_block(self, name: str) -> None:
        """Enter a block by name."""
        self.jump(self.plan.block_number(name))

    def _begin_stage(self) -> None:
        self._stage_at = self.vehicle.kernel.now()
        self._oval_leg = 0

    @property
    def block_time(self) -> float:
        """Time in this block [s]."""
        return to_seconds(self.vehicle.kernel.now() - self._block_at)

    @property
    def stage_time(self) -> float:
        """Time in this stage [s]."""
        return to_seconds(self.vehicle.kernel.now() - self._stage_at)

    # -- positions

    @property
    def position(self) -> Vector:
        """Estimated position, east-north-up about the local origin [m]."""
        return ned_to_enu(self.vehicle.estimate.position)

    def point(self, name: str) -> Vector:
        """Return the present position of a waypoint."""
        return self.waypoints[self.plan.waypoint_number(name)]

    def move(self, number: int, point: Vector) -> bool:
        """Move a waypoint, and return whether it exists."""
        if not 1 <= number < len(self.waypoints):
            return False
        self.waypoints[number] = point
        return True

    def set_here(self, name: str) -> None:
        """Move a waypoint to the vehicle, at the height of the waypoint."""
        east, north, _ = self.position
        self.move(self.plan.waypoint_number(name), (east, north, self.point(name)[2]))

    def from_home(self) -> float:
        """Return the horizontal distance from the waypoint HOME [m]."""
        return dist(self.position[:2], self.point(HOME_WAYPOINT)[:2])

    def from_goal(self) -> float:
        """Return the horizontal distance from the present waypoint [m]; 0 without one."""
        if self.demand.vertical is Vertical.THROTTLE:
            return 0.0
        return dist(self.position[:2], self.demand.goal[:2])

    def approaching(self, name: str, start: str | None) -> bool:
        """Return whether the waypoint is near, or passed on the way from ``start``."""
        goal, here = self.point(name), self.position
        east, north = goal[0] - here[0], goal[1] - here[1]
        if hypot(east, north) < self.vehicle.tuning.waypoint_radius:
            return True
        if start is None:
            return False
        begin = self.point(start)
        return east * (goal[0] - begin[0]) + north * (goal[1] - begin[1]) < 0.0

    # -- demands

    def close_throttle(self) -> None:
        """Demand level flight with idling motors."""
        self.demand = CLOSED

    def fly_to(self, name: str, climb: str | None = None) -> None:
        """Demand a waypoint at its height, or over it a climb at the rate of a parameter."""
        goal = self.point(name)
        if climb is None:
            self.demand = PlanDemand(WAYPOINT, Vertical.ALTITUDE, goal, goal)
        else:
            speed = self.vehicle.parameters[climb]
            self.demand = PlanDemand(WAYPOINT, Vertical.CLIMB, goal, goal, speed)

    def fly_home(self) -> None:
        """Demand the waypoint HOME."""
        self.fly_to(HOME_WAYPOINT)

    def head_for(self, course: float) -> None:
        """Set the heading [deg clockwise from north]."""
        self.heading = wrap(radians(course))

    def fly_route(self, start: Vector, end: Vector) -> None:
        """Demand a line: a target point ahead on it."""
        self.demand = PlanDemand(ROUTE, Vertical.ALTITUDE, self._on_line(start, end), end)

    def _on_line(self, start: Vector, end: Vector) -> Vector:
        east, north = end[0] - start[0], end[1] - start[1]
        length = hypot(east, north)
        if length == 0.0:
            return end
        here = self.position
        along = ((here[0] - start[0]) * east + (here[1] - start[1]) * north) / length
        share = min(1.0, max(0.0, (along + CARROT_M) / length))
        return start[0] + east * share, start[1] + north * share, end[2]

    def fly_circle(self, centre: Vector, radius: float) -> None:
        """Demand a circle: a target point ahead on it; clockwise if ``radius`` [m] is positive."""
        here, size = self.position, max(0.1, abs(radius))
        ahead = min(pi / 4.0, max(pi / 16.0, CARROT_M / size))
        angle = atan2(here[1] - centre[1], here[0] - centre[0]) - (ahead if radius > 0.0 else -ahead)
        target = centre[0] + size * cos(angle), centre[1] + size * sin(angle), centre[2]
        self.demand = PlanDemand(CIRCLE, Vertical.ALTITUDE, target, centre)

    def fly_oval(self, first: Vector, second: Vector, radius: float) -> None:
        """Demand an oval: leg left of the line, half circle, other leg, half circle."""
        east, north = second[0] - first[0], second[1] - first[1]
        length = hypot(east, north) or 1.0
        aside = -north / length * radius, east / length * radius
        there = _beside(first, aside, 1.0), _beside(second, aside, 1.0)
        back = _beside(second, aside, -1.0), _beside(first, aside, -1.0)
        if self._oval_leg % 2 == 0:
            start, end = there if self._oval_leg == 0 else back
            done = self._past(start, end)
            self.fly_route(start, end)
        else:
            centre, end = (second, back[0]) if self._oval_leg == 1 else (first, there[0])
            done = self._is_towards(centre, end)
            self.fly_circle(centre, radius)
        if done:
            self._oval_leg = (self._oval_leg + 1) % 4

    def _is_towards(self, centre: Vector, end: Vector) -> bool:
        """Return whether the vehicle is within 26 degrees of the direction from ``centre`` to ``end``."""
        away = self.position[0] - centre[0], self.position[1] - centre[1]
        towards = end[0] - centre[0], end[1] - centre[1]
        return away[0] * towards[0] + away[1] * towards[1] > 0.9 * hypot(*away) * hypot(*towards)

    def _past(self, start: Vector, end: Vector) -> bool:
        here = self.position
        return (here[0] - end[0]) * (end[0] - start[0]) + (here[1] - end[1]) * (end[1] - start[1]) > 0.0


def _beside(point: Vector, aside: tuple[float, float], share: float) -> Vector:
    return point[0] + share * aside[0], point[1] + share * aside[1], point[2]
