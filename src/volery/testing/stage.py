"""Stages of conformance checks: one vehicle behind a link that can be interrupted, and other commanders.

A simulated stage is a new vehicle in a new world for every check and uses virtual time. A real stage is the
same aircraft for all checks, in real time; actions that are impossible with a real aircraft raise
``NotPossibleError``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from volery.base.errors import CapabilityError, UsageError, VehicleError, VoleryError
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, AboveHome, Altitude, Position
from volery.base.time import MINUTE, MS, Ns, S, from_seconds
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import sleep
from volery.kernel.wall import WallKernel
from volery.links.frame import Frame
from volery.links.link import Link
from volery.links.mavlink_messages import constant
from volery.links.wire_faults import WireFaults
from volery.run.assembly.ros_graphs import GRAPHS
from volery.run.assembly.simulated_fleet import fleet_of
from volery.run.assembly.simulated_vehicles import parse_simulated
from volery.run.assembly.vehicles import EMBEDDED, KINDS
from volery.simulation.autopilots.fleet_autopilot import FleetAutopilot
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.testing.access import ControlledLink, WireControl, access_to
from volery.testing.checks import NotPossibleError, demand
from volery.trace.events import Event
from volery.vehicles import Drone, Rover, Vehicle
from volery.vehicles.address import Address, open_link, parse
from volery.vehicles.driver import Driver, drivers
from volery.vehicles.executor import StepExecutor
from volery.vehicles.telemetry import Telemetry, describe_state

FIRST_MESSAGE_S = 10.0
LOOKED_AT_EVERY: Ns = 50 * MS
"""Period at which the clock of a real vehicle is looked at."""
SEEN_WITHIN: Ns = 5 * S
"""Time within which what one link shows is seen on another."""

STATION, CONSOLE = 255, 190
"""Usual system and component id of a ground station on MAVLink."""


class SecondStation:
    """Another ground station with a link of its own, which commands the vehicle at any time."""

    def __init__(self, kernel: Kernel, driver: Driver, link: Link | None = None, protocol: str = "") -> None:
        self._driver = driver
        self._link, self._protocol = link, protocol
        self._executor = StepExecutor(kernel, driver)
        self.seen: Telemetry = driver.telemetry

    def wait_for_message(self) -> None:
        """Wait for the first message of the vehicle."""
        received = self._executor.wait(lambda: self.seen.last_message_ns >= 0, from_seconds(FIRST_MESSAGE_S))
        demand(received, f"no message arrived on a second link within {FIRST_MESSAGE_S:g} s")

    def land(self) -> None:
        """Command the vehicle to land."""
        self._executor.execute("land", lambda: self._driver.land(300 * S))

    def sender_to(self, place: Position) -> Callable[[], None]:
        """Return what sends the vehicle to `place`; ``NotPossibleError`` if another commander cannot."""
        return lambda: self._executor.execute("go", lambda: self._driver.goto(place, None, 300 * S))

    def disarm(self) -> None:
        """Disarm the vehicle by force, also in flight."""
        self._executor.execute("disarm", lambda: self._driver.disarm(True))

    def set_home(self, place: Position) -> None:
        """Set the vehicle's home to `place` (AMSL); ``NotPossibleError`` if the protocol cannot."""
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

    @property
    def has_control(self) -> bool:
        """Whether the vehicle is in the mode that this station has commanded last."""
        return bool(self.seen.mode) and self.seen.mode == self._executor.commanded

    def close(self) -> None:
        """Close the drivers."""
        self._driver.close()


class TestStage(ABC):
    """What a check acts on: a connected vehicle at rest on the ground, time, and other commanders."""

    drone: Any
    """A ``Drone``, or a ``Rover`` for checks of rovers."""
    driver: Driver
    kernel: Kernel

    def __init__(self) -> None:
        self._others: list[SecondStation] = []

    @property
    def name(self) -> str:
        """Name of the vehicle."""
        return str(self.drone.name)

    @property
    def in_the_air(self) -> bool:
        """Whether the vehicle flies; its landed state may be reported after it has disarmed."""
        return bool(self.drone.telemetry.armed and self.drone.telemetry.flying)

    # -- time and place

    def sleep(self, seconds: float) -> None:
        """Block the check for `seconds`."""
        sleep(self.kernel, from_seconds(seconds))

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        """Execute `action` after `seconds` in a task of its own; its errors are ignored."""
        self.kernel.spawn(
            partial(self._after, seconds, action), "another commander", ExecutionContext("another commander")
        )

    def _after(self, seconds: float, action: Callable[[], None]) -> None:
        self.sleep(seconds)
        try:
            action()
        except (VoleryError, NotPossibleError):
            return

    def at(self, north: float, east: float, height: float = 10.0, *, amsl: bool = False) -> Position:
        """Return the position at an offset, m, from home; its altitude is above home or AMSL."""
        home = self.drone.home
        frame = LocalFrame(home.latitude, home.longitude, home.altitude.metres)
        latitude, longitude, _ = frame.from_enu((east, north, 0.0))
        altitude: Altitude = AMSL(home.altitude.metres + height) if amsl else AboveHome(height)
        return Position(latitude, longitude, altitude)

    def offset(self, start: Position, end: Position) -> tuple[float, float, float]:
        """Return the offset from `start` to `end`, both AMSL, in m north, east and up."""
        frame = LocalFrame(start.latitude, start.longitude, start.altitude.metres)
        east, north, up = frame.to_enu(end.latitude, end.longitude, end.altitude.metres)
        return north, east, up

    def until(self, holds: Callable[[], object], within: float, otherwise: str) -> None:
        """Wait until `holds` is true; raise ``CheckFailedError`` with `otherwise` after `within` s."""
        waited = 0.0
        while not holds():
            demand(waited < within, otherwise)
            self.sleep(0.2)
            waited += 0.2

    def until_down(self, within: float) -> None:
        """Land the vehicle; if another commander controls it, wait until it has been landed."""
        try:
            self.drone.land()
        except VehicleError:
            self.until(lambda: not self.drone.armed, within, f"it is not down after {within:g} s")
        demand(not self.drone.armed, "it is armed after landing")

    # -- the wire, and others

    @property
    @abstractmethod
    def link_control(self) -> WireControl:
        """Control over the wire of the program under test."""

    def other(self) -> SecondStation:
        """Return a connected second commander; ``NotPossibleError`` if there can be none."""
        commander = self._commander()
        self._others.append(commander)
        commander.wait_for_message()
        return commander

    @abstractmethod
    def _commander(self) -> SecondStation:
        """Return another commander on a link of its own."""

    @abstractmethod
    def of_system(self, system: int) -> Any:
        """Return the vehicle of another system id on this link, as a program sees it."""

    @abstractmethod
    def another_program(self) -> Any:
        """Return the same vehicle for a program that starts now, on a link of its own."""

    def end_program(self) -> None:
        """End the program under test as a crash does: its link goes silent, the vehicle gets no last word."""
        self.drone.close()

    # -- what only a simulation can do

    @property
    @abstractmethod
    def flight(self) -> Flight:
        """The simulated vehicle, for faults of the aircraft."""

    @property
    @abstractmethod
    def neighbour(self) -> Any:
        """Return a second vehicle on the same link, as its own program sees it."""

    def rest(self) -> None:
        """Restore the stage after a check: link restored, other commanders closed, vehicle landed."""
        for other in self._others:
            other.close()
        self._others.clear()

    @abstractmethod
    def close(self) -> None:
        """Close the drivers."""


def kind_of(name: str) -> type[Vehicle]:
    """``drone`` or ``rover``."""
    kinds: dict[str, type[Vehicle]] = {"drone": Drone, "rover": Rover}
    if name not in kinds:
        raise UsageError(f"no kind of vehicle {name!r}; there is drone or rover")
    return kinds[name]


class RealStage(TestStage):
    """See ``TestStage``. `second` is the address of another link to the vehicle, for others."""

    def __init__(self, address: Address, kind: type[Vehicle], second: str) -> None:
        super().__init__()
        self.kernel: WallKernel = WallKernel()
        self._address, self._kind = address, kind
        self._second = parse(second) if second else None
        if self._second is not None and self._second.driver != address.driver:
            raise UsageError(f"{second} is not a second link to {address}: it names another driver")
        self._start_program()

    def _start_program(self) -> None:
        self._link_control, self.driver = self._open(self._address)
        self.drone = self._kind(self.kernel, self._address.driver, self.driver)
        self._ended = False

    def end_program(self) -> None:
        """See ``TestStage``; ``rest`` starts it again."""
        super().end_program()
        self._ended = True

    def _open(self, address: Address, **more: str) -> tuple[ControlledLink, Driver]:
        if address.transport in (EMBEDDED, *GRAPHS):
            raise CapabilityError(f"{address}: the checks reach real vehicles over bytes only")
        factory = drivers.load(address.driver)
        if factory.on_link is None:
            raise UsageError(f"{address}: {address.driver} is reached over a graph, not over bytes")
        link_control = ControlledLink(open_link(self.kernel, address, factory.codec))
        options = {name: value for name, value in address.options.items() if name != "baud"} | more
        return link_control, factory.on_link(self.kernel, link_control, address.driver, options)

    def sleep(self, seconds: float) -> None:
        """Block the check for `seconds` of the vehicle, whose clock may run faster or slower."""
        seen: Telemetry = self.drone.telemetry
        began, wanted = seen.moment(), from_seconds(seconds)
        while (left := wanted - seen.elapsed(began)) > 0:
            sleep(self.kernel, min(left, LOOKED_AT_EVERY))

    @property
    def link_control(self) -> ControlledLink:
        """Control over this end of the link; the vehicle's end cannot be controlled."""
        return self._link_control

    def _at_second(self, **more: str) -> tuple[ControlledLink, Driver]:
        if self._second is None:
            raise NotPossibleError("needs a second link to the vehicle: state one with --second URL")
        return self._open(self._second, **more)

    def _commander(self) -> SecondStation:
        link_control, driver = self._at_second()
        return SecondStation(self.kernel, driver, link_control, drivers.load(self._address.driver).codec.name)

    def another_program(self) -> Any:
        """Return the vehicle for another program, on the second link."""
        return self._kind(self.kernel, self._address.driver, self._at_second()[1])

    def of_system(self, system: int) -> Any:
        """Return the vehicle of another system id; ``NotPossibleError`` for drivers without system ids."""
        try:
            driver = self._at_second(system=str(system))[1]
        except UsageError as error:
            raise NotPossibleError(f"the driver takes no system id: {error}") from None
        return self._kind(self.kernel, self._address.driver, driver)

    @property
    def flight(self) -> Flight:
        """Raise ``NotPossibleError``: a real aircraft has no faults on command."""
        raise NotPossibleError("only a simulated vehicle can be broken from here")

    @property
    def neighbour(self) -> Any:
        """Raise ``NotPossibleError``: the address of a second vehicle is not known."""
        raise NotPossibleError("needs a second vehicle on the same link")

    def rest(self) -> None:
        """Restore the link and land the vehicle; the other station of a check lands what it has taken.

        Raises:
            VehicleError: A pilot or a station that is not of the checks controls the vehicle in the air.
            LinkError: The link did not return.
        """
        self._link_control.restore()
        if self._ended:
            self._start_program()
            self.drone.wait_connected()
        try:
            said = self.drone.come_to_rest()
            for other in self._others:
                if self.in_the_air and other.has_control:
                    other.land()
                    seen: Telemetry = self.drone.telemetry
                    seen.changed.wait_for(lambda: not self.in_the_air, SEEN_WITHIN)
        finally:
            super().rest()
        if self.in_the_air:
            raise VehicleError(
                self.name, "come to rest", f"it {said}, {describe_state(self.drone.telemetry)}"
            )

    def close(self) -> None:
        """Close the drivers."""
        self.drone.close()
        self.kernel.close()


HUNG_AFTER: Ns = 30 * MINUTE
"""Simulated time after which a check is taken as hanging, ns."""

THROTTLE, MODE_SWITCH = 2, 4
"""RC channels of a transmitter, from 0."""
BOTH_ENDS, THROTTLE_DOWN = 3000, 1100
"""Pulses, us: sum of both ends of the mode switch, of which one is program control; throttle nearly down."""

AWAY_DEG = 0.0005
"""Distance of the neighbour east of the vehicle, degrees of longitude: about 40 m."""


class SafetyPilot(SecondStation):
    """The other commander where all programs share one node: the pilot, who uses mode switch and throttle."""

    def __init__(self, kernel: VirtualKernel, driver: Driver, autopilot: FleetAutopilot) -> None:
        super().__init__(kernel, driver, protocol="a graph")
        self._channels = autopilot.transmitter
        self._away = BOTH_ENDS - self._channels[MODE_SWITCH]

    def land(self) -> None:
        """Land by RC channels."""
        self._channels[MODE_SWITCH] = self._away
        self._channels[THROTTLE] = THROTTLE_DOWN

    def sender_to(self, place: Position) -> Callable[[], None]:
        """Raise ``NotPossibleError``: the set-points of all nodes are one stream to the vehicle."""
        raise NotPossibleError(f"programs share one node, which cannot tell who sent it to {place}")


class SimulatedStage(TestStage):
    """See ``TestStage``. ``events`` has all recorded events."""

    def __init__(
        self,
        address: Address,
        kind: type[Vehicle],
        seed: int,
        *,
        cold: bool = False,
        neighbour: bool = False,
    ) -> None:
        super().__init__()
        self.events: list[Event] = []
        self.kernel: VirtualKernel = VirtualKernel(record=self.events.append)
        options = {**address.options, "start": "cold" if cold else "warm"}
        self._wanted = parse_simulated(replace(address, options=options), address.driver, KINDS[kind])
        all_wanted = [self._wanted, _beside(self._wanted)] if neighbour else [self._wanted]
        self.fleet = fleet_of(self.kernel, all_wanted, seed)
        self._kind = kind
        self._neighbour = all_wanted[1].vehicle.name if neighbour else ""
        self._access = access_to(self.kernel, self.fleet, self._wanted, seed, self._neighbour)
        self.link = self._access.link
        self.driver = self._access.first()
        self.drone = self._kind(self.kernel, self.name_of_vehicle, self.driver)

    @property
    def name_of_vehicle(self) -> str:
        """Name of the vehicle in the simulation."""
        return self._wanted.vehicle.name

    def perform(self, body: Callable[[], str | None]) -> str | None:
        """Run `body` as a task; return its result or raise its exception, ``TimeoutError`` if it hangs."""
        outcome: list[str | Exception | None] = []

        def flow() -> None:
            try:
                outcome.append(body())
            except Exception as error:
                outcome.append(error)

        self.kernel.spawn(flow, "check", ExecutionContext("check"))
        while not outcome:
            if self.kernel.now() >= HUNG_AFTER:
                raise TimeoutError(f"it hangs: not over after {HUNG_AFTER // MINUTE} simulated minutes")
            self.kernel.run(self.kernel.now() + S)
        (found,) = outcome
        if isinstance(found, Exception):
            raise found
        return found

    @property
    def link_control(self) -> WireControl:
        """Control over the wire of the program under test."""
        return self._access.control

    def set_faults(self, faults: WireFaults) -> None:
        """Apply faults to the wire of the program under test from now on."""
        self._access.set_faults(faults)

    def _commander(self) -> SecondStation:
        if self.link is None:
            driver, _ = self._access.another(self.name_of_vehicle)
            return SafetyPilot(self.kernel, driver, self.fleet.autopilots[self.name_of_vehicle])
        driver, link = self._access.another(self.name_of_vehicle)
        return SecondStation(self.kernel, driver, link, self._access.protocol)

    def another_program(self, **options: str) -> Any:
        """Return the vehicle for another program, on a new link or as another node."""
        driver, _ = self._access.another(self.name_of_vehicle, **options)
        return self._kind(self.kernel, self.name_of_vehicle, driver)

    def of_system(self, system: int) -> Any:
        """Return the vehicle of another system id; ``NotPossibleError`` for drivers without system ids."""
        try:
            return self.another_program(system=str(system))
        except UsageError as error:
            raise NotPossibleError(f"the driver takes no system id: {error}") from None

    @property
    def flight(self) -> Flight:
        """Simulated body and sensors of the vehicle."""
        return self.fleet.flights[self.name_of_vehicle]

    @property
    def neighbour(self) -> Any:
        """Return another commander, on a link or node of its own."""
        if not self._neighbour:
            raise NotPossibleError("it is alone")
        driver, _ = self._access.another(self._neighbour)
        self._others.append(SecondStation(self.kernel, driver))
        return self._kind(self.kernel, self._neighbour, driver)

    def close(self) -> None:
        """Close drivers and kernel."""
        self.rest()
        self.drone.close()
        self.fleet.close()
        self.kernel.close()


def _beside(wanted: Any) -> Any:
    at = wanted.vehicle.at
    moved = replace(at, longitude=at.longitude + AWAY_DEG)
    return replace(wanted, vehicle=replace(wanted.vehicle, name="neighbour", at=moved))
