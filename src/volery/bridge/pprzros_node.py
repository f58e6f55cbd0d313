"""The pprzros node: the messages of a Paparazzi aircraft's link on two topics, unchanged.

A loop publishes the messages of the aircraft on ``pprzros/to_ros`` (10 Hz, as pprzros does); messages on
``pprzros/from_ros`` are sent as they arrive. All work is charged to the node's context as calls into ROS;
decoding pprzlink is not charged.

Differences from pprzros: ``comp_id``, ``receiver_id`` and ``checksum`` are filled in; a message that cannot
be sent is dropped with a warning.
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
from volery.ros.graph import RosGraph
from volery.trace.events import Text

PERIOD: Ns = 100 * MS
MAX_WAITING = 200
"""Frames that wait for the loop; the queues of pprzros are shorter."""


class PprzrosNode:
    """Serves the aircraft behind *link* under *namespace* (``/drone_1/pprzros/to_ros``), from ``start`` on.

    pprzros itself uses the root namespace ``/``.
    """

    def __init__(self, graph: RosGraph, link: Link, namespace: str) -> None:
        self._graph, self._kernel = graph, graph.kernel
        self._link = link
        self.namespace = namespace
        self._unpublished: list[tuple[Frame, Ns]] = []
        self._component = ""
        self._aircraft: set[int] = set()
        link.receive(self._on_frame)

    def start(self, context: ExecutionContext, scope: Scope) -> Task:
        """Spawn the task of the node, which executes in *context* and ends with *scope*."""
        self._component = context.component
        return self._kernel.spawn(lambda: self._run(context, scope), context.component, context, scope)

    @property
    def summary(self) -> str:
        """Ids of the aircraft that have sent frames; empty if there are none."""
        return f"aircraft {', '.join(map(str, sorted(self._aircraft)))}" if self._aircraft else ""

    def _on_frame(self, frame: Frame) -> None:
        """Queue a frame. Framework callback."""
        self._aircraft.add(frame.system)
        if len(self._unpublished) < MAX_WAITING:
            self._unpublished.append((frame, self._kernel.now()))

    def _run(self, context: ExecutionContext, scope: Scope) -> None:
        node = self._graph.node("pprzros", self.namespace, context=context)
        publisher = node.advertise(TO_ROS, TYPE)
        group = node.group()
        node.subscribe(FROM_ROS, TYPE, self._send, group=group)
        helper = replace(context, deadline=None, period=None, on_release=None)
        self._kernel.spawn(group.spin, f"{context.component} (datalink)", helper, scope)
        rate = node.rate(PERIOD)
        while not node.closed:
            with self._kernel:
                received, self._unpublished = self._unpublished, []
            for frame, at in received:
                publisher.publish(to_message(frame, self._graph.epoch + at))
            rate.sleep()

    def _send(self, message: Any) -> None:
        try:
            frame = to_frame(message)
            with self._kernel:
                self._link.send(frame)
        except UsageError as error:
            with self._kernel as kernel:
                text = f"{FROM_ROS}: message dropped: {error}"
                kernel.record(Text(kernel.now(), self._component, WARNING, text))


def serve_pprzros(graph: RosGraph, link: Link, name: str, context: ExecutionContext) -> PprzrosNode:
    """Serve the aircraft behind *link* under ``/name`` until the end of the run, executing in *context*."""
    served = PprzrosNode(graph, link, f"/{name}")
    served.start(context, graph.kernel.root)
    return served
