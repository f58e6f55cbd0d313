"""From addresses to vehicles: simulated ones in one world, or real ones.

A real vehicle must load neither the simulation nor what a recorded run needs, so the simulated fleet is
imported inside a function.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from volery.base.errors import CapabilityError, UsageError, VoleryError, choices
from volery.base.frames import HomeFrame
from volery.base.installed import require_extra
from volery.base.position import Position
from volery.kernel.api import Action, Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.wall import WallKernel
from volery.links.in_process_link import SharedLink
from volery.links.link import Link
from volery.run.assembly.ros_graphs import GRAPHS, open_graph
from volery.vehicles import Drone, Fence, Limits, Rover, Vehicle
from volery.vehicles.address import Address, open_link, parse
from volery.vehicles.driver import Driver, DriverFactory, drivers
from volery.vehicles.limits import Bounds

if TYPE_CHECKING:
    from volery.ros.graph import RosGraph
    from volery.run.assembly.simulated_fleet import SimulatedFleet
    from volery.run.assembly.simulated_vehicles import SimulatedVehicle
    from volery.run.result import Tell

EMBEDDED = "graph"
KINDS: Mapping[type[Vehicle], str] = {Drone: "multirotor", Rover: "rover"}


@dataclass(frozen=True)
class OpenedVehicles:
    """A kernel and the vehicles that were opened on it.

    Attributes:
        kernel: Virtual clock for simulated vehicles, wall clock for real ones.
        vehicles: In the order of their addresses.
        fleet: The simulated fleet, or None for real vehicles.
        leave: Closes the simulated fleet, or the ROS graphs of real vehicles; called after the vehicles are
            closed.
    """

    kernel: VirtualKernel | WallKernel
    vehicles: tuple[Vehicle, ...]
    fleet: SimulatedFleet | None = None
    leave: Action = lambda: None


@dataclass(frozen=True, kw_only=True)
class VehicleSettings:
    """Settings of all vehicles that are opened together.

    Attributes:
        seed: Seed of the simulation.
        pace: Simulated seconds per second, or None for as fast as possible.
        home: Home position of simulated vehicles, or None for the default.
        limits: Limits that every operation must keep.
        fence: Geofence that every operation must keep.
        run_folder: Folder of the run, in which programs of real firmware have theirs.
        tell: Receives single lines that the user should read at once.
    """

    seed: int = 1
    pace: float | None = None
    home: Position | None = None
    limits: Limits | None = None
    fence: Fence | None = None
    run_folder: Path | None = None
    tell: Tell | None = None


def open_vehicles(
    urls: Mapping[str, str], kinds: Mapping[str, type[Vehicle]], stated: VehicleSettings
) -> OpenedVehicles:
    """Open all vehicles, which are either all simulated, in one world, or all real.

    Args:
        urls: Addresses by vehicle name.
        kinds: ``Drone`` or ``Rover`` by vehicle name.
        stated: Settings of all vehicles.

    Raises:
        UsageError: An address is wrong, or the fence excludes a simulated home.
        CapabilityError: The vehicles cannot be opened together, or not in this way.
    """
    addresses = {name: parse(url) for name, url in urls.items()}
    for address in addresses.values():
        drivers.load(address.driver)  # report an unknown name before anything else
    if not all(address.in_virtual_time for address in addresses.values()):
        return _open_real(addresses, kinds, stated)
    return _open_simulated(addresses, kinds, stated)


def _open_simulated(
    addresses: Mapping[str, Address], kinds: Mapping[str, type[Vehicle]], stated: VehicleSettings
) -> OpenedVehicles:
    require_extra("simulation", "simulated vehicles")
    from volery.run.assembly.firmware_programs import ProgramFolder
    from volery.run.assembly.simulated_fleet import fleet_of
    from volery.run.assembly.simulated_vehicles import HOME, parse_simulated

    wanted = [
        parse_simulated(address, name, KINDS[kinds[name]], stated.home or HOME)
        for name, address in addresses.items()
    ]
    for one in wanted:
        _check_home(one, stated.fence)
    kernel = VirtualKernel(pace=stated.pace)
    programs = ProgramFolder(stated.run_folder, stated.tell)
    fleet = fleet_of(kernel, wanted, stated.seed, programs=programs)
    vehicles = [_simulated_vehicle(kernel, fleet, one, kinds[one.vehicle.name], stated) for one in wanted]
    return OpenedVehicles(kernel, tuple(vehicles), fleet, fleet.close)


def _check_home(wanted: SimulatedVehicle, fence: Fence | None) -> None:
    home = wanted.home
    found = Bounds(HomeFrame(home), Limits(), fence).home_violation
    if found:
        raise UsageError(f"{wanted.vehicle.name}: the fence excludes home: {found}")


def _simulated_vehicle(
    kernel: Kernel,
    fleet: SimulatedFleet,
    wanted: SimulatedVehicle,
    kind: type[Vehicle],
    stated: VehicleSettings,
) -> Vehicle:
    from volery.run.assembly.vehicle_nodes import open_simulated_driver

    driver = open_simulated_driver(kernel, fleet, wanted, stated.seed)
    name = wanted.vehicle.name
    return kind(kernel, name, driver, limits=stated.limits, fence=stated.fence, truth=fleet.truth(name))


# -- real vehicles


def _open_real(
    addresses: Mapping[str, Address], kinds: Mapping[str, type[Vehicle]], stated: VehicleSettings
) -> OpenedVehicles:
    for address in addresses.values():
        if address.in_virtual_time:
            raise CapabilityError(
                f"{address}: simulated and real vehicles have different clocks; fly them in separate runs"
            )
        if address.transport == EMBEDDED:
            raise CapabilityError(
                f"{address}: vehicles on the embedded graph are commanded by components of a model; "
                f"on real ROS it is {address.driver}+ros1:// or {address.driver}+ros2://"
            )
    kernel = WallKernel()
    by_graph = {name: one for name, one in addresses.items() if one.transport in GRAPHS}
    links = _RealLinks(kernel, {name: one for name, one in addresses.items() if name not in by_graph})
    graphs = RealGraphs(kernel, stated.home)
    try:
        vehicles = []
        for name, address in addresses.items():
            driver = graphs.driver(name, address) if name in by_graph else links.driver(name, address)
            vehicles.append(kinds[name](kernel, name, driver, limits=stated.limits, fence=stated.fence))
    except VoleryError:
        links.close()
        graphs.close()
        raise
    return OpenedVehicles(kernel, tuple(vehicles), leave=graphs.close)


class RealGraphs:
    """Real ROS graphs, each opened once, with one node of volery for each vehicle.

    Args:
        kernel: Kernel of the graphs.
        home: Home position of the vehicles as stated, for autopilots that do not know its altitude.
    """

    def __init__(self, kernel: Kernel, home: Position | None = None) -> None:
        self._kernel = kernel
        self._home = home
        self._open: dict[str, RosGraph] = {}

    def graph(self, name: str) -> RosGraph:
        """Return the graph called *name*. Raises what ``open_graph`` raises."""
        if name not in self._open:
            self._open[name] = open_graph(self._kernel, name)
        return self._open[name]

    def driver(self, name: str, address: Address) -> Driver:
        """Return the driver of the vehicle *name*; the path of the address is the namespace."""
        factory = drivers.load(address.driver)
        open_driver = factory.on_graph
        if address.transport == "ros2" and factory.on_ros2 is not None:
            open_driver = factory.on_ros2
        if open_driver is None:
            raise UsageError(f"{address}: {address.driver} is reached over a link, not over a ROS graph")
        node = self.graph(address.transport).node(
            f"volery_{name}", anonymous=True, context=ExecutionContext(name)
        )
        namespace = address.path.rstrip("/")
        stated = {"namespace": namespace} if namespace else {}
        stated |= factory.home_options(self._home)
        return open_driver(self._kernel, node, name, {**stated, **address.options})

    def close(self) -> None:
        """Leave the graphs."""
        for graph in self._open.values():
            graph.close()
        self._open.clear()


class _RealLinks:
    """Links to real vehicles: one each, or one for all vehicles behind the same radio or port."""

    def __init__(self, kernel: Kernel, addresses: Mapping[str, Address]) -> None:
        self._kernel = kernel
        self._addresses = addresses
        self._links: list[Link] = []
        self._shared: dict[tuple[object, ...], SharedLink] = {}
        self._behind: dict[tuple[object, ...], list[str]] = {}
        for name, address in addresses.items():
            if drivers.load(address.driver).on_link is None:
                raise UsageError(f"{address}: {address.driver} is reached over a ROS graph, not over a link")
            self._behind.setdefault(_endpoint(address), []).append(name)
        for names in self._behind.values():
            self._check_distinct(names)

    def _check_distinct(self, names: list[str]) -> None:
        """Check that vehicles behind one link have distinct system ids and one protocol."""
        if len(names) == 1:
            return
        first, *others = (self._addresses[name] for name in names)
        systems = [self._addresses[name].options.get("system", "") for name in names]
        if "" in systems or len(set(systems)) < len(systems):
            raise UsageError(
                f"{' and '.join(names)} share one {first.transport} address; give each its system id, "
                f"as in {first.text.partition('?')[0]}?system=1"
            )
        for other in others:
            codecs = {self._factory(one).codec.name for one in (first, other)}
            if len(codecs) > 1:
                raise UsageError(f"{first} and {other}: one link carries one protocol, not {choices(codecs)}")
            if first.options.get("baud") != other.options.get("baud"):
                raise UsageError(f"{first} and {other}: one serial line has one baud rate")

    def _factory(self, address: Address) -> DriverFactory:
        return drivers.load(address.driver)

    def driver(self, name: str, address: Address) -> Driver:
        """Return the driver of the vehicle *name*."""
        open_driver = self._factory(address).on_link
        assert open_driver is not None, "checked when the links were made"
        return open_driver(self._kernel, self._link(name), name, for_driver(address))

    def _link(self, name: str) -> Link:
        address = self._addresses[name]
        codec, endpoint = self._factory(address).codec, _endpoint(address)
        if len(self._behind[endpoint]) == 1:
            self._links.append(open_link(self._kernel, address, codec))
            return self._links[-1]
        if endpoint not in self._shared:
            self._links.append(open_link(self._kernel, address, codec, shared=True))
            self._shared[endpoint] = SharedLink(self._links[-1])
        return self._shared[endpoint].share()

    def close(self) -> None:
        """Close every link that was opened."""
        for link in self._links:
            link.close()


def _endpoint(address: Address) -> tuple[object, ...]:
    """Return what two vehicles behind one link have in common."""
    return address.transport, address.host, address.port, address.path


def for_driver(address: Address) -> dict[str, str]:
    """Return the options of an address that are meant for the driver, not for the carrier."""
    return {key: value for key, value in address.options.items() if key != "baud"}
