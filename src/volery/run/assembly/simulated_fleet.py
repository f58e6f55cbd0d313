"""The vehicles of a run: their bodies in one world, and for each the simulated autopilot that flies it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import cos, pi, radians, sin

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.links.in_process_link import in_process_pair
from volery.links.link import Codec, Link
from volery.model.environment import Battery as BatteryModel
from volery.model.environment import Vehicle as VehicleModel
from volery.model.environment import Wind as WindModel
from volery.run.assembly.simulated_vehicles import LINK_DELAY, SimulatedVehicle
from volery.run.progress import VehicleProgress
from volery.run.result import SAMPLING_PERIOD
from volery.simulation.autopilots.autopilot import Autopilot
from volery.simulation.autopilots.firmware import FirmwareFamily, firmwares
from volery.simulation.autopilots.flight_stack.flight import Flight, make_world
from volery.simulation.world.body_specs import Battery, BodySpec, Multirotor, Rover
from volery.simulation.world.environment_models import Wind
from volery.simulation.world.world import World

CELL_NOMINAL_VOLTS = 3.7


class SimulatedFleet:
    """Simulated vehicles, by name, in the order of the model.

    Their system ids count from 1, except for those that *systems* states.
    """

    def __init__(
        self,
        kernel: Kernel,
        vehicles: Sequence[VehicleModel],
        frame: LocalFrame,
        wind: WindModel,
        seed: int,
        *,
        systems: Mapping[str, int] | None = None,
    ) -> None:
        self._kernel = kernel
        self.frame = frame
        specs = [body_of(vehicle) for vehicle in vehicles]
        self._world: World | None = None
        flights: list[Flight] = []
        if specs:  # a model of computers alone has no world
            self._world, flights = make_world(kernel.now, specs, seed=seed, frame=frame, wind=wind_of(wind))
        self.flights: dict[str, Flight] = {}
        self.autopilots: dict[str, Autopilot] = {}
        self._families: dict[str, FirmwareFamily] = {}
        ids = _ids([vehicle.name for vehicle in vehicles], systems or {})
        for vehicle, flight in zip(vehicles, flights, strict=True):
            self.flights[vehicle.name] = flight
            family = self._families[vehicle.name] = firmwares.load(vehicle.autopilot)
            self.autopilots[vehicle.name] = Autopilot(
                kernel,
                flight,
                family,
                system=ids[vehicle.name],
                parameters=vehicle.parameters,
                warm=vehicle.started == "warm",
                name=vehicle.name,
            )

    @property
    def world(self) -> World:
        """Where the bodies are. Raises ``UsageError`` if there are none."""
        if self._world is None:
            raise UsageError("there is no vehicle in this run, and so no world")
        return self._world

    def family(self, vehicle: str) -> FirmwareFamily:
        """The firmware that flies it."""
        return self._families[vehicle]

    def codec(self, vehicle: str) -> Codec:
        """What its autopilot's links speak. Raises ``UsageError`` if it is reached over a graph only."""
        family = self._families[vehicle]
        if family.codec is None:
            raise UsageError(f"{vehicle}: a simulated {family.name} has no links; it is reached over a graph")
        return family.codec

    def link(self, vehicle: str) -> Link:
        """A new link to the autopilot of *vehicle*, as over a serial line beside it."""
        ours, theirs = in_process_pair(self._kernel, LINK_DELAY, vehicle, self.codec(vehicle))
        self.autopilots[vehicle].connect(theirs)
        return ours

    def truth(self, vehicle: str) -> Callable[[], Position]:
        """Where *vehicle* really is: for judges, never for its commander."""
        flight = self.flights[vehicle]

        def look() -> Position:
            latitude, longitude, amsl = self.frame.from_enu(flight.truth().position)
            return Position(latitude, longitude, AMSL(amsl))

        return look

    def sample(self, period: Ns = SAMPLING_PERIOD) -> None:
        """Record the state of every vehicle now and then each *period*."""
        self._kernel.every(period, self.record_states)

    def progress(self) -> tuple[VehicleProgress, ...]:
        """What they do now."""
        return tuple(self._progress(name) for name in self.flights)

    def _progress(self, name: str) -> VehicleProgress:
        vehicle, truth = self.autopilots[name].vehicle, self.flights[name].truth()
        return VehicleProgress(name, vehicle.mode.name, vehicle.armed, truth.position[2] - truth.ground)

    def record_states(self) -> None:
        """Record the state of every vehicle now."""
        for autopilot in self.autopilots.values():
            self._kernel.record(autopilot.state())


def _ids(names: Sequence[str], stated: Mapping[str, int]) -> dict[str, int]:
    """Distinct system ids. Raises ``UsageError`` if two are stated to be the same."""
    taken = list(stated.values())
    if len(set(taken)) < len(taken):
        raise UsageError(f"system ids {sorted(taken)}: each vehicle needs one of its own")
    free = (number for number in range(1, 256) if number not in taken)
    return {name: stated[name] if name in stated else next(free) for name in names}


def wind_of(model: WindModel) -> Wind:
    """The model says where it blows from, clockwise from north; the world wants the way it blows."""
    towards = radians(model.direction_deg) + pi
    return Wind(
        east=model.speed_m_s * sin(towards), north=model.speed_m_s * cos(towards), gust=model.gusts_m_s
    )


def body_of(vehicle: VehicleModel) -> BodySpec:
    """The body of a vehicle, standing where the model puts it."""
    kind = Multirotor if vehicle.kind == "multirotor" else Rover
    usual = kind().battery
    return kind(
        at=(vehicle.at.east_m, vehicle.at.north_m, 0.0),
        heading_deg=vehicle.heading_deg,
        sensors=vehicle.sensors,
        battery=_battery(vehicle.battery, usual) if vehicle.battery else usual,
    )


def _battery(model: BatteryModel, usual: Battery) -> Battery:
    cells = usual.cells if model.voltage_v is None else max(1, round(model.voltage_v / CELL_NOMINAL_VOLTS))
    return Battery(model.capacity_coulomb / 3600.0, cells, usual.resistance_ohm, model.charge)


def fleet_of(kernel: Kernel, wanted: Sequence[SimulatedVehicle], seed: int) -> SimulatedFleet:
    """A world with these vehicles in it: its origin and its wind are the first one's."""
    first = wanted[0]
    vehicles = [_placed(one.vehicle, first.frame) for one in wanted]
    systems = {one.vehicle.name: one.system for one in wanted if one.system is not None}
    return SimulatedFleet(kernel, vehicles, first.frame, first.wind, seed, systems=systems)


def _placed(vehicle: VehicleModel, frame: LocalFrame) -> VehicleModel:
    at = vehicle.at
    east, north, _ = frame.to_enu(at.latitude, at.longitude, at.amsl_m)
    return replace(vehicle, at=replace(at, east_m=east, north_m=north))
