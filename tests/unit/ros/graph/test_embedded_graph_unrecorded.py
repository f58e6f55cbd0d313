"""Nodes with nothing between them: what one sends is with the other at once."""

from __future__ import annotations

from typing import Any

import pytest

from volery.base.time import MS, S
from volery.base.warmth import Warmth
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros import messages
from volery.ros.graph import EmbeddedGraph, QoS
from volery.trace.events import Charge, Message

STRING, TRIGGER = "std_msgs/msg/String", "std_srvs/srv/Trigger"


def played(*bodies: Any, **options: Any) -> list[Any]:
    """Each body as a component of one graph; what was recorded."""
    events: list[Any] = []
    kernel = VirtualKernel(events.append)
    graph = EmbeddedGraph(kernel, **options)
    for body in bodies:
        kernel.spawn(lambda body=body: body(graph), body.__name__, ExecutionContext(body.__name__))
    kernel.run(100 * S)
    return events


def test_a_message_waits_for_its_callback_when_publish_returns() -> None:
    heard: list[str] = []

    def both(graph: EmbeddedGraph) -> None:
        node = graph.node("both")
        node.subscribe("chat", STRING, lambda message: heard.append(message.data))
        node.advertise("chat", STRING).publish(messages.new(STRING, data="hello"))
        assert heard == []
        assert node.spin_once(0)

    (message,) = (event for event in played(both) if isinstance(event, Message))
    assert heard == ["hello"]
    assert (message.sent, message.received, message.size) == (0, 0, 14)


def test_work_that_is_started_at_once_is_not_the_publishers() -> None:
    """It is begun as house code: what it takes is not paid by the task that published."""
    begun: list[Any] = []

    def both(graph: EmbeddedGraph) -> None:
        node = graph.node("both")
        group = node.group(lambda work: begun.append(graph.kernel.current()))
        node.subscribe("chat", STRING, print, group=group)
        node.advertise("chat", STRING).publish(messages.new(STRING))
        node.sleep(1)

    played(both)
    assert begun == [None]


def test_a_service_is_answered_in_no_time() -> None:
    took: list[int] = []

    kind = messages.service(TRIGGER)

    def server(graph: EmbeddedGraph) -> None:
        node = graph.node("server")
        node.serve("go", TRIGGER, lambda request: kind.response(success=True))
        node.spin_once()

    def client(graph: EmbeddedGraph) -> None:
        client = graph.node("client").client("go", TRIGGER)
        client.wait()
        started = graph.kernel.now()
        assert client.call(kind.request()).success
        took.append(graph.kernel.now() - started)

    played(client, server)
    assert took == [0]


def test_an_unrecorded_graph_records_nothing_and_needs_no_prices_without_a_processor() -> None:
    asked: list[str] = []

    def tariff(node: Any) -> Any:
        def price(call: str, x: float, warmth: Warmth) -> Any:
            asked.append(call)
            raise AssertionError(call)

        return price

    def both(graph: EmbeddedGraph) -> None:
        node = graph.node("both")
        node.subscribe("chat", STRING, lambda message: None)
        node.advertise("chat", STRING).publish(messages.new(STRING))
        node.spin_once()

    events = played(both, tariffs=tariff, unrecorded=True)
    assert not [event for event in events if isinstance(event, Charge | Message)]
    assert asked == []


@pytest.mark.parametrize(
    ("spacings", "options", "expected"),
    [
        ((100 * MS,), {"unrecorded": True}, [0, 100, 200]),
        ((100 * MS, 50 * MS), {"unrecorded": True}, [0, 50, 100, 150, 200, 250]),
        ((100 * MS, 0), {"unrecorded": True}, list(range(0, 300, 10))),
        ((100 * MS,), {"unrecorded": True, "as_bytes": True}, list(range(0, 300, 10))),
        ((100 * MS,), {}, list(range(0, 300, 10))),
    ],
)
def test_where_a_graph_is_a_link_messages_that_no_subscription_uses_are_not_awaited(
    spacings: tuple[int, ...], options: dict[str, bool], expected: list[int]
) -> None:
    sent: list[int] = []

    def talker(graph: EmbeddedGraph) -> None:
        listener = graph.node("listener")
        for spacing in spacings:
            listener.subscribe("state", STRING, lambda message: None, QoS(spacing=spacing))
        node = graph.node("talker")
        publisher = node.advertise("state", STRING)
        for _ in range(30):
            if publisher.awaited_from() <= graph.kernel.now():
                sent.append(graph.kernel.now() // MS)
                publisher.publish(messages.new(STRING))
            node.sleep(10 * MS)

    played(talker, **options)
    assert sent == expected
