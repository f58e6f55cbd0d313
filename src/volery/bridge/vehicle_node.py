"""The vehicle node: one vehicle on the graph, as MAVROS serves it.

Telemetry is published by a loop (10 Hz unless told otherwise): what is repeated all the time in its latest
form, each HEARTBEAT, text and reached waypoint as it came. Set-points go on as they arrive, in a task of
their own; each service request has a task of its own, so a command that waits for its acknowledgement holds
up nobody. Everything is charged to the node's place as calls into ROS; the decoding of MAVLink itself is not
counted.

Differences from MAVROS: publishers are reliable, as in ROS 1; it speaks as a ground station's system id,
which is the only one from which ArduPilot takes sticks; it asks for the streams it publishes, as roscopter
does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from volery.base.errors import UsageError
from volery.base.geoid import SEA_LEVEL, Geoid
from volery.base.time import MS, Ns, S
from volery.bridge.commands import WARNING, Commands, request_streams
from volery.bridge.missions import Missions
from volery.bridge.modes import PX4_ID
from volery.bridge.parameters import Parameters
from volery.bridge.setpoints import Subscription, subscriptions
from volery.bridge.telemetry import LATCHED_STATE, TOPICS, Telemetry
from volery.bridge.wire import Wire
from volery.graph import Node, Publisher, RosGraph
from volery.graph.group import Work
from volery.kernel.task import Place, Scope, Task
from volery.links.link import Link
from volery.trace.events import Text

ONBOARD_CONTROLLER, NO_AUTOPILOT, ACTIVE = 18, 8, 4
EXTENDED_SYS_STATE, GET_HOME_POSITION, SET_MESSAGE_INTERVAL = 245, 410, 511

STREAMS: Mapping[int, int] = {1: 1, 2: 2, 3: 1, 6: 10, 10: 4, 11: 1}
"""Hertz by MAV_DATA_STREAM: raw sensors, extended status, RC channels, position, attitude, VFR_HUD."""


@dataclass(frozen=True)
class VehicleNodeOptions:
    """How a vehicle node works.

    ``period`` of its loop; ``streams`` it asks the autopilot for (hertz by MAV_DATA_STREAM); ``silent``
    until the autopilot counts as disconnected; ``system`` and ``component`` are its MAVLink ids.
    """

    period: Ns = 100 * MS
    streams: Mapping[int, int] = field(default_factory=lambda: dict(STREAMS))
    silent: Ns = 10 * S
    system: int = 255
    component: int = 191
    geoid: Geoid = SEA_LEVEL


class VehicleNode:
    """Serves the autopilot behind *link* under *namespace* (``/drone_1``).

    ``start`` it, then its task does the rest.
    """

    def __init__(
        self, graph: RosGraph, link: Link, namespace: str, options: VehicleNodeOptions = VehicleNodeOptions()
    ) -> None:
        self._graph, self._kernel = graph, graph.kernel
        self.namespace, self.options = namespace, options
        self.wire = Wire(graph.kernel, link, options.system, options.component)
        self._telemetry = Telemetry(self.wire, options.geoid, self._publish)
        self._publishers: dict[str, Publisher] = {}
        self._next_heartbeat: Ns = 0
        self._next_request: Ns = 0
        self._connected = False
        self._component = ""

    def start(self, place: Place, scope: Scope) -> Task:
        """Spawn the node's task: its computing is spent at *place*, it ends with *scope*."""
        self._component = place.component
        return self._kernel.spawn(lambda: self._run(place, scope), place.component, place, scope)

    def _run(self, place: Place, scope: Scope) -> None:
        node = self._graph.node("mavros", self.namespace, place=place)
        aside = replace(place, deadline=None, on_release=None)
        self._advertise(node)
        self._subscribe(node, aside, scope)
        self._serve(node, aside, scope)
        rate = node.rate(self.options.period)
        while not node.closed:
            self._cycle()
            rate.sleep()

    # -- what it sets up

    def _advertise(self, node: Node) -> None:
        for topic in TOPICS:
            self._publishers[topic.name] = node.advertise(topic.name, topic.type, topic.qos)
        waypoints = "mission/waypoints"
        self._publishers[waypoints] = node.advertise(waypoints, "mavros_msgs/msg/WaypointList", LATCHED_STATE)

    def _publish(self, topic: str, message: Any) -> None:
        self._publishers[topic].publish(message)

    def _subscribe(self, node: Node, aside: Place, scope: Scope) -> None:
        group = node.group()
        for one in subscriptions(self.options.geoid):
            node.subscribe(one.name, one.type, partial(self._command, node, one), group=group)
        self._kernel.spawn(group.spin, f"{aside.component} (set-points)", aside, scope)

    def _command(self, node: Node, subscription: Subscription, message: Any) -> None:
        """Send a set-point on; one that makes no sense is dropped, with a warning."""
        try:
            name, fields = subscription.translate(message, self._kernel.now())
            with self._kernel:
                self.wire.send_to(name, fields)
        except (ValueError, OverflowError, UsageError) as error:
            self._warn(f"{node.resolve(subscription.name)}: message dropped: {error}")

    def _warn(self, text: str) -> None:
        with self._kernel as kernel:
            kernel.record(Text(kernel.now(), self._component, WARNING, text))

    def _serve(self, node: Node, aside: Place, scope: Scope) -> None:
        def run(work: Work) -> None:
            try:
                work.run()
            except (ValueError, OverflowError, UsageError) as error:
                self._warn(f"service request refused: {error}")

        def start(work: Work) -> None:
            self._kernel.spawn(lambda: run(work), f"{aside.component} (service)", aside, scope)

        group = node.group(start)
        parts = (
            Commands(self.wire, aside.component),
            Parameters(self.wire),
            Missions(self.wire, partial(self._publish, "mission/waypoints")),
        )
        for part in parts:
            for name, (service_type, handler) in part.services().items():
                node.serve(name, service_type, handler, group)

    # -- its loop

    def _cycle(self) -> None:
        with self._kernel as kernel:
            now = kernel.now()
            heard = self.wire.take()
        epoch = self._graph.epoch
        for frame, at in heard:
            self._telemetry.publish(frame, epoch + at)
        self._watch_connection(now)
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + S
            self._send_heartbeat()
        if self.wire.known and now >= self._next_request:
            self._next_request = now + S
            self._request_what_is_missing(now)

    def _watch_connection(self, now: Ns) -> None:
        last = self.wire.last_heartbeat
        connected = last is not None and now - last < self.options.silent
        if self._connected and not connected:
            self._telemetry.disconnected(self._graph.epoch + now)
        self._connected = connected

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

    def _request_what_is_missing(self, now: Ns) -> None:
        """Ask for streams that do not come: a request right after boot may be lost, though acknowledged."""
        latest = self.wire.latest
        by_message = self.wire.firmware.autopilot == PX4_ID
        for stream, rate in self.options.streams.items():
            heard = latest.get(_SHOWN_BY.get(stream, ""))
            if heard is not None and now - heard.at <= 3 * S:
                continue
            if not by_message:
                request_streams(self.wire, stream, rate)
                continue
            for number in _MESSAGES_OF.get(stream, ()):
                self._send_command(SET_MESSAGE_INTERVAL, number, 1e6 / max(rate, 1))
        if "EXTENDED_SYS_STATE" not in latest:
            self._send_command(SET_MESSAGE_INTERVAL, EXTENDED_SYS_STATE, 1e6)
        if "HOME_POSITION" not in latest:
            self._send_command(GET_HOME_POSITION)

    def _send_command(self, command: int, *parameters: float) -> None:
        fields = {f"param{number}": value for number, value in enumerate(parameters, start=1)}
        self.wire.send_to("COMMAND_LONG", {"command": command, **fields})


def serve_vehicle(
    graph: RosGraph, link: Link, name: str, place: Place, options: VehicleNodeOptions = VehicleNodeOptions()
) -> VehicleNode:
    """Serve the autopilot behind *link* under ``/name`` until the run ends, computing at *place*."""
    served = VehicleNode(graph, link, f"/{name}", options)
    served.start(place, graph.kernel.root)
    return served


_SHOWN_BY = {
    1: "RAW_IMU",
    2: "SYS_STATUS",
    3: "RC_CHANNELS",
    6: "GLOBAL_POSITION_INT",
    10: "ATTITUDE",
    11: "VFR_HUD",
}
"""The message by which one sees that a MAV_DATA_STREAM comes."""

_MESSAGES_OF: Mapping[int, tuple[int, ...]] = {2: (1, 24), 3: (65,), 6: (33, 32), 10: (30,), 11: (74,)}
"""The messages of a MAV_DATA_STREAM that are published: PX4 knows no streams and is asked for each. There is
no RAW_IMU.
"""
