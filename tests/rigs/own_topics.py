"""A simulated vehicle behind a node with its autopilot's own ROS 2 names, and its driver on that graph."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from rigs.missions import carried_out
from volery.bridge import MAVLINK_SCHEMES, VehicleNodeOptions, serve_vehicle
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import sleep
from volery.ros.graph import EmbeddedGraph
from volery.run.assembly.simulated_fleet import fleet_of
from volery.run.assembly.simulated_vehicles import parse_simulated
from volery.vehicles import Drone, Vehicle
from volery.vehicles.address import parse


def flown_over_own_topics(
    url: str,
    names: str,
    open_driver: Callable[..., Any],
    mission: Callable[[Any, Callable[[int], None]], Any],
    kind: type[Vehicle] = Drone,
    **options: str,
) -> Any:
    """Return what *mission* returns; it gets the vehicle on the graph, and what lets ns pass."""
    kernel = VirtualKernel()
    wanted = parse_simulated(parse(url), "craft_1")
    fleet = fleet_of(kernel, [wanted], 1)
    graph = EmbeddedGraph(kernel)
    node = VehicleNodeOptions(names=MAVLINK_SCHEMES[names])
    serve_vehicle(graph, fleet.link_for(wanted), "", ExecutionContext("vehicle node"), node)

    def body() -> Any:
        driver = open_driver(kernel, graph.node("control"), "craft_1", options)
        return mission(kind(kernel, "craft_1", driver), partial(sleep, kernel))

    try:
        return carried_out(kernel, body)
    finally:
        fleet.close()
