from typing import Any

import pytest

from volery.base.time import MS, US, S
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import executing_in
from volery.ros import messages
from volery.ros.graph import NodeId
from volery.trace.events import Charge, Message, Published, Slice

from .conftest import Price

STRING = "std_msgs/msg/String"
SET_BOOL = "std_srvs/srv/SetBool"


def test_every_call_into_ros_is_priced(rig: Any) -> None:
    def node() -> None:
        node = rig.graph.node("n")
        node.subscribe("chat", STRING, lambda message: None)
        node.subscribe("chat", STRING, lambda message: None)
        publisher = node.advertise("chat", STRING)
        node.serve("switch", SET_BOOL, lambda request: None)
        node.client("switch", SET_BOOL)
        publisher.publish(messages.new(STRING))
        node.sleep(3 * MS)
        node.spin_once(0)
        node.spin_once(0)

    rig.run(node)
    assert rig.asked == [
        ("/n", "init", 0.0),
        ("/n", "node_handle", 0.0),
        ("/n", "subscribe", 0.0),
        ("/n", "subscribe", 0.0),
        ("/n", "advertise", 0.0),
        ("/n", "advertise_service", 0.0),
        ("/n", "service_client", 0.0),
        ("/n", "publish", 2.0),
        ("/n", "sleep", 3000.0),
        ("/n", "spin_once", 1.0),
        ("/n", "spin_once", 0.0),
    ]
    assert [event.kind for event in rig.of(Charge)] == [f"ros:{call}" for _, call, _ in rig.asked]


def test_the_callers_part_is_executed_before_anything_is_visible(rig: Any) -> None:
    rig.prices["publish"] = type("P", (), {"caller": 40 * US, "background": 100 * US})()
    seen: list[NodeId] = []

    def talker() -> None:
        node = rig.graph.node("talker")
        node.subscribe("chat", STRING, lambda message: None)
        publisher = node.advertise("chat", STRING)
        rig.kernel.current().charge(7 * US)  # what its code owes is served before the call
        publisher.publish(messages.new(STRING))
        assert rig.kernel.now() == 47 * US
        seen.append(rig.carried[0][0])

    rig.task(talker, "talker", on_processor=True)
    rig.kernel.run(MS)
    [publish] = [event for event in rig.of(Charge) if event.kind == "ros:publish"]
    assert publish == Charge(7 * US, "talker", "cpu", "ros:publish", 40 * US, 100 * US, 0.0)
    assert [event.at for event in rig.of(Published)] == [47 * US]
    assert [event.sent for event in rig.of(Message)] == [47 * US]
    slices = [(event.start, event.end, event.task) for event in rig.of(Slice)]
    assert slices == [
        (0, 7 * US, "talker"),
        (7 * US, 47 * US, "talker"),
        (47 * US, 147 * US, "talker (background)"),
    ]
    assert seen == [("/talker", "talker", "cpu")]


def test_the_cost_of_a_sleep_is_spent_during_it(rig: Any) -> None:
    rig.prices["sleep"] = type("P", (), {"caller": 0, "background": 2 * MS})()

    def sleeper() -> None:
        node = rig.graph.node("sleeper")
        node.sleep(10 * MS)
        assert rig.kernel.now() == 10 * MS

    rig.task(sleeper, "sleeper", on_processor=True)
    rig.kernel.run(MS * 100)
    assert [(event.start, event.end) for event in rig.of(Slice)] == [(0, 2 * MS)]


def test_calls_of_framework_callbacks_execute_in_the_background(rig: Any) -> None:
    rig.prices["init"] = type("P", (), {"caller": 5 * US, "background": 1 * US})()
    rig.graph.node("n", context=ExecutionContext("n", rig.processor))
    rig.kernel.run(MS)
    assert [(event.start, event.end) for event in rig.of(Slice)] == [(0, 6 * US)]


def test_a_passive_callee_is_charged_in_its_own_context(rig: Any) -> None:
    """Whoever calls a publisher from another place pays the caller's part there."""
    rig.prices["publish"] = type("P", (), {"caller": 10 * US, "background": 3 * US})()
    node = rig.graph.node("callee", context=ExecutionContext("callee", rig.processor, priority=None))
    publisher = node.advertise("chat", STRING)

    def caller() -> None:
        with executing_in(rig.kernel, node.context):
            publisher.publish(messages.new(STRING))

    rig.run(caller)
    assert {event.component for event in rig.of(Slice)} == {"callee"}


@pytest.mark.parametrize("recorded", [True, False])
def test_without_subscribers_nothing_is_carried(rig: Any, recorded: bool) -> None:
    graph = rig.new_graph(records=lambda topic: recorded)

    def talker() -> None:
        graph.node("talker").advertise("chat", STRING).publish(messages.new(STRING))

    rig.run(talker)
    assert rig.carried == []
    assert len(rig.of(Published)) == recorded


def test_costs_beside_the_calls_are_charged_in_the_background(rig: Any) -> None:
    prices = {"receive": 30 * US, "connect": 400 * US, "accept": 300 * US}
    rig.prices.update({what: Price(0, price) for what, price in prices.items()})

    def hearer() -> None:
        rig.graph.node("hearer").subscribe("chat", STRING, lambda message: None)

    def talker() -> None:
        publisher = rig.graph.node("talker").advertise("chat", STRING)
        publisher.publish(messages.new(STRING))

    rig.task(hearer, "hearer", on_processor=True)
    rig.task(talker, "talker", on_processor=True)
    rig.kernel.run(MS)
    borne = [
        (one.component, one.kind, one.caller, one.background) for one in rig.of(Charge) if one.background
    ]
    assert borne == [
        ("talker", "ros:accept", 0, 300 * US),
        ("hearer", "ros:connect", 0, 400 * US),
        ("hearer", "ros:receive", 0, 30 * US),
    ]


def test_a_node_is_charged_for_the_time_in_which_it_does_not_sleep(rig: Any) -> None:
    def price(node: NodeId, call: str, x: float) -> Price:
        return Price(0, round(2 * x)) if call in ("wait", "sleep") else Price(0, 0)

    rig.price = price
    rig.graph = rig.new_graph()

    def half() -> None:
        node = rig.graph.node("half")
        node.sleep(2500 * MS)
        node.spin()

    rig.task(half, "half", on_processor=True)
    rig.kernel.run(4 * S)
    paid = [(one.at, one.kind, one.background) for one in rig.of(Charge) if one.background]
    assert paid == [(0, "ros:sleep", 5 * MS), (3 * S, "ros:wait", 1 * MS), (4 * S, "ros:wait", 2 * MS)]


def test_a_second_publish_within_a_millisecond_is_priced_as_publish_next(rig: Any) -> None:
    def talker() -> None:
        publisher = rig.graph.node("talker").advertise("chat", STRING)
        for pause in (0, 100 * MS, 0):
            rig.kernel.sleep_until(rig.kernel.now() + pause)
            publisher.publish(messages.new(STRING))

    def answerer() -> None:
        node = rig.graph.node("answerer")
        publisher = node.advertise("answers", STRING)
        node.subscribe("chat", STRING, publisher.publish)
        while node.spin_once(S):
            pass

    rig.task(answerer, "answerer", on_processor=True)
    rig.task(talker, "talker", on_processor=True)
    rig.kernel.run(S)
    calls = [(name, call) for name, call, _ in rig.asked if call.startswith("publish")]
    assert calls == [
        ("/talker", "publish"),
        ("/answerer", "publish_next"),
        ("/talker", "publish"),
        ("/talker", "publish_next"),
        ("/answerer", "publish_next"),
        ("/answerer", "publish_next"),
    ]
    assert {event.kind for event in rig.of(Charge) if "publish" in event.kind} == {"ros:publish"}


def test_publications_of_a_fast_loop_are_priced_as_often(rig: Any) -> None:
    def talker() -> None:
        node = rig.graph.node("talker")
        publishers = [node.advertise(topic, STRING) for topic in ("chat", "talk")]
        for pause in (50, 20, 20, 50):
            rig.kernel.sleep_until(rig.kernel.now() + pause * MS)
            for publisher in publishers:
                publisher.publish(messages.new(STRING))

    rig.task(talker, "talker", on_processor=True)
    rig.kernel.run(S)
    calls = [call for _, call, _ in rig.asked if call.startswith("publish")]
    slow, fast = ["publish", "publish_next"], ["publish_often", "publish_next_often"]
    assert calls == [*slow, *fast, *fast, *slow]


def test_messages_that_arrive_together_or_often_are_priced_as_such(rig: Any) -> None:
    def talker() -> None:
        node = rig.graph.node("talker")
        publishers = [node.advertise(topic, STRING) for topic in ("chat", "talk")]
        for pause in (50, 20, 50):
            rig.kernel.sleep_until(rig.kernel.now() + pause * MS)
            for publisher in publishers:
                publisher.publish(messages.new(STRING))

    def hearer() -> None:
        node = rig.graph.node("hearer")
        for topic in ("chat", "talk"):
            node.subscribe(topic, STRING, lambda message: None)

    rig.task(hearer, "hearer", on_processor=True)
    rig.task(talker, "talker", on_processor=True)
    rig.kernel.run(S)
    calls = [call for name, call, _ in rig.asked if name == "/hearer" and call.startswith("receive")]
    slow = ["receive", "receive_next"]
    assert calls == [*slow, "receive_often", "receive_next_often", *slow]


@pytest.mark.parametrize("priced", [True, False])
def test_a_request_costs_its_caller_and_its_server_what_the_law_says(rig: Any, priced: bool) -> None:
    if priced:
        rig.prices["call_service"] = type("P", (), {"caller": 40 * US, "background": 60 * US})()
        rig.prices["serve"] = type("P", (), {"caller": 700 * US, "background": 0})()

    def server() -> None:
        node = rig.graph.node("server")
        node.serve("switch", SET_BOOL, lambda request: messages.service(SET_BOOL).response())
        node.spin_once()

    def client() -> None:
        node = rig.graph.node("client")
        caller = node.client("switch", SET_BOOL)
        node.wait_for_service("switch")
        caller.call(messages.service(SET_BOOL).request())

    rig.run(server, client)
    charged = {one.kind: (one.caller, one.background) for one in rig.of(Charge)}
    if priced:
        assert charged["ros:call_service"] == (40 * US, 60 * US)
        assert charged["ros:serve"] == (700 * US, 0)
    else:
        assert not {"ros:call_service", "ros:serve"} & set(charged)
