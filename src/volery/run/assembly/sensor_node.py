"""The node that publishes what the added sensors of a simulated vehicle measure: their drivers on board."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from volery.base.time import Ns, S
from volery.bridge.node_interface import stamped
from volery.kernel.task import ExecutionContext
from volery.ros.graph import DEFAULT, Node, Publisher, RosGraph
from volery.ros.messages import new

if TYPE_CHECKING:
    from volery.simulation.autopilots.flight_stack.flight import Flight
    from volery.simulation.world.sensors import Sensor

NODE = "sensors"


def serve_sensors(graph: RosGraph, flight: Flight, namespace: str, context: ExecutionContext) -> None:
    """Publish each sample of a vehicle's added sensors on ``NAMESPACE/NAME``, until the end of the run.

    Args:
        graph: The graph.
        flight: The vehicle's flight.
        namespace: Namespace of the vehicle, such as ``/drone_1``.
        context: What the drivers' work is charged to: the computer on board.
    """
    published = [sensor for sensor in flight.added_sensors() if sensor.type]
    if not published:
        return
    kernel = graph.kernel

    def run() -> None:
        node = graph.node(NODE, namespace, context=context)
        for sensor in published:
            publisher = node.advertise(sensor.name, sensor.type, DEFAULT)
            drive = partial(_drive, node, publisher, flight, sensor, graph.epoch)
            kernel.spawn(drive, f"{context.component} ({sensor.name})", context, kernel.root)

    kernel.spawn(run, f"{context.component} (sensors)", context, kernel.root)


def _drive(node: Node, publisher: Publisher, flight: Flight, sensor: Sensor, epoch: Ns) -> None:
    """Publish the samples of one sensor as they come."""
    rate = node.rate(round(S / sensor.rate))
    while not node.closed:
        rate.sleep()
        sample = flight.measurement(sensor.name)
        message = new(sensor.type)
        if hasattr(message, "header"):
            message.header = stamped(epoch + sample.time, sensor.name)
        sensor.fill(message, sample.values)
        publisher.publish(message)
