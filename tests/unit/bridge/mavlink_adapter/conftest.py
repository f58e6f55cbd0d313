"""A simulated vehicle that does not speak MAVLink, its adapter, a vehicle node, and a user's node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from volery.base.frames import LocalFrame
from volery.base.geoid import LevelGeoid
from volery.base.time import S
from volery.bridge import MAVROS, MavlinkAdapter, VehicleNode, VehicleNodeOptions
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.ros import messages
from volery.ros.graph import EmbeddedGraph
from volery.run.assembly.simulated_fleet import fleet_of
from volery.run.assembly.simulated_vehicles import parse_simulated
from volery.run.assembly.vehicle_nodes import open_simulated_driver
from volery.trace.events import Operation, Text
from volery.vehicles.address import parse

GEOID_M = 10.0
FRAME = LocalFrame(46.0825, -103.8995, 900.0)


class Flown:
    """A vehicle behind an adapter. ``frames`` are all frames of the vehicle, ``texts`` its status texts."""

    def __init__(self, url: str, **options: Any) -> None:
        self.events: list[Any] = []
        self.kernel = VirtualKernel(self.events.append)
        wanted = parse_simulated(parse(url), "d")
        self.fleet = fleet_of(self.kernel, [wanted], 1)
        self.driver = open_simulated_driver(self.kernel, self.fleet, wanted, 1)
        self.graph = EmbeddedGraph(self.kernel)
        self.adapter = MavlinkAdapter(self.kernel, self.driver, ExecutionContext("bridge"))
        options.setdefault("names", MAVROS)
        rates = {"rate": 10, "period": None}
        stated = VehicleNodeOptions(geoid=LevelGeoid(GEOID_M), **{**rates, **options})
        self.node = VehicleNode(self.graph, self.adapter, "/d", stated)
        self.node.start(ExecutionContext("bridge"), self.kernel.root)
        self.user = self.graph.node("user", context=ExecutionContext("user"))
        self.frames: list[Frame] = []
        self._latest: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}

    def tap(self) -> None:
        """From now on the vehicle node hears nothing: all frames come here."""
        self.adapter.receive(self.frames.append)

    def send(self, name: str, **fields: Any) -> None:
        """As the vehicle node would."""
        self.adapter.send(Frame(name, fields, 255, 191))

    def messages_of(self, name: str) -> list[dict[str, Any]]:
        return [frame.fields for frame in self.frames if frame.name == name]

    def run(self, seconds: float) -> None:
        until = self.kernel.now() + round(seconds * S)
        self.kernel.call_at(until + 1, lambda: None)
        self.kernel.run(until)
        while self.user.spin_once(0):
            pass

    def until(self, holds: Callable[[], object], within: float) -> None:
        end = self.kernel.now() + round(within * S)
        while not holds():
            assert self.kernel.now() < end, (self.texts, self.node.summary)
            self.run(0.2)

    def listen(self, topic: str, kind: str) -> None:
        self.user.subscribe(f"/d/{topic}", kind, lambda message: self._latest.update({topic: message}))

    def last(self, topic: str) -> Any:
        return self._latest.get(topic)

    def publish(self, topic: str, kind: str, **fields: Any) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self.user.advertise(f"/d/{topic}", kind)
        self._publishers[topic].publish(messages.new(kind, **fields))

    def call(self, name: str, kind: str, **fields: Any) -> Any:
        """The answer of a service; time passes until it is there."""
        answers: list[Any] = []

        def body() -> None:
            client = self.user.client(f"/d/{name}", kind)
            client.wait()
            answers.append(client.call(messages.request(kind, **fields)))

        self.kernel.spawn(body, "user", ExecutionContext("user"))
        self.until(lambda: answers, 20.0)
        return answers[0]

    def command(self, name: str, kind: str, **fields: Any) -> tuple[bool, int]:
        answer = self.call(name, f"mavros_msgs/{kind}", **fields)
        return answer.success, answer.result

    def take_off(self, height: float = 5.0) -> None:
        assert self.command("cmd/takeoff", "CommandTOL", altitude=height) == (True, 0)
        self.until(lambda: any(one.operation == "takeoff" for one in self.operations), 60.0)

    @property
    def operations(self) -> list[Operation]:
        """Those that have ended."""
        return [event for event in self.events if isinstance(event, Operation)]

    @property
    def texts(self) -> list[str]:
        """Texts of the warnings of the adapter."""
        return [event.text for event in self.events if isinstance(event, Text) and event.severity <= 4]

    @property
    def true(self) -> tuple[float, float, float]:
        """East, north and up of where it began."""
        east, north, up = self.fleet.flights["d"].truth().position
        return float(east), float(north), float(up)

    @property
    def height(self) -> float:
        return self.true[2]


@pytest.fixture
def flown() -> type[Flown]:
    return Flown


@pytest.fixture(params=["paparazzi", "dji"])
def ready(request: Any) -> Flown:
    """Switched on a while ago, received, with a fix."""
    made = Flown(f"sim:{request.param}?start=warm")
    made.until(lambda: made.driver.telemetry.position is not None, 30.0)
    made.run(2.0)
    return made
