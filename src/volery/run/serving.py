"""Vehicles on a graph: which node serves an autopilot there, under which names, and the driver that finds it.

| the autopilot's links speak | its node | its names |
|---|---|---|
| MAVLink | ``bridge.VehicleNode`` | MAVROS's, under ``/<vehicle>`` |
| pprzlink | ``bridge.PprzrosNode`` | pprzros's, under ``/<vehicle>`` |
| nothing: it is on the graph itself | its own | its SDK's, where its driver looks for them |
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from volery.base.errors import CapabilityError
from volery.base.frames import LocalFrame
from volery.base.seeds import stream
from volery.bridge import VehicleNodeOptions, serve_pprzros, serve_vehicle
from volery.kernel.api import Kernel
from volery.kernel.task import Place
from volery.links.link import Link
from volery.links.wire import WireFaults
from volery.ros.graph import RosGraph
from volery.run.graph_wire import GraphWire, private_graph
from volery.run.simulated import Simulated, link_to
from volery.vehicles.driver import Driver, Opener, drivers

if TYPE_CHECKING:
    from volery.run.airfield import Airfield

Serve = Callable[[RosGraph, Link, str, Place, LocalFrame], object]
"""``serve(graph, link, vehicle, place, origin)``."""


def _mavros(graph: RosGraph, link: Link, vehicle: str, place: Place, origin: LocalFrame) -> object:
    return serve_vehicle(graph, link, vehicle, place, VehicleNodeOptions(origin=origin))


def _pprzros(graph: RosGraph, link: Link, vehicle: str, place: Place, origin: LocalFrame) -> object:
    return serve_pprzros(graph, link, vehicle, place)


NODES: Mapping[str, Serve] = {"MAVLink": _mavros, "pprzlink": _pprzros}
"""By the codec's name."""


SIMULATED = {"texts": "unrecorded"}
"""Options of the driver of a simulated vehicle on a link: its autopilot records its texts itself."""


@dataclass(frozen=True)
class Serving:
    """How one vehicle is reached on a graph."""

    open_driver: Opener
    namespace: str


def serving(autopilot: str, vehicle: str) -> Serving:
    """For a *vehicle* with this *autopilot*. Raises ``CapabilityError`` if nothing finds it on a graph."""
    factory = drivers.load(autopilot)
    if factory.on_graph is None:
        raise CapabilityError(
            f"{vehicle}: components command vehicles over a graph, and the driver {autopilot!r} knows none"
        )
    return Serving(factory.on_graph, factory.namespace.format(name=vehicle))


def serve(graph: RosGraph, airfield: Airfield, vehicle: str, how: Serving, place: Place) -> None:
    """Start the node that serves a simulated *vehicle*, computing at *place*."""
    codec = airfield.family(vehicle).codec
    if codec is None:
        airfield.autopilots[vehicle].join(graph, how.namespace, place)
        return
    NODES[codec.name](graph, airfield.link(vehicle), vehicle, place, airfield.frame)


class PrivateGraph:
    """A graph that holds a simulated vehicle and those who command it, as a link would join them."""

    def __init__(self, kernel: Kernel, airfield: Airfield, wanted: Simulated, seed: int) -> None:
        self._kernel = kernel
        self._vehicle = wanted.vehicle.name
        how = serving(wanted.vehicle.autopilot, self._vehicle)
        self._how = replace(how, namespace=f"/{self._vehicle}/{wanted.names}") if wanted.names else how
        self._wire = GraphWire(kernel, stream(seed, f"wire/{self._vehicle}"), wanted.faults)
        self.graph = private_graph(kernel, self._wire, as_bytes=wanted.faults is not None)
        serve(self.graph, airfield, self._vehicle, self._how, Place(self._vehicle))

    def suffer(self, faults: WireFaults) -> None:
        """From now on this happens to what passes, in both directions."""
        self._wire.suffer(faults)

    def open(self, commander: str = "commander", **options: str) -> Driver:
        """A driver of the vehicle, on a node called *commander*."""
        place = Place(f"{commander} of {self._vehicle}")
        node = self.graph.node(commander, f"/{self._vehicle}", place=place)
        stated = {"namespace": self._how.namespace, **options}
        return self._how.open_driver(self._kernel, node, self._vehicle, stated)


def on_links(airfield: Airfield, wanted: Simulated) -> bool:
    """Whether a script reaches this vehicle over a link; else over a graph."""
    factory = drivers.load(wanted.vehicle.autopilot)
    return airfield.family(wanted.vehicle.name).codec is not None and factory.on_link is not None


def open_simulated(kernel: Kernel, airfield: Airfield, wanted: Simulated, seed: int) -> Driver:
    """The driver of a simulated vehicle for a script: on a link, or on a graph that holds the two alone."""
    open_on_link = drivers.load(wanted.vehicle.autopilot).on_link
    if open_on_link is not None and on_links(airfield, wanted):
        link = link_to(kernel, airfield, wanted, seed)
        return open_on_link(kernel, link, wanted.vehicle.name, SIMULATED)
    return PrivateGraph(kernel, airfield, wanted, seed).open()
