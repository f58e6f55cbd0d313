"""The pprzros node: a Paparazzi aircraft's link on the graph, message by message, and nothing else.

What the aircraft says is published on ``pprzros/to_ros`` by a loop (10 Hz, as pprzros's own), what is
published on ``pprzros/from_ros`` is sent as it comes. Everything is charged to the node's place as calls into
ROS; the decoding of pprzlink itself is not counted.

Differences from pprzros: ``comp_id``, ``receiver_id`` and ``checksum`` are filled in; what cannot be sent is
dropped with a warning.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import MS, Ns
from volery.bridge.vehicle_node import WARNING
from volery.kernel.task import ExecutionContext, Scope, Task
from volery.links.link import Frame, Link
from volery.links.pprzros_messages import FROM_ROS, TO_ROS, TYPE, to_frame, to_message
from volery.ros.graph import Node, RosGraph
from volery.trace.events import Text

PERIOD: Ns = 100 * MS
MAX_WAITING = 200
"""Frames that wait for the loop; pprzros's queues are shorter."""


class PprzrosNode:
    """Serves the aircraft behind *link* under *namespace*: ``/drone_1/pprzros/to_ros``; pprzros itself is
    at the root, ``/``.

    ``start`` it, then its task does the rest.
    """

    def __init__(self, graph: RosGraph, link: Link, namespace: str) -> None:
        self._graph, self._kernel = graph, graph.kernel
        self._link = link
        self.namespace = namespace
        self._fresh: list[tuple[Frame, Ns]] = []
        self._component = ""
        self._heard_of: set[int] = set()
        link.receive(self._heard)

    def start(self, place: ExecutionContext, scope: Scope) -> Task:
        """Spawn the node's task: its computing is spent at *place*, it ends with *scope*."""
        self._component = place.component
        return self._kernel.spawn(lambda: self._run(place, scope), place.component, place, scope)

    @property
    def summary(self) -> str:
        """Whom it hears; empty while it hears nobody."""
        return f"aircraft {', '.join(map(str, sorted(self._heard_of)))}" if self._heard_of else ""

    def _heard(self, frame: Frame) -> None:
        """House code."""
        self._heard_of.add(frame.system)
        if len(self._fresh) < MAX_WAITING:
            self._fresh.append((frame, self._kernel.now()))

    def _run(self, place: ExecutionContext, scope: Scope) -> None:
        node = self._graph.node("pprzros", self.namespace, context=place)
        publisher = node.advertise(TO_ROS, TYPE)
        self._listen(node, replace(place, deadline=None, on_release=None), scope)
        rate = node.rate(PERIOD)
        while not node.closed:
            with self._kernel:
                heard, self._fresh = self._fresh, []
            for frame, at in heard:
                publisher.publish(to_message(frame, self._graph.epoch + at))
            rate.sleep()

    def _listen(self, node: Node, aside: ExecutionContext, scope: Scope) -> None:
        group = node.group()
        node.subscribe(FROM_ROS, TYPE, self._send, group=group)
        self._kernel.spawn(group.spin, f"{aside.component} (datalink)", aside, scope)

    def _send(self, message: Any) -> None:
        try:
            frame = to_frame(message)
            with self._kernel:
                self._link.send(frame)
        except UsageError as error:
            with self._kernel as kernel:
                what = f"{FROM_ROS}: message dropped: {error}"
                kernel.record(Text(kernel.now(), self._component, WARNING, what))


def serve_pprzros(graph: RosGraph, link: Link, name: str, place: ExecutionContext) -> PprzrosNode:
    """Serve the aircraft behind *link* under ``/name`` until the run ends, computing at *place*."""
    served = PprzrosNode(graph, link, f"/{name}")
    served.start(place, graph.kernel.root)
    return served
