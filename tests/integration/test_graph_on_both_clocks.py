"""The embedded graph does the same in virtual time and, on threads, on the clock on the wall."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from volery.base.time import MS, S
from volery.bridge import serve_vehicle
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.wall import WallKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.ros import messages
from volery.ros.graph import EmbeddedGraph, QoS

STRING, SET_BOOL = "std_msgs/msg/String", "std_srvs/srv/SetBool"


@pytest.fixture(params=[VirtualKernel, WallKernel])
def kernel(request: pytest.FixtureRequest) -> Any:
    return request.param()


@pytest.fixture
def graph(kernel: Any) -> EmbeddedGraph:
    return EmbeddedGraph(kernel)


def play(kernel: Any, *bodies: Callable[[], None]) -> None:
    """Run the bodies as tasks; the last one ends the run. What one of them raises is raised here."""
    errors: list[BaseException] = []

    def guarded(body: Callable[[], None]) -> Callable[[], None]:
        def run() -> None:
            try:
                body()
            except Exception as error:
                errors.append(error)
                kernel.cancel(kernel.root, "error")
            if body is bodies[-1]:
                kernel.cancel(kernel.root, "played")

        return run

    for body in bodies:
        kernel.spawn(guarded(body), body.__name__, ExecutionContext(body.__name__))
    kernel.run(60 * S)
    assert kernel.close() == []
    if errors:
        raise errors[0]


def test_topics_and_services(kernel: Any, graph: EmbeddedGraph) -> None:
    heard: list[str] = []

    def server() -> None:
        node = graph.node("server")
        kind = messages.service(SET_BOOL)
        node.serve("switch", SET_BOOL, lambda request: kind.response(request.data, "switched"))
        node.spin()

    def listener() -> None:
        node = graph.node("listener")
        node.subscribe("chat", STRING, lambda message: heard.append(message.data), QoS(depth=None))
        node.spin()

    def talker() -> None:
        node = graph.node("talker")
        publisher = node.advertise("chat", STRING)
        while publisher.subscribers() == 0:
            node.sleep(MS)
        for number in range(20):
            publisher.publish(messages.new(STRING, data=str(number)))
        client = node.client("switch", SET_BOOL)
        assert client.wait()
        assert client.call(messages.request(SET_BOOL, data=True)).message == "switched"
        while len(heard) < 20:
            node.sleep(MS)

    play(kernel, server, listener, talker)
    assert heard == [str(number) for number in range(20)]


def test_a_vehicle_is_served(kernel: Any, graph: EmbeddedGraph) -> None:
    ours, theirs = in_process_pair(kernel)
    states: list[str] = []

    def answer(frame: Frame) -> None:
        if frame.name == "COMMAND_LONG":
            theirs.send(Frame("COMMAND_ACK", {"command": frame.fields["command"]}, 1, 1))

    def beat() -> None:
        theirs.send(Frame("HEARTBEAT", {"type": 2, "autopilot": 3, "custom_mode": 4}, 1, 1))

    theirs.receive(answer)
    kernel.every(50 * MS, beat)
    serve_vehicle(graph, ours, "drone_1", ExecutionContext("mavros"))

    def pilot() -> None:
        node = graph.node("pilot")
        node.subscribe("/drone_1/state", "mavros_msgs/State", lambda message: states.append(message.mode))
        assert node.spin_once()
        arming = node.client("/drone_1/cmd/arming", "mavros_msgs/CommandBool")
        assert arming.wait()
        assert arming.call(messages.request("mavros_msgs/CommandBool", value=True)).success

    play(kernel, pilot)
    assert states[0] == "GUIDED"
