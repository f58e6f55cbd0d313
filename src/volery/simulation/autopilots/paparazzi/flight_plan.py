"""A flight plan as data: waypoints, and blocks of stages. ``Navigation`` runs it.

Stages, exceptions and calls mean what they mean in Paparazzi's flight plans: one stage is looked at each time
navigation runs; a stage that is done gives way to the next; the last one to the next block; an exception is
looked at before the stage and leads to another block.

Runs a flight plan, sixteen times a second, and says what is to be flown: a target, and how high.

It runs in every mode but HOME, as in the firmware: only NAV flies what it says. Coordinates are metres east,
north, up about the local origin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import atan2, cos, dist, hypot, pi, radians, sin
from typing import TYPE_CHECKING, NamedTuple, Protocol

from volery.base.frames import Vector, ned_to_enu, wrap
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.vehicle_state import Vehicle

if TYPE_CHECKING:
    pass

Condition = Callable[["Navigation"], bool]
Call = Callable[["Navigation"], None]


def never(_navigation: Navigation) -> bool:
    """Until somebody jumps to another block."""
    return False


class Stage(Protocol):
    """One element of a block."""

    def run(self, nav: Navigation) -> bool:
        """Say what is to be flown now; True once it is done."""


@dataclass(frozen=True)
class While:
    """Wait as long as *condition* holds."""

    condition: Condition

    def run(self, nav: Navigation) -> bool:
        """Nothing is flown."""
        return not self.condition(nav)


@dataclass(frozen=True)
class Once:
    """Do something."""

    call: Call

    def run(self, nav: Navigation) -> bool:
        """Done at once."""
        self.call(nav)
        return True


@dataclass(frozen=True)
class Idle:
    """Level, with the throttle closed: motors that are on turn slowly."""

    def run(self, nav: Navigation) -> bool:
        """Until somebody jumps to another block."""
        nav.close_throttle()
        return False


@dataclass(frozen=True)
class Stay:
    """Over a waypoint at its height; with *climb* (a parameter: m/s up), climbing or sinking instead."""

    waypoint: str
    climb: str | None = None
    until: Condition = never

    def run(self, nav: Navigation) -> bool:
        """Stay."""
        if self.until(nav):
            return True
        nav.fly_to(self.waypoint, climb=self.climb)
        return False


@dataclass(frozen=True)
class Go:
    """To a waypoint, straight, or along the line from another."""

    waypoint: str
    start: str | None = None

    def run(self, nav: Navigation) -> bool:
        """Until it is near or has passed it."""
        if nav.approaching(self.waypoint, self.start):
            return True
        if self.start is None:
            nav.fly_to(self.waypoint)
        else:
            nav.fly_route(nav.point(self.start), nav.point(self.waypoint))
        return False


@dataclass(frozen=True)
class Circle:
    """About a waypoint, with the radius that a parameter states; clockwise if it is positive."""

    waypoint: str
    radius: str = "DEFAULT_CIRCLE_RADIUS"
    until: Condition = never

    def run(self, nav: Navigation) -> bool:
        """Circle."""
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
        """Until somebody jumps to another block."""
        nav.fly_oval(nav.point(self.first), nav.point(self.second), nav.vehicle.parameters[self.radius])
        return False


@dataclass(frozen=True)
class Heading:
    """Turn the nose to a course [degrees clockwise from north] over a waypoint."""

    course: float
    waypoint: str
    until: Condition

    def run(self, nav: Navigation) -> bool:
        """Until the condition holds."""
        if self.until(nav):
            return True
        nav.head_for(self.course)
        nav.fly_to(self.waypoint)
        return False


@dataclass(frozen=True)
class Deroute:
    """Go on with another block."""

    block: str

    def run(self, nav: Navigation) -> bool:
        """Jump."""
        nav.go_to_block(self.block)
        return False


@dataclass(frozen=True)
class Block:
    """Stages in order. ``exceptions``: when, and which block then."""

    name: str
    stages: tuple[Stage, ...]
    exceptions: tuple[tuple[Condition, str], ...] = ()


@dataclass(frozen=True)
class FlightPlan:
    """Waypoints are numbered from 1 in order, as east, north, up about the local origin [m]."""

    waypoints: dict[str, Vector]
    blocks: tuple[Block, ...]

    def block_number(self, name: str) -> int:
        """Where the block of that name stands."""
        return next(number for number, block in enumerate(self.blocks) if block.name == name)

    def waypoint_number(self, name: str) -> int:
        """The number of the waypoint of that name."""
        return 1 + list(self.waypoints).index(name)


CARROT_M = 12.0
"""So far ahead on a line or a circle lies the point that it flies to."""
WAYPOINT, ROUTE, CIRCLE, ATTITUDE = range(4)
"""ROTORCRAFT_NAV_STATUS.horizontal_mode."""
HOME_WAYPOINT = "HOME"


class Vertical(Enum):
    """What holds the height."""

    ALTITUDE = "altitude"
    CLIMB = "climb"
    THROTTLE = "throttle"
    """Closed."""


class Demand(NamedTuple):
    """What the plan wants flown now. ``goal`` is the waypoint behind the target; ``climb`` m/s up."""

    horizontal: int
    vertical: Vertical
    target: Vector = (0.0, 0.0, 0.0)
    goal: Vector = (0.0, 0.0, 0.0)
    climb: float = 0.0


CLOSED = Demand(ATTITUDE, Vertical.THROTTLE)


class Navigation:
    """One vehicle's flight plan and where it is in it."""

    def __init__(self, vehicle: Vehicle, plan: FlightPlan) -> None:
        self.vehicle = vehicle
        self.plan = plan
        self.waypoints: list[Vector] = [(0.0, 0.0, 0.0), *plan.waypoints.values()]
        """By number; there is no number 0."""
        self.block = 0
        self.stage = 0
        self.demand = CLOSED
        self.heading = 0.0
        self._block_at: Ns = vehicle.kernel.now()
        self._stage_at: Ns = self._block_at
        self._oval_leg = 0

    # -- the plan

    def step(self) -> None:
        """Look at exceptions, then at the stage."""
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
        """Go on with that block; a number that the plan does not have changes nothing."""
        if 0 <= number < len(self.plan.blocks):
            self.block, self.stage = number, 0
            self._block_at = self.vehicle.kernel.now()
            self._begin_stage()

    def go_to_block(self, name: str) -> None:
        """Go on with the block of that name."""
        self.jump(self.plan.block_number(name))

    def _begin_stage(self) -> None:
        self._stage_at = self.vehicle.kernel.now()
        self._oval_leg = 0

    @property
    def block_time(self) -> float:
        """Seconds in this block."""
        return to_seconds(self.vehicle.kernel.now() - self._block_at)

    @property
    def stage_time(self) -> float:
        """Seconds in this stage."""
        return to_seconds(self.vehicle.kernel.now() - self._stage_at)

    # -- places

    @property
    def position(self) -> Vector:
        """East, north, up about the local origin [m]."""
        return ned_to_enu(self.vehicle.estimate.position)

    def point(self, name: str) -> Vector:
        """A waypoint as it stands now."""
        return self.waypoints[self.plan.waypoint_number(name)]

    def move(self, number: int, point: Vector) -> bool:
        """Put that waypoint elsewhere; False if there is none of that number."""
        if not 1 <= number < len(self.waypoints):
            return False
        self.waypoints[number] = point
        return True

    def set_here(self, name: str) -> None:
        """Put a waypoint where the vehicle is, at its own height."""
        east, north, _ = self.position
        self.move(self.plan.waypoint_number(name), (east, north, self.point(name)[2]))

    def from_home(self) -> float:
        """Metres in the plane from the waypoint HOME."""
        return dist(self.position[:2], self.point(HOME_WAYPOINT)[:2])

    def from_goal(self) -> float:
        """Metres in the plane from the waypoint that it flies to; 0 where it flies to none."""
        if self.demand.vertical is Vertical.THROTTLE:
            return 0.0
        return dist(self.position[:2], self.demand.goal[:2])

    def approaching(self, name: str, start: str | None) -> bool:
        """Near the waypoint, or past it on the way from *start*."""
        goal, here = self.point(name), self.position
        east, north = goal[0] - here[0], goal[1] - here[1]
        if hypot(east, north) < self.vehicle.tuning.waypoint_radius:
            return True
        if start is None:
            return False
        begin = self.point(start)
        return east * (goal[0] - begin[0]) + north * (goal[1] - begin[1]) < 0.0

    # -- what is to be flown

    def close_throttle(self) -> None:
        """Level, motors idle."""
        self.demand = CLOSED

    def fly_to(self, name: str, climb: str | None = None) -> None:
        """To a waypoint at its height, or over it climbing at the speed that a parameter states."""
        goal = self.point(name)
        if climb is None:
            self.demand = Demand(WAYPOINT, Vertical.ALTITUDE, goal, goal)
        else:
            speed = self.vehicle.parameters[climb]
            self.demand = Demand(WAYPOINT, Vertical.CLIMB, goal, goal, speed)

    def fly_home(self) -> None:
        """To the waypoint HOME."""
        self.fly_to(HOME_WAYPOINT)

    def head_for(self, course: float) -> None:
        """Turn the nose there: degrees clockwise from north."""
        self.heading = wrap(radians(course))

    def fly_route(self, start: Vector, end: Vector) -> None:
        """Along a line: to a point ahead on it."""
        self.demand = Demand(ROUTE, Vertical.ALTITUDE, self._on_line(start, end), end)

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
        """About a point: to a point ahead on the circle. Clockwise if *radius* is positive."""
        here, size = self.position, max(0.1, abs(radius))
        ahead = min(pi / 4.0, max(pi / 16.0, CARROT_M / size))
        angle = atan2(here[1] - centre[1], here[0] - centre[0]) - (ahead if radius > 0.0 else -ahead)
        target = centre[0] + size * cos(angle), centre[1] + size * sin(angle), centre[2]
        self.demand = Demand(CIRCLE, Vertical.ALTITUDE, target, centre)

    def fly_oval(self, first: Vector, second: Vector, radius: float) -> None:
        """A leg to the left of the line, half a circle, the other leg, half a circle."""
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
            done = self._faces(centre, end)
            self.fly_circle(centre, radius)
        if done:
            self._oval_leg = (self._oval_leg + 1) % 4

    def _faces(self, centre: Vector, end: Vector) -> bool:
        """Whether it is in the direction of *end*, seen from the centre of a circle: within 26 degrees."""
        away = self.position[0] - centre[0], self.position[1] - centre[1]
        towards = end[0] - centre[0], end[1] - centre[1]
        return away[0] * towards[0] + away[1] * towards[1] > 0.9 * hypot(*away) * hypot(*towards)

    def _past(self, start: Vector, end: Vector) -> bool:
        here = self.position
        return (here[0] - end[0]) * (end[0] - start[0]) + (here[1] - end[1]) * (end[1] - start[1]) > 0.0


def _beside(point: Vector, aside: tuple[float, float], share: float) -> Vector:
    return point[0] + share * aside[0], point[1] + share * aside[1], point[2]
