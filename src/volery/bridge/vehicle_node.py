"""The vehicle node: one vehicle on the graph, under MAVROS's names or roscopter's.

Telemetry is published by a loop. With a period (10 Hz unless told otherwise) it says what is repeated all
the time in its latest form, each HEARTBEAT, text, parameter and reached waypoint as it came; without one
it publishes what arrives as it arrives, and sleeps in between. Set-points go on as they arrive, in a task
of their own; each service request has a task of its own, so a command that waits for its acknowledgement
holds up nobody. Everything is charged to the node's place as calls into ROS; the decoding of MAVLink
itself is not counted.

What the graph has no types for is left out, with a warning.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.geoid import EGM96, Geoid
from volery.base.time import MS, Ns, S
from volery.bridge.autopilot_link import AutopilotLink, ReceivedFrame, StreamRequests
from volery.bridge.mavros_names import MAVROS
from volery.bridge.mode_names import AUTOPILOT_NAMES, mode_name
from volery.bridge.node_interface import InterfaceContext, NamingScheme, NodeInterface, Service, Subscription
from volery.kernel.task import ExecutionContext, Scope, Task
from volery.links.link import Link
from volery.ros.graph import Node, Publisher, RosGraph
from volery.ros.graph.interface import Work
from volery.trace.events import Text

ONBOARD_CONTROLLER, NO_AUTOPILOT, ACTIVE = 18, 8, 4
SAFETY_ARMED = 128
"""MAV_MODE_FLAG."""
WARNING = 4
INVALID_VALUES = (ValueError, OverflowError, UsageError)
"""What comes of numbers that make no sense, in a message or in a frame."""


@dataclass(frozen=True)
class VehicleNodeOptions:
    """How a vehicle node works.

    ``period`` of its loop, ``None``: as frames arrive; ``streams`` it asks the autopilot for (hertz by
    MAV_DATA_STREAM), those of the names unless given; ``silent`` until the autopilot counts as disconnected;
    ``system`` and ``component`` are its MAVLink ids, ``vehicle`` the autopilot's, 0: whichever is heard
    first; ``control``: roscopter's ``send_rc`` is taken; ``origin``: what the frame ``map`` is about, the
    autopilot's own unless given.
    """

    names: NamingScheme = MAVROS
    period: Ns | None = 100 * MS
    streams: Mapping[int, int] | None = None
    silent: Ns = 10 * S
    system: int = 255
    component: int = 191
    vehicle: int = 0
    geoid: Geoid = EGM96
    control: bool = False
    origin: LocalFrame | None = None


class VehicleNode:
    """Serves the autopilot behind *link* under *namespace* (``/drone_1``).

    ``start`` it, then its task does the rest.
    """

    def __init__(
        self, graph: RosGraph, link: Link, namespace: str, options: VehicleNodeOptions = VehicleNodeOptions()
    ) -> None:
        self._graph, self._kernel = graph, graph.kernel
        self.namespace, self.options = namespace, options
        self.wire = AutopilotLink(graph.kernel, link, options.system, options.component, options.vehicle)
        rates = options.names.streams if options.streams is None else options.streams
        self._streams = StreamRequests(self.wire, rates, home=options.names.home and bool(rates))
        self._publishers: dict[str, Publisher] = {}
        self._on_demand: set[str] = set()
        self._warned: set[str] = set()
        self._next_heartbeat: Ns = 0
        self.connected = False
        self._component = ""

    def start(self, place: ExecutionContext, scope: Scope) -> Task:
        """Spawn the node's task: its computing is spent at *place*, it ends with *scope*."""
        self._component = place.component
        return self._kernel.spawn(lambda: self._run(place, scope), place.component, place, scope)

    @property
    def summary(self) -> str:
        """Whom it hears, in which mode; empty while it hears nobody."""
        beat = self.wire.last("HEARTBEAT")
        if beat is None or not self.connected:
            return ""
        number = beat["autopilot"]
        who = AUTOPILOT_NAMES.get(number, f"autopilot {number}")
        mode = mode_name(self.wire.firmware, beat["custom_mode"])
        armed = "armed" if beat["base_mode"] & SAFETY_ARMED else "disarmed"
        return f"{who} (system {self.wire.target[0]}): {mode}, {armed}"

    def _run(self, place: ExecutionContext, scope: Scope) -> None:
        options = self.options
        node = self._graph.node(options.names.node, self.namespace, context=place)
        aside = replace(place, deadline=None, on_release=None)
        offering = options.names.offer(
            InterfaceContext(
                node,
                self.wire,
                self._publish,
                self._wanted,
                self._warn,
                options.geoid,
                options.control,
                options.origin,
            )
        )
        self.wire.only(offering.translators)
        self._advertise(node, offering)
        self._subscribe(node, offering, aside, scope)
        self._serve(node, offering, aside, scope)
        self._go_round(node, offering)

    def _go_round(self, node: Node, offering: NodeInterface) -> None:
        period = self.options.period
        rate = None if period is None else node.rate(period)
        while not node.closed:
            self._cycle(offering)
            if rate is not None:
                rate.sleep()
            else:
                self.wire.wait(self._next_heartbeat)

    def _warn(self, text: str) -> None:
        with self._kernel as kernel:
            kernel.record(Text(kernel.now(), self._component, WARNING, text))

    # -- what it sets up

    def _tried(self, make: Callable[[], object], missing: list[str]) -> None:
        """A real ROS 2 may lack a type."""
        try:
            make()
        except UsageError as error:
            missing.append(str(error))

    def _advertise(self, node: Node, offering: NodeInterface) -> None:
        def advertise(name: str, kind: str, qos: Any) -> None:
            self._publishers[name] = node.advertise(name, kind, qos)

        missing: list[str] = []
        for topic in offering.topics:
            self._tried(partial(advertise, *topic[:3]), missing)
            if topic.on_demand:
                self._on_demand.add(topic.name)
        self._say_missing("topics", missing)

    def _say_missing(self, what: str, missing: list[str]) -> None:
        if missing:
            self._warn(f"{len(missing)} {what} are left out; the first: {missing[0]}")

    def _publish(self, topic: str, message: Any) -> None:
        publisher = self._publishers.get(topic)
        if publisher is not None:
            publisher.publish(message)

    def _wanted(self, topic: str) -> bool:
        publisher = self._publishers.get(topic)
        return publisher is not None and (topic not in self._on_demand or publisher.subscribers() > 0)

    def _subscribe(self, node: Node, offering: NodeInterface, aside: ExecutionContext, scope: Scope) -> None:
        group = node.group()
        missing: list[str] = []
        for one in offering.subscriptions:
            command = partial(self._command, node, one)
            self._tried(partial(node.subscribe, one.name, one.type, command, group=group), missing)
        self._say_missing("subscriptions", missing)
        self._kernel.spawn(group.spin, f"{aside.component} (set-points)", aside, scope)

    def _command(self, node: Node, subscription: Subscription, message: Any) -> None:
        """Send a set-point on; one that makes no sense is dropped, with a warning."""
        try:
            name, fields = subscription.translate(message, self._kernel.now())
            with self._kernel:
                self.wire.send_to(name, fields)
        except INVALID_VALUES as error:
            self._warn(f"{node.resolve(subscription.name)}: message dropped: {error}")

    def _serve(self, node: Node, offering: NodeInterface, aside: ExecutionContext, scope: Scope) -> None:
        def run(work: Work) -> None:
            try:
                work.run()
            except INVALID_VALUES as error:
                self._warn(f"service request refused: {error}")

        def start(work: Work) -> None:
            self._kernel.spawn(lambda: run(work), f"{aside.component} (service)", aside, scope)

        def serve(name: str, service: Service) -> None:
            node.serve(name, *service, group)

        group = node.group(start)
        missing: list[str] = []
        for name, service in offering.services.items():
            self._tried(partial(serve, name, service), missing)
        self._say_missing("services", missing)

    # -- its loop

    def _cycle(self, offering: NodeInterface) -> None:
        with self._kernel as kernel:
            now = kernel.now()
            heard = self.wire.take()
        for one in heard:
            self._translate(offering, one)
        self._watch_connection(offering, now)
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + S
            self._send_heartbeat()
        self._streams.look(now)

    def _translate(self, offering: NodeInterface, heard: ReceivedFrame) -> None:
        """Publish what a frame says; of what makes no sense one is warned once for each kind of frame."""
        frame, at = heard
        for translate in offering.translators.get(frame.name, ()):
            try:
                translate(frame.fields, self._graph.epoch + at)
            except INVALID_VALUES as error:
                if frame.name not in self._warned:
                    self._warned.add(frame.name)
                    self._warn(f"{frame.name}: not published: {error}")

    def _watch_connection(self, offering: NodeInterface, now: Ns) -> None:
        last = self.wire.last_heartbeat
        connected = last is not None and now - last < self.options.silent
        if self.connected and not connected:
            offering.disconnected(self._graph.epoch + now)
        self.connected = connected

    def _send_heartbeat(self) -> None:
        fields = {
            "type": ONBOARD_CONTROLLER,
            "autopilot": NO_AUTOPILOT,
            "base_mode": 0,
            "custom_mode": 0,
            "system_status": ACTIVE,
            "mavlink_version": 3,
        }
        self.wire.send("HEARTBEAT", fields)


def serve_vehicle(
    graph: RosGraph,
    link: Link,
    name: str,
    place: ExecutionContext,
    options: VehicleNodeOptions = VehicleNodeOptions(),
) -> VehicleNode:
    """Serve the autopilot behind *link* under ``/name`` until the run ends, computing at *place*."""
    served = VehicleNode(graph, link, f"/{name}", options)
    served.start(place, graph.kernel.root)
    return served
