"""Vehicles on a graph: which node serves an autopilot there, under which names, and the driver that finds it.

| the autopilot's links speak | its node | its names |
|---|---|---|
| MAVLink | ``bridge.VehicleNode`` | MAVROS's, under ``/<vehicle>`` |
| nothing: it is on the graph itself | its own | its SDK's, where its driver looks for them |
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from volery.base.errors import CapabilityError
from volery.bridge import serve_vehicle
from volery.graph import Graph
from volery.kernel.task import Place
from volery.links.link import Link
from volery.run.airfield import Airfield
from volery.vehicles.driver import Opener, drivers

Serve = Callable[[Graph, Link, str, Place], object]
"""``serve(graph, link, vehicle, place)``."""

NODES: Mapping[str, Serve] = {"MAVLink": serve_vehicle}
"""By the codec's name."""


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
