"""``serve``: a simulated vehicle for ground stations, client libraries, ROS nodes or a script."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from volery.base.errors import UsageError
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import FOREVER, VirtualKernel
from volery.links.coded_link import CodedLink
from volery.links.link import WireFormat
from volery.links.mavlink_codec import MAVLINK
from volery.run.assembly.ros_graphs import open_graph
from volery.run.assembly.simulated_fleet import SimulatedFleet, fleet_of
from volery.run.assembly.simulated_vehicles import SimulatedVehicle
from volery.run.assembly.vehicle_nodes import graph_access
from volery.simulation.autopilots.fleet_autopilot import firmwares
from volery.trace.events import Event, LinkState
from volery.vehicles.address import LOCAL_PORT, SIGNING, Address, listen, parse_listen


def has_links(autopilot: str) -> bool:
    """Return True if a simulated *autopilot* is reached over links, False if over a ROS graph."""
    return firmwares.load(autopilot).codec is not None


class VehicleServer:
    """One simulated vehicle that is served over links.

    TCP serves any number of clients. UDP sends to a host, or answers the first client that sends.

    Args:
        wanted: The vehicle.
        address: Where to serve it; None for the addresses at which ground stations expect its firmware.
        speed: Simulated seconds per second.
        seed: Seed of the simulation.
        signing: File with the key of signed MAVLink; empty for unsigned.
        notice: Receives a line for the user when a link has no room for a client, or drops what one sends.

    Raises:
        UsageError: The address cannot be opened, or the firmware has no links.
    """

    def __init__(
        self,
        wanted: SimulatedVehicle,
        address: Address | None,
        *,
        speed: float = 1.0,
        seed: int = 1,
        signing: str = "",
        notice: Callable[[str], None] = lambda line: None,
    ) -> None:
        self._notice = notice
        self.kernel = VirtualKernel(self._record, pace=speed)
        self.fleet: SimulatedFleet = fleet_of(self.kernel, [wanted], seed)
        name = wanted.vehicle.name
        self._autopilot = self.fleet.autopilots[name]
        codec = self.fleet.codec(name)
        self.protocol = codec.name
        usual = self.fleet.family(name).default_links
        stations = [(parse_listen(text), use) for text, use in usual] if address is None else [(address, "")]
        if signing:
            stations = [(one.with_option(SIGNING, signing), use) for one, use in stations]
        self.addresses = [one for one, _ in stations]
        self.links: list[CodedLink] = []
        for place, (one, use) in enumerate(stations):
            link = self._open(one, place, codec, usual=address is None)
            self.links.append(link)
            self._autopilot.connect(link, use=use)

    def _open(self, address: Address, place: int, codec: WireFormat, *, usual: bool) -> CodedLink:
        """Open a link.

        A usual MAVLink address falls back to any local port where its own is in use; a ground station of
        pprzlink must know the port to send to.
        """
        greet = partial(self._greet, place)
        try:
            return listen(self.kernel, address, on_connect=greet, codec=codec)
        except UsageError:
            port = address.options.get(LOCAL_PORT)
            if not usual or port is None or codec is not MAVLINK:
                raise
            self._notice(
                f"UDP port {port} is in use: {address.host}:{address.port} is served from another port"
            )
            return listen(self.kernel, address.with_option(LOCAL_PORT, "0"), on_connect=greet, codec=codec)

    def _record(self, event: Event) -> None:
        if isinstance(event, LinkState) and event.state in ("full", "dropped"):
            self._notice(f"{event.link}: {event.detail}")

    def _greet(self, place: int) -> None:
        self.links[place].send_bytes(self._autopilot.banner)

    def run(self, ready: Callable[[], None] = lambda: None) -> None:
        """Call *ready* and serve until ``KeyboardInterrupt``."""
        ready()
        try:
            self.kernel.run(FOREVER)
        finally:
            self.fleet.close()
            for link in self.links:
                link.close()
            self.kernel.close("the server was stopped")


class VehicleNodeServer:
    """One simulated vehicle that is served as a node of a real ROS graph.

    Args:
        wanted: The vehicle.
        graph: ``ros1`` or ``ros2``.
        namespace: Namespace of the node; by default that of the node of a real aircraft.
        speed: Simulated seconds per second.
        seed: Seed of the simulation.

    Raises:
        UsageError: The firmware is reached over links, or the graph is not available.
        LinkError: The graph does not answer.
    """

    def __init__(
        self, wanted: SimulatedVehicle, graph: str, namespace: str = "", *, speed: float = 1.0, seed: int = 1
    ) -> None:
        self.kernel = VirtualKernel(pace=speed)
        self.fleet: SimulatedFleet = fleet_of(self.kernel, [wanted], seed)
        name = wanted.vehicle.name
        if self.fleet.family(name).codec is not None:
            raise UsageError(f"{name}: a simulated {wanted.vehicle.autopilot} has a link and no ROS node")
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
            self.fleet.close()
            self.graph.close()
            self.kernel.close("the server was stopped")
