"""What a check plays on: one vehicle behind a link that can be cut, and whoever else has a hand in it.

A simulated stage is new for every check and lives in virtual time. A real one is the same aircraft for all
checks, in real time; what nobody can do to a real aircraft from here raises ``ImpossibleError``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any

from volery.base.errors import UsageError, VehicleError, VoleryError
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, AboveHome, Altitude, Position
from volery.base.time import S, from_seconds
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import sleep
from volery.links.link import Frame, Link
from volery.links.mavlink_messages import constant
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.testing.access import Hand
from volery.testing.checks import ImpossibleError, demand
from volery.vehicles import Drone, Rover, Vehicle
from volery.vehicles.driver import Driver
from volery.vehicles.executor import StepExecutor
from volery.vehicles.telemetry import Telemetry

HEARD_WITHIN_S = 10.0

STATION, CONSOLE = 255, 190
"""Ids that ground stations go by on MAVLink."""


class Commander:
    """Somebody else with a link of his own: another ground station. He does not ask whose vehicle it is."""

    def __init__(self, kernel: Kernel, driver: Driver, link: Link | None = None, protocol: str = "") -> None:
        self._driver = driver
        self._link, self._protocol = link, protocol
        self._performer = StepExecutor(kernel, driver)
        self.seen: Telemetry = driver.telemetry

    def waits_until_heard(self) -> None:
        """As anybody who has just switched on."""
        heard = self._performer.wait(lambda: self.seen.heard >= 0, from_seconds(HEARD_WITHIN_S))
        demand(heard, f"on a second link nothing was heard within {HEARD_WITHIN_S:g} s")

    def lands_it(self) -> None:
        """Have it land."""
        self._performer.perform("land", lambda: self._driver.land(300 * S))

    def sender_to(self, place: Position) -> Callable[[], None]:
        """What has it go to *place*. ``ImpossibleError`` where nobody else can."""
        return lambda: self._performer.perform("go", lambda: self._driver.goto(place, None, 300 * S))

    def disarms_it(self) -> None:
        """Stop its motors, wherever it is."""
        self._performer.perform("disarm", lambda: self._driver.disarm(True))

    def moves_home(self, place: Position) -> None:
        """Have it return to *place* (AMSL) from now on. ``ImpossibleError`` if nobody can ask for that."""
        if self._protocol != "MAVLink" or self._link is None:
            raise ImpossibleError(f"home cannot be moved over {self._protocol}")
        fields = {
            "target_system": self.seen.system,
            "command": constant("MAV_CMD_DO_SET_HOME"),
            "frame": constant("MAV_FRAME_GLOBAL"),
            "x": round(place.latitude * 1e7),
            "y": round(place.longitude * 1e7),
            "z": place.altitude.metres,
        }
        self._link.send(Frame("COMMAND_INT", fields, STATION, CONSOLE))

    def close(self) -> None:
        """Hang up."""
        self._driver.close()


class Stage(ABC):
    """What a check is given. ``drone`` is the vehicle, heard of and at rest on the ground."""

    drone: Any
    """A ``Drone``, or a ``Rover`` for checks of rovers."""
    driver: Driver
    kernel: Kernel

    def __init__(self) -> None:
        self._others: list[Commander] = []

    @property
    def name(self) -> str:
        """The vehicle's."""
        return str(self.drone.name)

    # -- time and place

    def sleep(self, seconds: float) -> None:
        """Let time pass."""
        sleep(self.kernel, from_seconds(seconds))

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        """Do it in so many seconds, beside what the check does. Its refusals are nobody's concern."""
        self.kernel.spawn(
            partial(self._after, seconds, action), "somebody else", ExecutionContext("somebody else")
        )

    def _after(self, seconds: float, action: Callable[[], None]) -> None:
        self.sleep(seconds)
        try:
            action()
        except (VoleryError, ImpossibleError):
            return

    def at(self, north: float, east: float, height: float = 10.0, *, amsl: bool = False) -> Position:
        """So many metres from home, and above it; stated above home or AMSL."""
        home = self.drone.home
        frame = LocalFrame(home.latitude, home.longitude, home.altitude.metres)
        latitude, longitude, _ = frame.from_enu((east, north, 0.0))
        altitude: Altitude = AMSL(home.altitude.metres + height) if amsl else AboveHome(height)
        return Position(latitude, longitude, altitude)

    def offset(self, start: Position, end: Position) -> tuple[float, float, float]:
        """Metres north, east and up from *start* to *end*, both AMSL."""
        frame = LocalFrame(start.latitude, start.longitude, start.altitude.metres)
        east, north, up = frame.to_enu(end.latitude, end.longitude, end.altitude.metres)
        return north, east, up

    def until(self, holds: Callable[[], object], within: float, otherwise: str) -> None:
        """Wait until it *holds*; broken *otherwise*."""
        waited = 0.0
        while not holds():
            demand(waited < within, otherwise)
            self.sleep(0.2)
            waited += 0.2

    def until_down(self, within: float) -> None:
        """Have it land; if somebody else has it, wait until he has brought it down."""
        try:
            self.drone.land()
        except VehicleError:
            self.until(lambda: not self.drone.armed, within, f"it is not down after {within:g} s")
        demand(not self.drone.armed, "it is armed after landing")

    # -- the wire, and others

    @property
    @abstractmethod
    def tap(self) -> Hand:
        """The hand on the wire."""

    def other(self) -> Commander:
        """A second commander, who hears the vehicle. Raises ``ImpossibleError`` where there can be none."""
        commander = self._commander()
        self._others.append(commander)
        commander.waits_until_heard()
        return commander

    @abstractmethod
    def _commander(self) -> Commander:
        """On a link of his own."""

    @abstractmethod
    def of_system(self, system: int) -> Any:
        """The vehicle of another system id, as a program sees it that looks for it here."""

    @abstractmethod
    def another_program(self) -> Any:
        """The same vehicle as a program sees it that starts now, on a link of its own."""

    # -- what only a simulation can do

    @property
    @abstractmethod
    def flight(self) -> Flight:
        """The simulated vehicle itself, to break something of it."""

    @property
    @abstractmethod
    def neighbour(self) -> Any:
        """A second vehicle that is heard on the same link, as its own program sees it."""

    def rest(self) -> None:
        """After a check: the wire is mended, others hang up, the vehicle comes down."""
        for other in self._others:
            other.close()
        self._others.clear()

    @abstractmethod
    def close(self) -> None:
        """Hang up."""


def kind_of(name: str) -> type[Vehicle]:
    """``drone`` or ``rover``."""
    kinds: dict[str, type[Vehicle]] = {"drone": Drone, "rover": Rover}
    if name not in kinds:
        raise UsageError(f"no kind of vehicle {name!r}; there is drone or rover")
    return kinds[name]
