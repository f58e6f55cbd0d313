"""A graph that joins one simulated vehicle and those who command it, and what can happen to its messages.

It stands for the wire of a vehicle that is reached over a graph: its calls cost nothing and nothing of it is
recorded. With faults, messages travel as frames of a transport do: numbered, with a checksum. So

* a frame of which any bit is turned, or that ends too early, is dropped, as is one within a cut;
* a frame that comes twice is taken once; one that is overtaken comes late;
* a request or an answer that is lost is given up after ``GIVE_UP_AFTER``: its caller is told.

Vehicles on a graph: which node serves an autopilot there, under which names, and the driver that finds it.

| the autopilot's links speak | its node | its names |
|---|---|---|
| MAVLink | ``bridge.VehicleNode`` | MAVROS's, under ``/<vehicle>`` |
| pprzlink | ``bridge.PprzrosNode`` | pprzros's, under ``/<vehicle>`` |
| nothing: it is on the graph itself | its own | its SDK's, where its driver looks for them |
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from random import Random
from typing import TYPE_CHECKING

from volery.base.errors import CapabilityError
from volery.base.frames import LocalFrame
from volery.base.seeds import stream
from volery.base.time import MS, Ns
from volery.bridge import VehicleNodeOptions, serve_pprzros, serve_vehicle
from volery.kernel.api import Action, Kernel
from volery.kernel.task import ExecutionContext
from volery.links.link import Link
from volery.links.wire_faults import REORDER_DELAY, WireFaults
from volery.ros.graph import EmbeddedGraph, RosGraph
from volery.ros.graph.interface import NodeId, Route
from volery.run.assembly.simulated_vehicles import LINK_DELAY, SimulatedVehicle, link_to
from volery.vehicles.driver import Driver, Opener, drivers

if TYPE_CHECKING:
    from volery.run.assembly.simulated_fleet import SimulatedFleet

FRAME_OVERHEAD = 30
"""Bytes that a transport adds to a message."""
GIVE_UP_AFTER: Ns = 500 * MS
NO_FAULTS = WireFaults()
"""Nothing happens to what passes."""


class GraphWire:
    """The way of messages between two nodes. Faults are drawn from *random* in the order of sending."""

    def __init__(self, kernel: Kernel, random: Random, faults: WireFaults | None = None) -> None:
        self._kernel = kernel
        self._random = random
        self._faults = faults or NO_FAULTS
        self._latest: dict[tuple[str, str], Ns] = {}
        self._together: list[Action] = []  # what was sent at this instant
        self._sent: Ns = -1

    def set_faults(self, faults: WireFaults) -> None:
        """From now on this happens to what passes, in both directions."""
        self._faults = faults

    def between(self, sender: NodeId, receiver: NodeId) -> Route:
        """See ``volery.ros.graph.Routing``. Messages of a pair keep their order, unless faults say so."""
        return partial(self._carry, sender.name, receiver.name)

    def _carry(
        self, sender: str, receiver: str, size: int, _sure: bool, deliver: Action, lost: Action
    ) -> None:
        now = self._kernel.now()
        if self._faults is NO_FAULTS and not self._latest:
            self._carry_whole(now, deliver)
            return
        if self._is_lost(size + FRAME_OVERHEAD):
            self._kernel.call_at(now + GIVE_UP_AFTER, lost)
            return
        faults, random = self._faults, self._random
        late = int(random.random() * faults.jitter) if faults.jitter else 0
        way = sender, receiver
        self._latest[way] = arrives = max(self._latest.get(way, 0), now + LINK_DELAY + late)
        if faults.reorder and random.random() < faults.reorder:
            arrives += REORDER_DELAY
        self._kernel.call_at(arrives, deliver)

    def _carry_whole(self, now: Ns, deliver: Action) -> None:
        """Without faults all that is sent at one instant arrives at one instant."""
        if self._sent != now:
            self._sent, self._together = now, []
            together = self._together
            self._kernel.call_at(now + LINK_DELAY, lambda: _run_all(together))
        self._together.append(deliver)

    def _is_lost(self, octets: int) -> bool:
        faults, random = self._faults, self._random
        chances = [faults.drop, faults.burst, faults.truncate]
        if faults.flip:
            chances.append(1.0 - (1.0 - faults.flip) ** octets)
        drawn = [random.random() < chance for chance in chances if chance]
        return any(drawn) or faults.cut_at(self._kernel.now())


def _run_all(actions: list[Action]) -> None:
    for action in actions:
        action()


def private_graph(kernel: Kernel, wire: GraphWire, *, as_bytes: bool) -> EmbeddedGraph:
    """A graph whose messages go over *wire*: as values, or as what is left of them after their bytes."""
    return EmbeddedGraph(kernel, between=wire.between, unrecorded=True, as_bytes=as_bytes)


Serve = Callable[[RosGraph, Link, str, ExecutionContext, LocalFrame], object]
"""``serve(graph, link, vehicle, place, origin)``."""


def _mavros(graph: RosGraph, link: Link, vehicle: str, place: ExecutionContext, origin: LocalFrame) -> object:
    return serve_vehicle(graph, link, vehicle, place, VehicleNodeOptions(origin=origin))


def _pprzros(
    graph: RosGraph, link: Link, vehicle: str, place: ExecutionContext, origin: LocalFrame
) -> object:
    return serve_pprzros(graph, link, vehicle, place)


NODES: Mapping[str, Serve] = {"MAVLink": _mavros, "pprzlink": _pprzros}
"""By the codec's name."""


SIMULATED_LINK_OPTIONS = {"texts": "unrecorded"}
"""Options of the driver of a simulated vehicle on a link: its autopilot records its texts itself."""


@dataclass(frozen=True)
class GraphAccess:
    """How one vehicle is reached on a graph."""

    open_driver: Opener
    namespace: str


def graph_access(autopilot: str, vehicle: str) -> GraphAccess:
    """For a *vehicle* with this *autopilot*. Raises ``CapabilityError`` if nothing finds it on a graph."""
    factory = drivers.load(autopilot)
    if factory.on_graph is None:
        raise CapabilityError(
            f"{vehicle}: components command vehicles over a graph, and the driver {autopilot!r} knows none"
        )
    return GraphAccess(factory.on_graph, factory.namespace.format(name=vehicle))


def serve_on_graph(
    graph: RosGraph, airfield: SimulatedFleet, vehicle: str, how: GraphAccess, place: ExecutionContext
) -> None:
    """Start the node that serves a simulated *vehicle*, computing at *place*."""
    codec = airfield.family(vehicle).codec
    if codec is None:
        airfield.autopilots[vehicle].join(graph, how.namespace, place)
        return
    NODES[codec.name](graph, airfield.link(vehicle), vehicle, place, airfield.frame)


class PrivateGraph:
    """A graph that holds a simulated vehicle and those who command it, as a link would join them."""

    def __init__(self, kernel: Kernel, airfield: SimulatedFleet, wanted: SimulatedVehicle, seed: int) -> None:
        self._kernel = kernel
        self._vehicle = wanted.vehicle.name
        how = graph_access(wanted.vehicle.autopilot, self._vehicle)
        self._how = replace(how, namespace=f"/{self._vehicle}/{wanted.names}") if wanted.names else how
        self._wire = GraphWire(kernel, stream(seed, f"wire/{self._vehicle}"), wanted.faults)
        self.graph = private_graph(kernel, self._wire, as_bytes=wanted.faults is not None)
        serve_on_graph(self.graph, airfield, self._vehicle, self._how, ExecutionContext(self._vehicle))

    def set_faults(self, faults: WireFaults) -> None:
        """From now on this happens to what passes, in both directions."""
        self._wire.set_faults(faults)

    def open(self, commander: str = "commander", **options: str) -> Driver:
        """A driver of the vehicle, on a node called *commander*."""
        place = ExecutionContext(f"{commander} of {self._vehicle}")
        node = self.graph.node(commander, f"/{self._vehicle}", context=place)
        stated = {"namespace": self._how.namespace, **options}
        return self._how.open_driver(self._kernel, node, self._vehicle, stated)


def reached_over_links(airfield: SimulatedFleet, wanted: SimulatedVehicle) -> bool:
    """Whether a script reaches this vehicle over a link; else over a graph."""
    factory = drivers.load(wanted.vehicle.autopilot)
    return airfield.family(wanted.vehicle.name).codec is not None and factory.on_link is not None


def open_simulated_driver(
    kernel: Kernel, airfield: SimulatedFleet, wanted: SimulatedVehicle, seed: int
) -> Driver:
    """The driver of a simulated vehicle for a script: on a link, or on a graph that holds the two alone."""
    open_on_link = drivers.load(wanted.vehicle.autopilot).on_link
    if open_on_link is not None and reached_over_links(airfield, wanted):
        link = link_to(kernel, airfield, wanted, seed)
        return open_on_link(kernel, link, wanted.vehicle.name, SIMULATED_LINK_OPTIONS)
    return PrivateGraph(kernel, airfield, wanted, seed).open()
