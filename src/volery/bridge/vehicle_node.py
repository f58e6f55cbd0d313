"""The vehicle node: one vehicle on the graph under MAVROS's or roscopter's names, or as pprzros serves it.

A loop publishes telemetry. With a period (10 Hz by default) it publishes each HEARTBEAT, text, parameter and
reached waypoint as received, and of all other messages the latest; without a period it publishes what arrives
as it arrives. Set-points are forwarded by a task of their own. Each service request has a task of its own, so
that a command that waits for its acknowledgement does not delay others. All work is charged to the node's
context as calls into ROS; decoding MAVLink or pprzlink is not charged. Topics and services for whose types
the graph has no definition are omitted with a warning.

The pprzros node carries the messages of a Paparazzi aircraft's link on two topics, unchanged: those of the
aircraft on ``pprzros/to_ros`` (10 Hz, as pprzros does); messages on ``pprzros/from_ros`` are sent as they
arrive. Differences from pprzros: ``comp_id``, ``receiver_id`` and ``checksum`` are filled in; a message that
cannot be sent is dropped with a warning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.geoid import EGM96, Geoid
from volery.base.time import MS, US, Ns, S
from volery.bridge.autopilot_link import (
    AUTOPILOT_NAMES,
    AutopilotLink,
    MissingStreams,
    ReceivedFrame,
    mode_name,
)
from volery.bridge.naming_schemes import MAVROS
from volery.bridge.node_interface import InterfaceContext, NamingScheme, NodeInterface, SubscribedTopic
from volery.kernel.task import ExecutionContext, Scope, Task
from volery.kernel.waiting import sleep
from volery.links.frame import Frame
from volery.links.link import Link
from volery.links.mavlink_messages import constant
from volery.links.pprzros_messages import FROM_ROS, PPRZROS_TYPE, TO_ROS, to_frame, to_message
from volery.ros.graph import (
    DEFAULT,
    INVALID_VALUES,
    SENSOR_DATA,
    Node,
    Publisher,
    ReadyCallbacks,
    RosGraph,
    Work,
)
from volery.trace.events import WARNING, Text

ONBOARD_CONTROLLER = constant("MAV_TYPE_ONBOARD_CONTROLLER")
NO_AUTOPILOT = constant("MAV_AUTOPILOT_INVALID")
ACTIVE = constant("MAV_STATE_ACTIVE")
SAFETY_ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
LOOK_AGAIN: Ns = 10 * US
"""Period at which a request looks whether the set-points before it are through."""


@dataclass(frozen=True)
class VehicleNodeOptions:
    """Options of a vehicle node.

    Args:
        names: Naming scheme.
        period: Period of the loop in ns; None publishes frames as they arrive.
        rate: Rate in Hz of the requested telemetry; None requests what the scheme does, 0 nothing.
        silent: Time in ns without a heartbeat after which the autopilot counts as disconnected.
        system: Own MAVLink system id.
        component: Own MAVLink component id.
        vehicle: System id of the autopilot; 0 selects the first one that sends a heartbeat.
        geoid: Converts between ellipsoidal and AMSL altitudes.
        control: Whether roscopter's ``send_rc`` is offered.
        origin: Origin of the frame ``map``; None is the autopilot's own origin.
        parameter_services: Whether parameters are offered by the services of ROS 2, as MAVROS 2 does.
        best_effort: Whether sensors are published best effort, as MAVROS 2 does.
        remaps: Names of topics and services, and their replacements.
        pose_transform: Whether the pose is published on ``/tf``; not where odometry moves the same frame.
    """

    names: NamingScheme = MAVROS
    period: Ns | None = 100 * MS
    rate: int | None = None
    silent: Ns = 10 * S
    system: int = 255
    component: int = 191
    vehicle: int = 0
    geoid: Geoid = EGM96
    control: bool = False
    origin: LocalFrame | None = None
    parameter_services: bool = False
    best_effort: bool = False
    remaps: Mapping[str, str] = field(default_factory=dict)
    pose_transform: bool = True


class VehicleNode:
    """Serves the autopilot behind *link* under *namespace* (``/drone_1``), from ``start`` on."""

    def __init__(
        self, graph: RosGraph, link: Link, namespace: str, options: VehicleNodeOptions = VehicleNodeOptions()
    ) -> None:
        self._graph, self._kernel = graph, graph.kernel
        self.namespace, self.options = namespace, options
        self.link = AutopilotLink(graph.kernel, link, options.system, options.component, options.vehicle)
        options.names.prepare()
        self._streams = _stream_requests(self.link, options)
        self._publishers: dict[str, Publisher] = {}
        self._on_demand: set[str] = set()
        self._warned: set[str] = set()
        self._batch: list[tuple[Publisher, Any]] | None = None
        """What the present cycle publishes; None outside of a cycle."""
        self._sources: list[str] = []
        """For each message of the batch the name of the frame that it was made of."""
        self._source = ""
        self._next_heartbeat: Ns = 0
        self._forwarding = False
        """Whether a set-point has arrived and is not forwarded yet."""
        self.connected = False
        self._component = ""

    def start(self, context: ExecutionContext, scope: Scope) -> Task:
        """Spawn the task of the node, which executes in *context* and ends with *scope*."""
        self._component = context.component
        return self._kernel.spawn(lambda: self._run(context, scope), context.component, context, scope)

    @property
    def summary(self) -> str:
        """The connected autopilot, its mode and arming state; empty while none is connected."""
        heartbeat = self.link.last("HEARTBEAT")
        if heartbeat is None or not self.connected:
            return ""
        number = heartbeat["autopilot"]
        name = AUTOPILOT_NAMES.get(number, f"autopilot {number}")
        mode = mode_name(self.link.autopilot, heartbeat["custom_mode"])
        armed = "armed" if heartbeat["base_mode"] & SAFETY_ARMED else "disarmed"
        return f"{name} (system {self.link.target[0]}): {mode}, {armed}"

    def _run(self, context: ExecutionContext, scope: Scope) -> None:
        options = self.options
        node = self._graph.node(options.names.node, self.namespace, remaps=options.remaps, context=context)
        helper = replace(context, deadline=None, period=None, on_release=None)
        interface = options.names.make_interface(
            InterfaceContext(
                node,
                self.link,
                self._publish,
                self._wanted,
                self._warn,
                options.geoid,
                options.control,
                options.origin,
                options.parameter_services,
                options.pose_transform,
                self._graph.epoch,
            )
        )
        self.link.publish_only(interface.translators)
        self._advertise(node, interface)
        self._subscribe(node, interface, helper, scope)
        self._serve(node, interface, helper, scope)
        period = None if options.names.as_received else options.period
        rate = None if period is None else node.rate(period)
        while not node.closed:
            self._cycle(node, interface)
            job = interface.due(self._kernel.now())
            if job is not None:
                self._kernel.spawn(job, f"{context.component} (beside its loop)", helper, scope)
            if rate is not None:
                rate.sleep()
            else:
                self.link.wait(self._next_heartbeat)

    def _warn(self, text: str) -> None:
        kernel = self._kernel
        with kernel.interact():
            kernel.record(Text(kernel.now(), self._component, WARNING, text))

    # -- set-up

    def _create_all(self, what: str, creators: Iterable[Callable[[], object]]) -> None:
        """Call all creators and warn of those that fail, because a real ROS 2 may lack a type."""
        problems: list[str] = []
        for create in creators:
            try:
                create()
            except UsageError as error:
                problems.append(str(error))
        if problems:
            self._warn(f"{len(problems)} {what} are left out; the first: {problems[0]}")

    def _advertise(self, node: Node, interface: NodeInterface) -> None:
        def advertise(name: str, kind: str, qos: Any) -> None:
            if qos == DEFAULT and self.options.best_effort and name.startswith(self.options.names.sensors):
                qos = SENSOR_DATA
            self._publishers[name] = node.advertise(name, kind, qos)

        self._on_demand = {topic.name for topic in interface.topics if topic.on_demand}
        self._create_all("topics", (partial(advertise, *topic[:3]) for topic in interface.topics))

    def _publish(self, topic: str, message: Any) -> None:
        publisher = self._publishers.get(topic)
        if publisher is None:
            return
        if self._batch is None:
            publisher.publish(message)
        else:
            self._batch.append((publisher, message))
            self._sources.append(self._source)

    def _wanted(self, topic: str) -> bool:
        publisher = self._publishers.get(topic)
        return publisher is not None and (topic not in self._on_demand or publisher.subscribers() > 0)

    def _subscribe(
        self, node: Node, interface: NodeInterface, context: ExecutionContext, scope: Scope
    ) -> None:
        group = node.group()
        group.on_ready = self._expect_setpoint
        self._create_all(
            "subscriptions",
            (
                partial(
                    node.subscribe,
                    subscription.name,
                    subscription.type,
                    partial(self._forward, node, subscription, group),
                    group=group,
                )
                for subscription in interface.subscriptions
            ),
        )
        self._kernel.spawn(group.spin, f"{context.component} (set-points)", context, scope)

    def _expect_setpoint(self) -> None:
        """Hold requests until the set-point that has arrived is forwarded: it was published before them."""
        self._forwarding = True

    def _forward(
        self, node: Node, subscription: SubscribedTopic, group: ReadyCallbacks, message: Any
    ) -> None:
        """Send a set-point to the autopilot; an invalid one is dropped with a warning."""
        try:
            translated = subscription.translate(message, self._kernel.now())
            if isinstance(translated, Frame):
                with self._kernel.interact():
                    self.link.pass_on(translated)
                return
            outgoing = translated if isinstance(translated, list) else [translated]
            with self._kernel.interact():
                for name, fields in outgoing:
                    self.link.send_to_autopilot(name, fields)
        except INVALID_VALUES as error:
            self._warn(f"{node.resolve(subscription.name)}: message dropped: {error}")
        finally:
            self._forwarding = len(group) > 0

    def _serve(self, node: Node, interface: NodeInterface, context: ExecutionContext, scope: Scope) -> None:
        def run(work: Work) -> None:
            try:
                while self._forwarding and not node.closed:
                    sleep(self._kernel, LOOK_AGAIN)
                work.run()
            except INVALID_VALUES as error:
                self._warn(f"service request refused: {error}")

        def start(work: Work) -> None:
            self._kernel.spawn(lambda: run(work), f"{context.component} (service)", context, scope)

        group = node.group(start)
        self._create_all(
            "services",
            (partial(node.serve, name, *service, group) for name, service in interface.services.items()),
        )

    # -- the loop

    def _cycle(self, node: Node, interface: NodeInterface) -> None:
        kernel = self._kernel
        with kernel.interact():
            now = kernel.now()
            received = self.link.take_unpublished()
        self._publish_received(node, interface, received)
        last = self.link.last_heartbeat
        connected = last is not None and now - last < self.options.silent
        if self.connected and not connected:
            interface.disconnected(self._graph.epoch + now)
        self.connected = connected
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + S
            self._send_heartbeat()
        self._streams.check(now)

    def _publish_received(
        self, node: Node, interface: NodeInterface, received: Sequence[ReceivedFrame]
    ) -> None:
        """Publish the content of frames as one batch."""
        batch: list[tuple[Publisher, Any]] = []
        sources: list[str] = []
        self._batch, self._sources = batch, sources
        try:
            for one in received:
                frame, stamp = one.frame, self._graph.epoch + one.at
                self._source = frame.name
                for translate in interface.translators.get(frame.name, ()):
                    try:
                        translate(frame.fields, stamp)
                    except INVALID_VALUES as error:
                        self._refuse(frame.name, error)
        finally:
            self._batch = None
        if batch:
            node.publish_all(batch, lambda index, error: self._refuse(sources[index], error))

    def _refuse(self, name: str, error: Exception) -> None:
        """Warn of a frame with invalid content, once per name."""
        if name not in self._warned:
            self._warned.add(name)
            self._warn(f"{name}: not published: {error}")

    def _send_heartbeat(self) -> None:
        fields = {
            "type": ONBOARD_CONTROLLER,
            "autopilot": NO_AUTOPILOT,
            "base_mode": 0,
            "custom_mode": 0,
            "system_status": ACTIVE,
            "mavlink_version": 3,
        }
        self.link.send("HEARTBEAT", fields)


def _stream_requests(link: AutopilotLink, options: VehicleNodeOptions) -> MissingStreams:
    """Return the requests of the scheme, at the stated rate and, for single messages, at most at that."""
    names, rate = options.names, options.rate
    if rate == 0:
        return MissingStreams(link, {}, home=False)
    streams, messages = names.streams, names.messages
    if rate is not None:
        streams = dict.fromkeys(streams, rate)
        fastest = max(messages.values(), default=0.0)
        messages = {name: rate if hertz == fastest else min(hertz, rate) for name, hertz in messages.items()}
    return MissingStreams(link, streams, home=names.home, messages=messages)


def serve_vehicle(
    graph: RosGraph,
    link: Link,
    name: str,
    context: ExecutionContext,
    options: VehicleNodeOptions = VehicleNodeOptions(),
) -> VehicleNode:
    """Serve the autopilot behind *link* under ``/name`` until the end of the run, executing in *context*.

    An empty name is that of the root, ``/``.
    """
    served = VehicleNode(graph, link, f"/{name}", options)
    served.start(context, graph.kernel.root)
    return served


PPRZROS_PERIOD: Ns = 100 * MS
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
        publisher = node.advertise(TO_ROS, PPRZROS_TYPE)
        group = node.group()
        node.subscribe(FROM_ROS, PPRZROS_TYPE, self._send, group=group)
        helper = replace(context, deadline=None, period=None, on_release=None)
        self._kernel.spawn(group.spin, f"{context.component} (datalink)", helper, scope)
        rate = node.rate(PPRZROS_PERIOD)
        while not node.closed:
            with self._kernel.interact():
                received, self._unpublished = self._unpublished, []
            for frame, at in received:
                publisher.publish(to_message(frame, self._graph.epoch + at))
            rate.sleep()

    def _send(self, message: Any) -> None:
        try:
            frame = to_frame(message)
            with self._kernel.interact():
                self._link.send(frame)
        except UsageError as error:
            kernel = self._kernel
            with kernel.interact():
                text = f"{FROM_ROS}: message dropped: {error}"
                kernel.record(Text(kernel.now(), self._component, WARNING, text))


def serve_pprzros(graph: RosGraph, link: Link, name: str, context: ExecutionContext) -> PprzrosNode:
    """Serve the aircraft behind *link* under ``/name`` until the end of the run, executing in *context*."""
    served = PprzrosNode(graph, link, f"/{name}")
    served.start(context, graph.kernel.root)
    return served
