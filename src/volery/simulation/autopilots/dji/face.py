"""The node through which a DJI aircraft is reached: ``dji_sdk`` 3.8, or the vehicle node of ``dji_osdk_ros``.

It publishes only what somebody has subscribed to: who does not listen cannot tell, and a simulation is spared
hundreds of messages a second.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import MS, Ns
from volery.kernel.api import Action, Handle
from volery.kernel.task import ExecutionContext
from volery.ros.graph import Node, Publisher, RosGraph, Work
from volery.ros.messages.dji_constants import NEW_NAMES, OLD_NAMES, SETPOINT, SETPOINT_TOPICS
from volery.simulation.autopilots.dji.controller import Controller, controller_of
from volery.simulation.autopilots.dji.services import Services
from volery.simulation.autopilots.dji.telemetry import FAST, REFERENCE, SLOW, USUAL, Topic, topics
from volery.simulation.autopilots.vehicle_state import Vehicle
from volery.trace.events import Text

LOOK_EVERY: Ns = 200 * MS
"""How often it is looked who listens."""

JOY = "sensor_msgs/msg/Joy"


class _Package:
    """Topics of one period."""

    def __init__(self, face: DjiFace, period: Ns, listed: list[tuple[Topic, Publisher]]) -> None:
        self._face = face
        self._looks_every = max(1, LOOK_EVERY // period)
        self._listed = listed
        self._wanted: list[tuple[Topic, Publisher]] = []
        self._round = 0

    def publish(self) -> None:
        """What is wanted, once. House code."""
        if self._round % self._looks_every == 0:
            self._wanted = [one for one in self._listed if one[1].subscribers()]
        self._round += 1
        if not self._wanted or not self._face.speaks:
            return
        stamp = self._face.stamp()
        for topic, publisher in self._wanted:
            message = topic.build(self._face.controller, stamp)
            if message is not None:
                publisher.publish(message)


class DjiFace:
    """See ``Face`` and ``GraphFace``."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._kernel = vehicle.kernel
        self._on = False
        self._clocks: list[Handle] = []
        self._packages: dict[Ns, _Package] = {}
        self._graph: RosGraph | None = None
        self._node: Node | None = None
        self._reference: Publisher | None = None
        self._place = ExecutionContext(vehicle.name)

    @property
    def controller(self) -> Controller:
        """What it speaks for."""
        return controller_of(self._vehicle)

    @property
    def speaks(self) -> bool:
        """It is switched on and has booted."""
        return self._on and self._vehicle.uptime() >= self._vehicle.firmware.ready_after

    def stamp(self) -> Ns:
        """ROS time."""
        return (self._graph.epoch if self._graph else 0) + self._kernel.now()

    # -- the graph

    def join(self, graph: RosGraph, namespace: str, place: ExecutionContext) -> None:
        """Serve under *namespace*: ``/dji_sdk``, ``/drone_1/dji_sdk``, or one that ends in ``dji_osdk_ros``
        for the names of 4.1. The node's computing is spent at *place*.
        """
        above, _, package = namespace.rstrip("/").rpartition("/")
        if package not in (OLD_NAMES, NEW_NAMES):
            raise UsageError(
                f"{self._vehicle.name}: a DJI node is reached under {OLD_NAMES} or {NEW_NAMES}, as in "
                f"/{self._vehicle.name}/{OLD_NAMES}; not under {namespace!r}"
            )
        if self._node is not None:
            raise UsageError(f"{self._vehicle.name} is on a graph already, as {self._node.name}")
        self._graph, self._place = graph, place
        node = self._node = graph.node(package, above or "/", place=place)
        self._advertise(node, package)
        self._listen(node, package)
        services = Services(self.controller, self._publish_reference)
        group = node.group(self._start)
        for served in services.table(package):
            node.serve(served.name, served.type, partial(self._answer, served.answer), group)
        if self._on:
            self.start()

    def _advertise(self, node: Node, package: str) -> None:
        listed: dict[Ns, list[tuple[Topic, Publisher]]] = {FAST: [], USUAL: [], SLOW: []}
        for topic in topics(package):
            publisher = node.advertise(f"{package}/{topic.name}", topic.type, topic.qos)
            listed[topic.period].append((topic, publisher))
        self._packages = {period: _Package(self, period, some) for period, some in listed.items()}
        self._reference = node.advertise(f"{package}/{REFERENCE.name}", REFERENCE.type, REFERENCE.qos)

    def _publish_reference(self) -> None:
        message = REFERENCE.build(self.controller, self.stamp())
        if self._reference is not None and message is not None:
            self._reference.publish(message)

    def _listen(self, node: Node, package: str) -> None:
        """Set-points are taken as they come. The vehicle node of 4.1 takes them by a service."""
        if package == NEW_NAMES:
            return
        group = node.group(lambda work: work.run())
        for name, flag in SETPOINT_TOPICS.items():
            node.subscribe(f"{package}/{name}", JOY, partial(self._setpoint, flag), group=group)
        node.subscribe(f"{package}/{SETPOINT}generic", JOY, self._generic, group=group)

    def _setpoint(self, flag: int, message: Any) -> None:
        with self._kernel.guard:
            if self.speaks:
                self.controller.obey(tuple(float(axis) for axis in message.axes[:4]), flag)

    def _generic(self, message: Any) -> None:
        if len(message.axes) >= 5 and 0.0 <= message.axes[4] < 256.0:
            self._setpoint(int(message.axes[4]), message)

    def _start(self, work: Work) -> None:
        """Each request has a task of its own."""
        self._kernel.spawn(work.run, f"{self._vehicle.name} (service)", self._place, self._kernel.root)

    def _answer(self, answer: Any, request: Any) -> Any:
        with self._kernel.guard:
            return answer(request)

    # -- the aircraft

    def start(self) -> None:
        """It was switched on."""
        self.stop()
        self._on = True
        every = self._kernel.every
        self._clocks = [every(period, package.publish) for period, package in self._packages.items()]

    def stop(self) -> None:
        """Fall silent."""
        self._on = False
        for clock in self._clocks:
            clock.cancel()
        self._clocks.clear()

    def hang_up(self) -> None:
        """Leave the graph."""
        if self._node is not None:
            self._node.close()
            self._node = None

    def say(self, severity: int, text: str) -> None:
        """There is no topic for words: they go to the trace."""
        self._kernel.record(Text(self._kernel.now(), self._vehicle.name, severity, text))

    def parameter(self, name: str) -> None:
        """Nobody is told."""

    def mode_changed(self) -> None:
        """It shows at the next round."""

    def home_changed(self) -> None:
        """Nobody is told."""

    def announce(self, message: str) -> None:
        """There is nothing to announce."""

    def tell(self, message: str, fields: dict[str, Any]) -> None:
        """There are no such events."""

    def after_answer(self, action: Action) -> None:
        """At once."""
        action()
