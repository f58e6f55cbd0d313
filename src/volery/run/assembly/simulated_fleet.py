"""The simulated vehicles of a run: their bodies in one world, and a simulated autopilot for each.

This module imports the simulation. Code that also runs on board of a real vehicle imports
it inside functions, or for type checking only.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import cycle
from math import pi, radians
from typing import NamedTuple

from volery.base.elementary import cos, sin
from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.installed import require_extra
from volery.base.position import AMSL, Position
from volery.base.seeds import stream
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.links.in_process_link import in_process_pair
from volery.links.link import Link, WireFormat
from volery.links.wire_faults import FaultyLink, WireFaults, faulty_pair
from volery.model.environment import Environment, Prism
from volery.model.environment import MarkerSpec as MarkerModel
from volery.model.environment import VehicleSpec as VehicleModel
from volery.model.environment import WindSpec as WindModel
from volery.run.assembly.bodies import body_of
from volery.run.assembly.firmware_programs import (
    ProgramFolder,
    check_programs,
    family_of,
    parameters_of,
    remark_on,
)
from volery.run.assembly.moved_bodies import remark_on_body, start_body
from volery.run.assembly.sensor_node import Alteration
from volery.run.assembly.simulated_vehicles import LINK_DELAY, SimulatedVehicle
from volery.run.result import SAMPLING_PERIOD, VehicleProgress
from volery.simulation.autopilots.fleet_autopilot import AutopilotFamily, FleetAutopilot
from volery.simulation.autopilots.flight_stack.flight import Flight, make_world
from volery.simulation.fmu.fmu_body import FmuBody
from volery.simulation.real_firmware.lock_step import RealFirmware
from volery.simulation.world.body_specs import BodySpec
from volery.simulation.world.environment_models import Wind
from volery.simulation.world.scene import DAY_LUX, DUSK_LUX, Marker, Scene, Solid
from volery.simulation.world.world import World
from volery.trace.events import Collision, ignore

FOUNDATION = 100.0
"""Depth [m] to which a solid on the ground goes on below it: the ground follows the globe."""


LUX = {"day": DAY_LUX, "dusk": DUSK_LUX, "night": 0.3}
"""Illuminance of the model's kinds of light."""


class FleetWorld(NamedTuple):
    """The world that the vehicles share: its frame, its wind and what stands in it."""

    frame: LocalFrame
    wind: WindModel
    scene: Scene | None = None


OutsideAutopilot = Callable[[Flight], FleetAutopilot]
"""Returns the autopilot of a body."""


class SimulatedFleet:
    """Simulated vehicles in one world, by name, in the order of the model.

    System ids count from 1, except for the vehicles in *systems*. The links of the vehicles in
    *through_bytes* can be given faults: see ``faulty_links``. With *logging* the autopilots keep
    logs of their flights. The vehicles in *outside* have autopilots that are not made here.

    Programs of real firmware run where *programs* says, by default in a temporary folder.
    """

    def __init__(  # noqa: PLR0913  # each is an option
        self,
        kernel: Kernel,
        vehicles: Sequence[VehicleModel],
        surroundings: FleetWorld,
        seed: int,
        *,
        systems: Mapping[str, int] | None = None,
        through_bytes: Collection[str] = (),
        logging: bool = False,
        programs: ProgramFolder | None = None,
        outside: Mapping[str, OutsideAutopilot] | None = None,
    ) -> None:
        check_programs(vehicles)
        self._programs = programs or ProgramFolder()
        self._kernel = kernel
        self._seed = seed
        self._faulty: dict[str, list[FaultyLink]] = {vehicle: [] for vehicle in through_bytes}
        self.frame = surroundings.frame
        self._moved: dict[str, FmuBody] = {}
        self.flights: dict[str, Flight] = {}
        self.autopilots: dict[str, FleetAutopilot] = {}
        try:
            specs = [self._body(vehicle) for vehicle in vehicles]
        except BaseException:
            self.close()
            raise
        self._world: World | None = None
        flights: list[Flight] = []
        if specs:  # a model of computers alone has no world
            self._world, flights = make_world(
                kernel.now,
                specs,
                seed=seed,
                frame=surroundings.frame,
                wind=wind_of(surroundings.wind),
                scene=surroundings.scene,
            )
        self._collisions = dict.fromkeys((vehicle.name for vehicle in vehicles), 0)
        self.on_collision: Callable[[Collision], object] = ignore
        """Called with each collision, when it is recorded."""
        self.alterations: dict[str, dict[str, dict[str, Alteration]]] = {
            vehicle.name: {} for vehicle in vehicles
        }
        """What faults make of the samples of added sensors: by vehicle, sensor and fault."""
        self._families: dict[str, AutopilotFamily] = {}
        ids = _ids([vehicle.name for vehicle in vehicles], systems or {})
        try:
            for vehicle, flight in zip(vehicles, flights, strict=True):
                self.flights[vehicle.name] = flight
                if vehicle.name in self._moved:
                    self._moved[vehicle.name].begin(flight.row)
                    flight.move_by(self._moved[vehicle.name])
                if outside is not None and vehicle.name in outside:
                    self.autopilots[vehicle.name] = outside[vehicle.name](flight)
                    continue
                if vehicle.firmware is not None:
                    self._programs.prepare(vehicle)
                family = family_of(vehicle, self._programs, seed)
                self._families[vehicle.name] = family
                self.autopilots[vehicle.name] = family.create(
                    kernel,
                    flight,
                    system=ids[vehicle.name],
                    parameters=parameters_of(vehicle),
                    warm=vehicle.started == "warm",
                    name=vehicle.name,
                    logging=logging,
                )
                for channel, pulse in vehicle.transmitter.items():
                    self.move_transmitter(vehicle.name, kernel.now(), int(channel), pulse)
        except BaseException:
            self.close()
            raise

    def _body(self, vehicle: VehicleModel) -> BodySpec:
        """Return the body of a vehicle; an FMU that moves it is started."""
        if vehicle.body is None:
            return body_of(vehicle)
        moved = self._moved[vehicle.name] = start_body(vehicle, self._programs.bodies)
        return moved.spec

    @property
    def world(self) -> World:
        """World of the bodies. Raises ``UsageError`` if the run has no vehicle."""
        if self._world is None:
            raise UsageError("this run has no vehicle and therefore no world")
        return self._world

    def family(self, vehicle: str) -> AutopilotFamily:
        """Return the firmware of a vehicle."""
        return self._families[vehicle]

    def codec(self, vehicle: str) -> WireFormat:
        """Return the codec of a vehicle's links.

        Raises:
            UsageError: The autopilot has no links, because it is a node of a ROS graph.
        """
        family = self._families[vehicle]
        if family.codec is None:
            raise UsageError(
                f"{vehicle}: a simulated {family.name} has no links; it is reached over a ROS graph"
            )
        return family.codec

    def link(self, vehicle: str) -> Link:
        """Return a new link to the autopilot of *vehicle*, as over a serial line on board."""
        codec = self.codec(vehicle)
        ours: Link
        theirs: Link
        if vehicle in self._faulty:
            random = stream(self._seed, f"wire/{vehicle}")
            faulty, theirs = faulty_pair(
                self._kernel, vehicle, WireFaults(), random, delay=LINK_DELAY, codec=codec
            )
            self._faulty[vehicle].append(faulty)
            ours = faulty
        else:
            ours, theirs = in_process_pair(self._kernel, LINK_DELAY, vehicle, codec)
        self.autopilots[vehicle].connect(theirs)
        return ours

    def link_for(self, wanted: SimulatedVehicle) -> Link:
        """Return a new link to the autopilot of *wanted*, with the faults that its address states."""
        name = wanted.vehicle.name
        if wanted.faults is None:
            return self.link(name)
        random = stream(self._seed, f"wire/{name}")
        ours, theirs = faulty_pair(
            self._kernel, name, wanted.faults, random, delay=LINK_DELAY, codec=self.codec(name)
        )
        self.autopilots[name].connect(theirs)
        return ours

    def faulty_links(self, vehicle: str) -> Sequence[FaultyLink]:
        """Return the links to the autopilot of *vehicle* that can be given faults."""
        return self._faulty.get(vehicle, ())

    def truth(self, vehicle: str) -> Callable[[], Position]:
        """Return a function for the true position of *vehicle*, for judging its operations only."""
        flight = self.flights[vehicle]

        def position() -> Position:
            latitude, longitude, amsl = self.frame.from_enu(flight.truth().position)
            return Position(latitude, longitude, AMSL(amsl))

        return position

    def move_transmitter(self, vehicle: str, at: Ns, channel: int, pulse: int) -> None:
        """Move a stick or switch of the pilot's transmitter.

        Args:
            vehicle: Name of the vehicle.
            at: Time, ns.
            channel: RC channel, from 1.
            pulse: Pulse width, µs.
        """
        channels = self.autopilots[vehicle].transmitter

        def move() -> None:
            channels[channel - 1] = pulse

        self._kernel.call_at(at, move)

    def sample(self, period: Ns = SAMPLING_PERIOD) -> None:
        """Record the state of every vehicle periodically, from now on."""
        self._kernel.every(period, self.record_states)

    def progress(self) -> tuple[VehicleProgress, ...]:
        """Return the present state of each vehicle."""
        return tuple(self._progress(name) for name in self.flights)

    def _progress(self, name: str) -> VehicleProgress:
        state, truth = self.autopilots[name].state(), self.flights[name].truth()
        return VehicleProgress(name, state.mode, state.armed, truth.position[2] - truth.ground)

    def program(self, vehicle: str) -> str:
        """Return the name of the program of real firmware that flies *vehicle*; empty: it is simulated."""
        autopilot = self.autopilots[vehicle]
        return autopilot.process.program if isinstance(autopilot, RealFirmware) else ""

    def remarks(self) -> Iterator[str]:
        """Yield what flew of real firmware, which sensors were its own, and which FMUs moved bodies."""
        for name, body in self._moved.items():
            yield remark_on_body(name, body)
        for name, autopilot in self.autopilots.items():
            if isinstance(autopilot, RealFirmware):
                yield remark_on(name, self._families[name].name, autopilot)

    def close(self) -> None:
        """End the autopilots and the FMUs; their states can still be read."""
        for autopilot in self.autopilots.values():
            autopilot.close()
        for name, moved in self._moved.items():
            if name in self.flights:
                self.flights[name].move_by(None)
            moved.fmu.close()
        self._programs.close()

    def record_states(self) -> None:
        """Record the present state of every vehicle."""
        for name, autopilot in self.autopilots.items():
            self._kernel.record(autopilot.state())
            hit = self.flights[name].last_collision()
            if hit is not None and hit.collisions > self._collisions[name]:
                self._collisions[name] = hit.collisions
                event = Collision(self._kernel.now(), name, hit.solid, hit.speed, *hit.position)
                self._kernel.record(event)
                self.on_collision(event)


def _ids(names: Sequence[str], stated: Mapping[str, int]) -> dict[str, int]:
    """Return system ids, distinct as far as the 255 go; each vehicle has a link of its own.

    Raises:
        UsageError: Two stated ids are equal.
    """
    taken = list(stated.values())
    if len(set(taken)) < len(taken):
        raise UsageError(f"system ids {sorted(taken)}: each vehicle needs its own")
    free = cycle([number for number in range(1, 256) if number not in taken] or range(1, 256))
    return {name: stated[name] if name in stated else next(free) for name in names}


def surroundings_of(environment: Environment) -> FleetWorld:
    """Return the world of a model's environment."""
    solids, no_fly = _solids(environment.solids), _solids(environment.no_fly_zones)
    markers = _markers(environment.markers, Scene(solids))
    scene = Scene(solids, no_fly, markers=markers, lux=LUX[environment.light])
    return FleetWorld(environment.origin, environment.wind, scene)


def _solids(prisms: Sequence[Prism]) -> list[Solid]:
    return [
        Solid(prism.name, prism.corners, prism.floor_m or -FOUNDATION, prism.ceiling_m) for prism in prisms
    ]


def _markers(markers: Sequence[MarkerModel], scene: Scene) -> list[Marker]:
    """Return the markers, each on what stands at its place."""
    if not markers:
        return []
    require_extra("vision", "markers in a model")
    from volery.autonomy.markers import marker_cells  # noqa: PLC0415  # needs an extra

    return [
        Marker(
            marker.name,
            marker_cells(marker.family, marker.number),
            (marker.at.east_m, marker.at.north_m, scene.standing_height(marker.at.east_m, marker.at.north_m)),
            marker.size_m,
            radians(marker.yaw_deg),
        )
        for marker in markers
    ]


def wind_of(model: WindModel) -> Wind:
    """Return the wind of the world: the model states the direction it comes from, clockwise from north."""
    towards = radians(model.direction_deg) + pi
    return Wind(
        east=model.speed_m_s * sin(towards), north=model.speed_m_s * cos(towards), gust=model.gusts_m_s
    )


def fleet_of(
    kernel: Kernel,
    wanted: Sequence[SimulatedVehicle],
    seed: int,
    *,
    programs: ProgramFolder | None = None,
) -> SimulatedFleet:
    """Return a fleet of these vehicles. The origin and the wind of its world are those of the first."""
    first = wanted[0]
    vehicles = [_placed(one.vehicle, first.frame) for one in wanted]
    systems = {one.vehicle.name: one.system for one in wanted if one.system is not None}
    around = FleetWorld(first.frame, first.wind)
    fleet = SimulatedFleet(
        kernel,
        vehicles,
        around,
        seed,
        systems=systems,
        logging=True,
        programs=programs,
    )
    for one in wanted:
        for at, channel, pulse in one.transmitter:
            fleet.move_transmitter(one.vehicle.name, at, channel, pulse)
    return fleet


def _placed(vehicle: VehicleModel, frame: LocalFrame) -> VehicleModel:
    at = vehicle.at
    east, north, _ = frame.to_enu(at.latitude, at.longitude, at.amsl_m)
    return replace(vehicle, at=replace(at, east_m=east, north_m=north))
