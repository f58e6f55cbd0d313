from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from volery.base.geoid import LevelGeoid
from volery.base.time import MS, S
from volery.base.warmth import Warmth
from volery.bridge import ROSCOPTER, VehicleNode, VehicleNodeOptions
from volery.cost import Price
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.ros import messages
from volery.ros.graph import EmbeddedGraph
from volery.trace.events import Text


class BridgeRig:
    """A vehicle node with a scripted autopilot behind it and a user's node in front."""

    def __init__(self, geoid: float = 0.0, **options: Any) -> None:
        self.events: list[Any] = []
        self.kernel = VirtualKernel(self.events.append)
        self.priced: list[tuple[str, str]] = []
        self.graph = EmbeddedGraph(self.kernel, self._tariff)
        ours, self._theirs = in_process_pair(self.kernel, MS, name="drone_1")
        self._theirs.receive(self._on_frame)
        self.sent: list[Frame] = []
        self.answers: dict[str, Callable[[dict[str, Any]], None]] = {}
        self.node = VehicleNode(
            self.graph, ours, "/drone_1", VehicleNodeOptions(geoid=LevelGeoid(geoid), **options)
        )
        self.node.start(ExecutionContext("mavros"), self.kernel.root)
        self.user = self.graph.node("user", context=ExecutionContext("user"))
        self.got: dict[str, list[Any]] = {}

    def _tariff(self, node: Any) -> Any:
        def price(call: str, x: float, warmth: Warmth) -> Price:
            self.priced.append((node.name, call))
            return Price(0, 0)

        return price

    def _on_frame(self, frame: Frame) -> None:
        self.sent.append(frame)
        answer = self.answers.get(frame.name)
        if answer is not None:
            answer(frame.fields)

    def emit(self, name: str, /, **fields: Any) -> None:
        """The autopilot sends a message."""
        self.emit_as(1, name, **fields)

    def emit_as(self, system: int, name: str, /, **fields: Any) -> None:
        """A vehicle with that system id sends a message."""
        self._theirs.send(Frame(name, fields, system, 1))

    def heartbeat(self, **fields: Any) -> None:
        self.emit("HEARTBEAT", **{"type": 2, "autopilot": 3, "base_mode": 81, "system_status": 3, **fields})

    def asked(self, *names: str) -> list[dict[str, Any]]:
        """The fields of what the autopilot was sent under these names."""
        return [frame.fields for frame in self.sent if frame.name in names]

    def listen(self, topic: str, message_type: str) -> list[Any]:
        """Collect the messages of a topic."""
        received = self.got[topic] = []
        self.user.subscribe(f"/drone_1/{topic}", message_type, received.append)
        return received

    def publish(self, topic: str, message_type: str, **fields: Any) -> None:
        """Publish once, from the user's node."""
        publisher = self.user.advertise(f"/drone_1/{topic}", message_type)
        publisher.publish(messages.new(message_type, **fields))

    def call(self, service: str, service_type: str, **fields: Any) -> Any:
        """Call a service from the user's node; lets time pass until it is answered."""
        answers: list[Any] = []

        def body() -> None:
            client = self.user.client(f"/drone_1/{service}", service_type)
            client.wait()
            answers.append(client.call(messages.request(service_type, **fields)))

        self.kernel.spawn(body, "user", ExecutionContext("user"))
        for _ in range(200):
            self.run(100 * MS)
            if answers:
                return answers[0]
        raise AssertionError(f"{service} has not answered within {200 * 100 * MS / S} s")

    def run(self, duration: int) -> None:
        """Let time pass, then take what has arrived."""
        until = self.kernel.now() + duration
        self.kernel.call_at(until + 1, lambda: None)
        self.kernel.run(until)
        while self.user.spin_once(0):
            pass

    def of_texts(self) -> list[Text]:
        return [event for event in self.events if isinstance(event, Text)]

    def connect(self) -> None:
        """One heartbeat, and the loop has seen it."""
        self.heartbeat()
        self.run(200 * MS)
        self.sent.clear()


@pytest.fixture
def rig() -> BridgeRig:
    return BridgeRig()


@pytest.fixture
def raised_rig() -> BridgeRig:
    """Where the geoid is 47 m above the ellipsoid."""
    return BridgeRig(47.0)


@pytest.fixture
def roscopter() -> BridgeRig:
    """Under roscopter's names, frames as they arrive, sticks taken."""
    return BridgeRig(names=ROSCOPTER, period=None, control=True)


@pytest.fixture
def rig_of() -> type[BridgeRig]:
    """One with options of its vehicle node."""
    return BridgeRig
