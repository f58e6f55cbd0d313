"""A flight plan as data: waypoints, and blocks of stages. ``Navigation`` runs it.

Stages, exceptions and calls mean what they mean in Paparazzi's flight plans: one stage is looked at each time
navigation runs; a stage that is done gives way to the next; the last one to the next block; an exception is
looked at before the stage and leads to another block.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from volery.base.frames import Vector

if TYPE_CHECKING:
    from volery.simulation.autopilots.paparazzi.navigation import Navigation

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
