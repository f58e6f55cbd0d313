"""``serve``: a simulated vehicle for ground stations, MAVSDK, MAVProxy, nodes or a script of your own."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from volery.base.errors import UsageError
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import FOREVER, VirtualKernel
from volery.links.coded_link import CodedLink
from volery.run.assembly.ros_graphs import open_graph
from volery.run.assembly.simulated_fleet import SimulatedFleet, fleet_of
from volery.run.assembly.simulated_vehicles import SimulatedVehicle
from volery.run.assembly.vehicle_nodes import graph_access
from volery.simulation.autopilots.firmware import firmwares
from volery.vehicles.address import Address, listen, parse_listen


def has_links(autopilot: str) -> bool:
    """Whether a simulated *autopilot* is reached over links; else over a graph."""
    return firmwares.load(autopilot).codec is not None


class VehicleServer:
    """One simulated vehicle, reachable at *address* in virtual time that passes *speed* times as fast as real
    time; ``None``: where those who fly its firmware usually listen.

    TCP serves any number of clients; UDP sends to a host, or answers the first who speaks. Raises
    ``UsageError`` for an address that cannot be opened, and for a firmware that has no links.
    """

    def __init__(
        self, wanted: SimulatedVehicle, address: Address | None, *, speed: float = 1.0, seed: int = 1
    ) -> None:
        self.kernel = VirtualKernel(pace=speed)
        self.fleet: SimulatedFleet = fleet_of(self.kernel, [wanted], seed)
        name = wanted.vehicle.name
        self._autopilot = self.fleet.autopilots[name]
        codec = self.fleet.codec(name)
        self.protocol = codec.name
        usual = self.fleet.family(name).default_links
        stations = [(parse_listen(text), use) for text, use in usual] if address is None else [(address, "")]
        self.addresses = [one for one, _ in stations]
        self.links: list[CodedLink] = []
        for place, (one, use) in enumerate(stations):
            link = listen(self.kernel, one, joined=partial(self._greet, place), codec=codec)
            self.links.append(link)
            self._autopilot.connect(link, use=use)

    def _greet(self, place: int) -> None:
        self.links[place].send_bytes(self._autopilot.banner)

    def run(self, ready: Callable[[], None] = lambda: None) -> None:
        """Serve until the process is told to stop (``KeyboardInterrupt``). *ready* is called once it can be
        reached.
        """
        ready()
        try:
            self.kernel.run(FOREVER)
        finally:
            for link in self.links:
                link.close()
            self.kernel.close("the server was stopped")


class VehicleNodeServer:
    """One simulated vehicle as a node of a real ROS graph (``ros1``, ``ros2``), under *namespace*; by default
    as its own node is called on a real aircraft.

    Raises ``UsageError`` for a firmware that speaks on links, and what ``open_graph`` raises.
    """

    def __init__(
        self, wanted: SimulatedVehicle, graph: str, namespace: str = "", *, speed: float = 1.0, seed: int = 1
    ) -> None:
        self.kernel = VirtualKernel(pace=speed)
        self.fleet: SimulatedFleet = fleet_of(self.kernel, [wanted], seed)
        name = wanted.vehicle.name
        if self.fleet.family(name).codec is not None:
            raise UsageError(f"{name}: a simulated {wanted.vehicle.autopilot} is no node; it speaks on links")
        usual = graph_access(wanted.vehicle.autopilot, name).namespace.removeprefix(f"/{name}")
        self.namespace = namespace or usual
        self.graph = open_graph(self.kernel, graph)
        self.fleet.autopilots[name].join(self.graph, self.namespace, ExecutionContext(name))

    def run(self, ready: Callable[[], None] = lambda: None) -> None:
        """See ``Server.run``."""
        ready()
        try:
            self.kernel.run(FOREVER)
        finally:
            self.graph.close()
            self.kernel.close("the server was stopped")
