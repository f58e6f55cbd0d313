"""Vehicles on a graph: which node serves an autopilot there, under which names, and the driver that finds it.

| the autopilot's links speak | its node | its names |
|---|---|---|
| MAVLink | ``bridge.VehicleNode`` | MAVROS's, under ``/<vehicle>`` |
| pprzlink | ``bridge.PprzrosNode`` | pprzros's, under ``/<vehicle>`` |
| nothing: it is on the graph itself | its own | its SDK's, where its driver looks for them |
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from volery.base.errors import CapabilityError
from volery.bridge import serve_pprzros, serve_vehicle
from volery.cost import Price
from volery.graph import Graph
from volery.graph.node import NodeId
from volery.kernel.api import Action, Kernel
from volery.kernel.task import Place
from volery.links.link import Link
from volery.run.airfield import LINK_DELAY, Airfield
from volery.run.simulated import Simulated, link_to
from volery.vehicles.driver import Driver, Opener, drivers

Serve = Callable[[Graph, Link, str, Place], object]
"""``serve(graph, link, vehicle, place)``."""

NODES: Mapping[str, Serve] = {"MAVLink": serve_vehicle, "pprzlink": serve_pprzros}
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


def serve(graph: Graph, airfield: Airfield, vehicle: str, how: Serving, place: Place) -> None:
    """Start the node that serves a simulated *vehicle*, computing at *place*."""
    codec = airfield.family(vehicle).codec
    if codec is None:
        airfield.autopilots[vehicle].join(graph, how.namespace, place)
        return
    NODES[codec.name](graph, airfield.link(vehicle), vehicle, place)


def quiet_graph(kernel: Kernel) -> Graph:
    """A graph for vehicles that a script commands: its calls cost nothing, messages take as long as over a
    serial line, nothing is recorded.
    """

    def carry(_one: NodeId, _other: NodeId, _size: int, _sure: bool, deliver: Action, _lost: Action) -> None:
        kernel.call_at(kernel.now() + LINK_DELAY, deliver)

    return Graph(kernel, lambda node, call, x: FREE, carry, records=lambda topic: False)


def open_simulated(kernel: Kernel, airfield: Airfield, wanted: Simulated, seed: int) -> Driver:
    """The driver of a simulated vehicle for a script: on a link, or on a graph that holds the two alone.

    Raises ``CapabilityError`` for faults of a wire where there is none.
    """
    vehicle, autopilot = wanted.vehicle.name, wanted.vehicle.autopilot
    factory = drivers.load(autopilot)
    if airfield.family(vehicle).codec is not None and factory.on_link is not None:
        link = link_to(kernel, airfield, wanted, seed)
        return factory.on_link(kernel, link, vehicle, SIMULATED)
    if wanted.faults is not None:
        raise CapabilityError(f"{vehicle}: {autopilot} is reached over a graph: there is no wire to it")
    how, graph = serving(autopilot, vehicle), quiet_graph(kernel)
    serve(graph, airfield, vehicle, how, Place(vehicle))
    node = graph.node("commander", f"/{vehicle}", place=Place(f"commander of {vehicle}"))
    return how.open_driver(kernel, node, vehicle, {"namespace": how.namespace})


FREE = Price(0, 0)
