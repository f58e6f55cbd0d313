"""What a check plays on: one vehicle behind a link that can be cut, and whoever else has a hand in it.

A simulated stage is new for every check and lives in virtual time. A real one is the same aircraft for all
checks, in real time; what nobody can do to a real aircraft from here raises ``NotPossibleError``.

The one stage of a real vehicle, in real time, for all checks.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any

from volery.base.errors import CapabilityError, UsageError, VehicleError, VoleryError
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, AboveHome, Altitude, Position
from volery.base.time import S, from_seconds
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import sleep
from volery.kernel.wall import WallKernel
from volery.links.link import Frame, Link
from volery.links.mavlink_messages import constant
from volery.run.assembly.ros_graphs import GRAPHS
from volery.run.assembly.vehicles import EMBEDDED
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.testing.access import ControlledLink, LinkControl
from volery.testing.checks import NotPossibleError, demand
from volery.vehicles import Drone, Rover, Vehicle
from volery.vehicles.address import Address, open_link, parse
from volery.vehicles.driver import Driver, drivers
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
        self._executor = StepExecutor(kernel, driver)
        self.seen: Telemetry = driver.telemetry

    def waits_until_heard(self) -> None:
        """As anybody who has just switched on."""
        heard = self._executor.wait(lambda: self.seen.last_message_ns >= 0, from_seconds(HEARD_WITHIN_S))
        demand(heard, f"on a second link nothing was heard within {HEARD_WITHIN_S:g} s")

    def lands_it(self) -> None:
        """Have it land."""
        self._executor.execute("land", lambda: self._driver.land(300 * S))

    def sender_to(self, place: Position) -> Callable[[], None]:
        """What has it go to *place*. ``NotPossibleError`` where nobody else can."""
        return lambda: self._executor.execute("go", lambda: self._driver.goto(place, None, 300 * S))

    def disarms_it(self) -> None:
        """Stop its motors, wherever it is."""
        self._executor.execute("disarm", lambda: self._driver.disarm(True))

    def moves_home(self, place: Position) -> None:
        """Have it return to *place* (AMSL) from now on. ``NotPossibleError`` if nobody can ask for that."""
        if self._protocol != "MAVLink" or self._link is None:
            raise NotPossibleError(f"home cannot be moved over {self._protocol}")
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
        except (VoleryError, NotPossibleError):
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
    def tap(self) -> LinkControl:
        """The hand on the wire."""

    def other(self) -> Commander:
        """A second commander, who hears the vehicle. Raises ``NotPossibleError`` where there can be none."""
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


class RealStage(Stage):
    """See ``Stage``. *second* is the address of another link to the same vehicle, for other commanders."""

    def __init__(self, address: Address, kind: type[Vehicle], second: str) -> None:
        super().__init__()
        self.kernel: WallKernel = WallKernel()
        self._address, self._kind = address, kind
        self._second = parse(second) if second else None
        if self._second is not None and self._second.driver != address.driver:
            raise UsageError(f"{second} is not a second link to {address}: it names another driver")
        self._tap, self.driver = self._open(address)
        self.drone = kind(self.kernel, address.driver, self.driver)

    def _open(self, address: Address, **more: str) -> tuple[ControlledLink, Driver]:
        if address.carrier in (EMBEDDED, *GRAPHS):
            raise CapabilityError(f"{address}: the checks reach real vehicles over bytes only")
        factory = drivers.load(address.driver)
        if factory.on_link is None:
            raise UsageError(f"{address}: {address.driver} is reached over a graph, not over bytes")
        tap = ControlledLink(open_link(self.kernel, address, factory.codec))
        options = {name: value for name, value in address.options.items() if name != "baud"} | more
        return tap, factory.on_link(self.kernel, tap, address.driver, options)

    @property
    def tap(self) -> ControlledLink:
        """The hand on our end of the link: the vehicle's end is as it is."""
        return self._tap

    def _at_second(self, **more: str) -> tuple[ControlledLink, Driver]:
        if self._second is None:
            raise NotPossibleError("needs a second link to the vehicle: state one with --second URL")
        return self._open(self._second, **more)

    def _commander(self) -> Commander:
        tap, driver = self._at_second()
        return Commander(self.kernel, driver, tap, drivers.load(self._address.driver).codec.name)

    def another_program(self) -> Any:
        """On the second link."""
        return self._kind(self.kernel, self._address.driver, self._at_second()[1])

    def of_system(self, system: int) -> Any:
        """On the second link. Raises ``NotPossibleError`` for drivers that do not ask for a system id."""
        try:
            driver = self._at_second(system=str(system))[1]
        except UsageError as error:
            raise NotPossibleError(f"the driver takes no system id: {error}") from None
        return self._kind(self.kernel, self._address.driver, driver)

    @property
    def flight(self) -> Flight:
        """Nobody can break a real one from here."""
        raise NotPossibleError("only a simulated vehicle can be broken from here")

    @property
    def neighbour(self) -> Any:
        """Nobody knows of one."""
        raise NotPossibleError("needs a second vehicle on the same link")

    def rest(self) -> None:
        """The wire is mended and the vehicle brought down, unless somebody else has it."""
        self._tap.mend()
        super().rest()
        self.drone.come_to_rest()

    def close(self) -> None:
        """Hang up."""
        self.drone.close()
        self.kernel.close()
