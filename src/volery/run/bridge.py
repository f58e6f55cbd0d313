"""``bridge``: a vehicle on a real ROS graph under the names of MAVROS, roscopter, pprzros or its own.

A real vehicle lives in real time, a simulated one in a world of its own whose time passes *speed* times as
fast. If the names are made for another protocol than the autopilot's, the autopilot's driver decodes and
commands it and an ``Interpreter`` presents it in the protocol of the names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from volery.base.errors import CapabilityError, UsageError, choices, did_you_mean
from volery.base.geoid import EGM96_NAME, parse_geoid
from volery.base.time import Ns
from volery.bridge import (
    MAVLINK_SCHEMES,
    MavlinkAdapter,
    PprzrosNode,
    VehicleNode,
    VehicleNodeOptions,
)
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import FOREVER, VirtualKernel
from volery.kernel.wall import WallKernel
from volery.links.link import Link
from volery.run.assembly.ros_graphs import GRAPHS
from volery.run.assembly.simulated_vehicles import SimulatedVehicle, parse_simulated
from volery.run.assembly.vehicle_nodes import NAMES_OF, OWN_NAMES, open_simulated_driver, own_names
from volery.run.assembly.vehicles import EMBEDDED, RealGraphs, for_driver
from volery.trace.events import Record, ignore
from volery.vehicles.address import LOCAL_ADDRESS, LOCAL_PORT, REPLY_PORT, SIGNING, Address, open_link, parse
from volery.vehicles.driver import drivers

if TYPE_CHECKING:
    from volery.run.assembly.simulated_fleet import SimulatedFleet

KNOWN = (*MAVLINK_SCHEMES, *NAMES_OF["pprzlink"])
ON_A_GRAPH = (*GRAPHS, EMBEDDED)

NAMESPACES: Mapping[str, str] = {"mavros": "/mavros"}
"""Namespace of a node with these names on a real vehicle, where it is not ``/``."""

USUAL_RATE_HZ = 10
MAX_RATE_HZ = 1000
MAX_SYSTEM_ID = 255


@dataclass(frozen=True, kw_only=True)
class BridgeOptions:
    """Options of a bridge.

    Attributes:
        url: Address of the vehicle.
        graph: ``ros1`` or ``ros2``.
        names: Set of names; empty for the default of the autopilot.
        namespace: Namespace of the names; empty for the default of the set.
        rate: Rate of telemetry that is requested from the autopilot, Hz; 0 requests nothing. None is 10, or
            what the names of an autopilot's own interface need.
        control: Accept roscopter's ``send_rc``.
        system: MAVLink system id of the bridge.
        geoid: See ``parse_geoid``.
        speed: Simulated seconds per second, for a simulated vehicle.
        seed: Seed of the simulation.
        remaps: Names of topics and services, and their replacements.
    """

    url: str
    graph: str
    names: str = ""
    namespace: str = ""
    rate: int | None = None
    control: bool = False
    system: int = 255
    geoid: str = EGM96_NAME
    speed: float = 1.0
    seed: int = 1
    remaps: Mapping[str, str] = field(default_factory=dict)


class Bridge:
    """A vehicle as a node of a real ROS graph, visible there while ``run`` runs.

    Args:
        wanted: Options.
        record: Receives the events of links and warnings.

    Raises:
        UsageError: An option is wrong, or the graph is not available.
        CapabilityError: The names do not fit the autopilot.
        LinkError: The graph does not answer.
    """

    def __init__(self, wanted: BridgeOptions, record: Record = ignore) -> None:
        _check(wanted)
        address = parse(wanted.url)
        self.names = _names(address, wanted.names)
        self.namespace = wanted.namespace or NAMESPACES.get(self.names, "/")
        self.kernel: VirtualKernel | WallKernel
        in_simulation = address.in_virtual_time
        self.kernel = VirtualKernel(record, pace=wanted.speed) if in_simulation else WallKernel(record)
        self._graphs = RealGraphs(self.kernel)
        self._interpreted = self.names not in _own_names(address)
        with ExitStack() as undo:
            self._opened = undo
            undo.callback(self._graphs.close)
            self._link = (
                self._interpreter(address, wanted)
                if self._interpreted
                else self._direct_link(address, wanted)
            )
            undo.callback(self._link.close)
            self._node = self._make_node(address, wanted)
            self._opened = undo.pop_all()
        self._node.start(ExecutionContext("bridge"), self.kernel.root)

    def _direct_link(self, address: Address, wanted: BridgeOptions) -> Link:
        """Return the link to an autopilot with the protocol of the names."""
        if address.in_virtual_time:
            vehicle = parse_simulated(address, address.driver)
            return self._fleet(vehicle, wanted.seed).link_for(vehicle)
        address.only("baud", LOCAL_ADDRESS, "system", LOCAL_PORT, REPLY_PORT, SIGNING)
        return open_link(self.kernel, address, drivers.load(address.driver).codec)

    def _interpreter(self, address: Address, wanted: BridgeOptions) -> Link:
        """Return a link to an interpreter, for an autopilot with another protocol."""
        name, factory = address.driver, drivers.load(address.driver)
        if address.in_virtual_time:
            vehicle = parse_simulated(address, address.driver)
            fleet = self._fleet(vehicle, wanted.seed)
            driver = open_simulated_driver(self.kernel, fleet, vehicle, wanted.seed)
        elif address.transport in GRAPHS:
            driver = self._graphs.driver(name, address)
        else:
            assert factory.on_link is not None, "checked when the names were chosen"
            link = open_link(self.kernel, address, factory.codec)
            try:
                driver = factory.on_link(self.kernel, link, name, for_driver(address))
            except UsageError:
                link.close()
                raise
        return MavlinkAdapter(self.kernel, driver, ExecutionContext("bridge"))

    def _fleet(self, vehicle: SimulatedVehicle, seed: int) -> SimulatedFleet:
        """Return a fleet of one vehicle in a world of its own."""
        from volery.run.assembly.simulated_fleet import fleet_of

        fleet = fleet_of(self.kernel, [vehicle], seed)
        self._opened.callback(fleet.close)
        return fleet

    def _make_node(self, address: Address, wanted: BridgeOptions) -> VehicleNode | PprzrosNode:
        graph = self._graphs.graph(wanted.graph)
        if self.names not in MAVLINK_SCHEMES:
            return PprzrosNode(graph, self._link, self.namespace)
        names = MAVLINK_SCHEMES[self.names]
        usual = None if own_names(self.names) else USUAL_RATE_HZ
        options = VehicleNodeOptions(
            names=names,
            period=None,
            rate=usual if wanted.rate is None else wanted.rate,
            system=wanted.system,
            vehicle=0 if self._interpreted else int(address.number("system", 0)),
            geoid=parse_geoid(wanted.geoid),
            control=wanted.control,
            remaps=wanted.remaps,
            best_effort=wanted.graph == "ros2",
            parameter_services=wanted.graph == "ros2",
        )
        return VehicleNode(graph, self._link, self.namespace, options)

    @property
    def status(self) -> str:
        """State of the connection in one line."""
        return (
            self._node.summary or f"no autopilot: {self._link.problem() or 'nothing has been received yet'}"
        )

    def every(self, period: Ns, action: Callable[[], None]) -> None:
        """Call *action* periodically while the bridge runs, from now on."""
        self.kernel.every(period, action)

    def run(self) -> None:
        """Run until ``KeyboardInterrupt``, then close what was opened."""
        try:
            self.kernel.run(FOREVER)
        finally:
            self._opened.close()
            self.kernel.close("the bridge was stopped")


def _check(wanted: BridgeOptions) -> None:
    if wanted.graph == "embedded":
        raise UsageError(
            "the embedded graph is inside a run, which puts its vehicles on the graph itself; "
            f"a bridge needs {choices(GRAPHS)}"
        )
    if not 0 <= (wanted.rate or 0) <= MAX_RATE_HZ:
        raise UsageError(f"a rate of {wanted.rate} Hz: give 1 to {MAX_RATE_HZ}, or 0 to request nothing")
    if not 1 <= wanted.system <= MAX_SYSTEM_ID:
        raise UsageError(f"{wanted.system} is no system id; give 1 to {MAX_SYSTEM_ID}")
    if not 0.0 < wanted.speed < float("inf"):
        raise UsageError(f"a speed of {wanted.speed:g}: give simulated seconds per second, above 0")
    parse_geoid(wanted.geoid)


def _own_names(address: Address) -> tuple[str, ...]:
    """Return the names that are made for the protocol of the autopilot at *address*."""
    factory = drivers.load(address.driver)
    if factory.on_link is None or address.transport in ON_A_GRAPH:
        return ()
    return (*NAMES_OF.get(factory.codec.name, ()), *OWN_NAMES.get(address.driver, ()))


def _names(address: Address, wanted: str) -> str:
    """Return the set of names."""
    _check_graph_names(address, wanted)
    own = _own_names(address)
    valid = (*own, *(name for name in NAMES_OF["MAVLink"] if name not in own))
    if not wanted:
        return valid[0]
    if wanted not in KNOWN:
        raise UsageError(f"no names {wanted!r}{did_you_mean(wanted, KNOWN)}; there is {choices(KNOWN)}")
    if wanted not in valid:
        pprzlink = wanted in NAMES_OF["pprzlink"]
        whose = "vehicles that speak pprzlink" if pprzlink else f"a {wanted.partition('-')[0]}"
        raise CapabilityError(
            f"{address}: {wanted}'s names are those of {whose}; this one goes by {choices(valid)}"
        )
    return wanted


def _check_graph_names(address: Address, wanted: str) -> None:
    """Check that a vehicle which is a ROS node itself is bridged under other names than its own."""
    factory = drivers.load(address.driver)
    if factory.on_link is not None and address.transport not in ON_A_GRAPH:
        return
    own = factory.graph_names
    if own in MAVLINK_SCHEMES or address.transport == EMBEDDED:
        raise CapabilityError(
            f"{address}: the vehicle is on a graph already, under {own}'s names; there is nothing to bridge"
        )
    if wanted in ("", own):
        served = f"`volery vehicle serve {address.driver} --graph ros1`"
        raise CapabilityError(
            f"{address}: {address.driver} is a ROS node itself, under {own}'s names "
            f"(a simulated one: {served}); for other names give --names {choices(NAMES_OF['MAVLink'])}"
        )
