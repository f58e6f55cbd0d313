"""The simulated stage: a new vehicle in a new world for each check, in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from volery.base.errors import UsageError
from volery.base.position import Position
from volery.base.time import MINUTE, Ns, S
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.links.wire_faults import WireFaults
from volery.run.assembly.simulated_fleet import fleet_of
from volery.run.assembly.simulated_vehicles import parse_simulated
from volery.run.assembly.vehicles import KINDS
from volery.simulation.autopilots.autopilot import Autopilot
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.testing.access import LinkControl, access_to
from volery.testing.checks import NotPossibleError
from volery.testing.stage import Commander, Stage
from volery.trace.events import Event
from volery.vehicles import Vehicle
from volery.vehicles.address import Address
from volery.vehicles.driver import Driver

HUNG_AFTER: Ns = 30 * MINUTE
"""Simulated time after which a check is taken as hanging, ns."""

THROTTLE, MODE_SWITCH = 2, 4
"""RC channels of a transmitter, from 0."""
BOTH_ENDS, THROTTLE_DOWN = 3000, 1100
"""Pulses, us: sum of both ends of the mode switch, of which one is program control; throttle nearly down."""

AWAY_DEG = 0.0005
"""Distance of the neighbour east of the vehicle, degrees of longitude: about 40 m."""


class SafetyPilot(Commander):
    """The other commander where all programs share one node: the pilot, who uses mode switch and throttle."""

    def __init__(self, kernel: VirtualKernel, driver: Driver, autopilot: Autopilot) -> None:
        super().__init__(kernel, driver, protocol="a graph")
        self._channels = autopilot.vehicle.rc.transmitter
        self._away = BOTH_ENDS - self._channels[MODE_SWITCH]

    def land(self) -> None:
        """Land by RC channels."""
        self._channels[MODE_SWITCH] = self._away
        self._channels[THROTTLE] = THROTTLE_DOWN

    def sender_to(self, place: Position) -> Callable[[], None]:
        """Raise ``NotPossibleError``: the set-points of all nodes are one stream to the vehicle."""
        raise NotPossibleError(f"programs share one node, which cannot tell who sent it to {place}")


class SimulatedStage(Stage):
    """See ``Stage``. ``events`` has all recorded events."""

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
    def link_control(self) -> LinkControl:
        """Control over the wire of the program under test."""
        return self._access.control

    def set_faults(self, faults: WireFaults) -> None:
        """Apply faults to the wire of the program under test from now on."""
        self._access.set_faults(faults)

    def _commander(self) -> Commander:
        if self.link is None:
            driver, _ = self._access.another(self.name_of_vehicle)
            return SafetyPilot(self.kernel, driver, self.fleet.autopilots[self.name_of_vehicle])
        driver, link = self._access.another(self.name_of_vehicle)
        return Commander(self.kernel, driver, link, self._access.protocol)

    def another_program(self) -> Any:
        """Return the vehicle for another program, on a new link or as another node."""
        return self._program()

    def of_system(self, system: int) -> Any:
        """Return the vehicle of another system id; ``NotPossibleError`` for drivers without system ids."""
        try:
            return self._program(system=str(system))
        except UsageError as error:
            raise NotPossibleError(f"the driver takes no system id: {error}") from None

    def _program(self, **options: str) -> Any:
        driver, _ = self._access.another(self.name_of_vehicle, **options)
        return self._kind(self.kernel, self.name_of_vehicle, driver)

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
        self._others.append(Commander(self.kernel, driver))
        return self._kind(self.kernel, self._neighbour, driver)

    def close(self) -> None:
        """Close drivers and kernel."""
        self.rest()
        self.drone.close()
        self.kernel.close()


def _beside(wanted: Any) -> Any:
    at = wanted.vehicle.at
    moved = replace(at, longitude=at.longitude + AWAY_DEG)
    return replace(wanted, vehicle=replace(wanted.vehicle, name="neighbour", at=moved))
