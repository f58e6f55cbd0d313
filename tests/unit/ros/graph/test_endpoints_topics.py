from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.ros import messages
from volery.ros.graph import AS_OFFERED, BEST_AVAILABLE, BEST_EFFORT, LATCHED, RELIABLE, TRANSIENT_LOCAL, QoS
from volery.trace.events import NONE, Message, Published, Text

STRING = "std_msgs/msg/String"


def string(text: str) -> Any:
    return messages.new(STRING, data=text)


def test_a_message_reaches_every_subscriber_as_its_own_copy(rig: Any) -> None:
    heard: dict[str, Any] = {}

    def listener() -> None:
        node = rig.graph.node("listener")
        node.subscribe("chat", STRING, lambda message: heard.setdefault("one", message))
        node.subscribe("/chat", STRING, lambda message: heard.setdefault("two", message))
        node.spin_once()
        node.spin_once()

    def talker() -> None:
        node = rig.graph.node("talker")
        publisher = node.advertise("chat", STRING)
        message = string("hello")
        node.sleep(S)
        publisher.publish(message)
        message.data = "changed behind its back"

    rig.run(listener, talker)
    assert heard == {"one": string("hello"), "two": string("hello")}
    assert heard["one"] is not heard["two"]
    assert [(event.publisher, event.subscriber) for event in rig.of(Message)] == [
        ("/talker", "/listener")
    ] * 2


def test_what_is_published_is_recorded_as_ros_2_bytes(rig: Any) -> None:
    def talker() -> None:
        rig.graph.node("talker").advertise("chat", STRING).publish(string("hello"))

    rig.run(talker)
    expected = messages.to_cdr(string("hello"))
    assert rig.of(Published) == [Published(0, "/chat", STRING, "/talker", expected)]


def test_recording_is_switched_by_topic(rig: Any) -> None:
    graph = rig.new_graph(records=lambda topic: topic != "/noise")

    def talker() -> None:
        node = graph.node("talker")
        node.advertise("noise", STRING).publish(string("a"))
        node.advertise("word", STRING).publish(string("b"))

    rig.run(talker)
    assert [event.topic for event in rig.of(Published)] == ["/word"]


def test_the_sender_is_asked_to_carry_the_size_of_the_encoding(rig: Any) -> None:
    graph = rig.new_graph(records=lambda topic: False)

    def both() -> None:
        node = graph.node("both")
        node.subscribe("chat", STRING, print)
        node.advertise("chat", STRING).publish(string("hello"))

    rig.run(both)
    assert [(size, reliable) for _, _, size, reliable in rig.carried] == [
        (len(messages.to_cdr(string("hello"))), True)
    ]


def test_a_value_that_does_not_fit_is_an_error_also_where_contents_are_not_recorded(rig: Any) -> None:
    graph = rig.new_graph(records=lambda topic: False)

    def talker() -> None:
        publisher = graph.node("talker").advertise("chat", STRING)
        with pytest.raises(UsageError, match="data is 7, not a string"):
            publisher.publish(messages.new(STRING, data=7))

    rig.run(talker)


def test_a_full_queue_drops_the_oldest(rig: Any) -> None:
    heard: list[str] = []

    def both() -> None:
        node = rig.graph.node("both")
        subscription = node.subscribe("chat", STRING, lambda m: heard.append(m.data), QoS(depth=2))
        publisher = node.advertise("chat", STRING)
        for text in "abcd":
            publisher.publish(string(text))
        node.sleep(S)
        while node.spin_once(0):
            pass
        assert subscription.dropped == 2

    rig.run(both)
    assert heard == ["c", "d"]


def test_callbacks_run_in_the_order_of_arrival_across_topics(rig: Any) -> None:
    heard: list[str] = []

    def both() -> None:
        node = rig.graph.node("both")
        for topic in ("a", "b"):
            node.subscribe(topic, STRING, lambda m: heard.append(m.data))
        publishers = {topic: node.advertise(topic, STRING) for topic in "ab"}
        for topic, text in (("b", "1"), ("a", "2"), ("b", "3")):
            publishers[topic].publish(string(text))
        node.sleep(S)
        while node.spin_once(0):
            pass

    rig.run(both)
    assert heard == ["1", "2", "3"]


def late(rig: Any, offered: QoS, wanted: QoS) -> list[str]:
    """What a subscriber hears that comes after three messages, before a fourth."""
    heard: list[str] = []

    def both() -> None:
        node = rig.graph.node("both")
        publisher = node.advertise("chat", STRING, offered)
        for text in "abc":
            publisher.publish(string(text))
        node.sleep(S)
        node.subscribe("chat", STRING, lambda m: heard.append(m.data), wanted)
        node.sleep(S)
        publisher.publish(string("d"))
        node.sleep(S)
        while node.spin_once(0):
            pass

    rig.run(both)
    return heard


def test_latched_messages_reach_late_subscribers(rig: Any) -> None:
    assert late(rig, LATCHED, QoS(durability=TRANSIENT_LOCAL)) == ["c", "d"]


def test_transient_local_keeps_as_many_as_its_depth(rig: Any) -> None:
    offered = QoS(depth=2, durability=TRANSIENT_LOCAL)
    assert late(rig, offered, QoS(durability=BEST_AVAILABLE)) == ["b", "c", "d"]


def test_a_subscription_accepts_every_qos_by_default(rig: Any) -> None:
    assert late(rig, LATCHED, AS_OFFERED) == ["c", "d"]


def test_a_volatile_subscriber_receives_only_later_messages(rig: Any) -> None:
    assert late(rig, LATCHED, QoS()) == ["d"]


@pytest.mark.parametrize(
    ("offered", "wanted", "why"),
    [
        (QoS(reliability=BEST_EFFORT), QoS(reliability=RELIABLE), "reliable is wanted"),
        (QoS(), QoS(durability=TRANSIENT_LOCAL), "transient local is wanted"),
    ],
)
def test_incompatible_qos_is_not_connected_but_reported(
    rig: Any, offered: QoS, wanted: QoS, why: str
) -> None:
    assert late(rig, offered, wanted) == []
    to_publisher, to_subscriber = (event.text for event in rig.of(Text))
    assert "New subscription discovered on topic '/chat', requesting incompatible QoS." in to_publisher
    assert "New publisher discovered on topic '/chat', offering incompatible QoS." in to_subscriber
    assert why in to_publisher
    assert why in to_subscriber


def test_a_ros_1_subscriber_takes_best_effort(rig: Any) -> None:
    wanted = QoS(reliability=BEST_AVAILABLE, durability=BEST_AVAILABLE)
    assert late(rig, QoS(reliability=BEST_EFFORT), wanted) == ["d"]
    assert [reliable for *_, reliable in rig.carried] == [False]


def test_what_is_lost_on_the_way_is_recorded(rig: Any) -> None:
    rig.loses = True
    quality = QoS(reliability=BEST_EFFORT)
    assert late(rig, quality, quality) == []
    [lost] = rig.of(Message)
    assert (lost.sent, lost.received, lost.topic, lost.subscriber) == (2 * S, NONE, "/chat", "/both")


def test_delivery_takes_the_time_of_the_way(rig: Any) -> None:
    rig.delay = 20 * MS

    def listener() -> None:
        node = rig.graph.node("listener")
        node.subscribe("chat", STRING, lambda message: None)
        node.spin_once()
        assert rig.kernel.now() == 1020 * MS

    def talker() -> None:
        node = rig.graph.node("talker")
        publisher = node.advertise("chat", STRING)
        node.sleep(S)
        publisher.publish(string("x"))

    rig.run(listener, talker)
    assert [(event.sent, event.received) for event in rig.of(Message)] == [(S, 1020 * MS)]


def test_nodes_of_two_types_share_a_name_and_do_not_hear_each_other(rig: Any) -> None:
    heard: list[Any] = []

    def both() -> None:
        node = rig.graph.node("both")
        texts = node.advertise("chat", STRING)
        node.subscribe("chat", "std_msgs/Bool", heard.append)
        texts.publish(string("x"))
        node.advertise("chat", "std_msgs/Bool").publish(messages.new("std_msgs/Bool", data=True))
        node.spin_once(S)
        assert texts.subscribers() == 0

    rig.run(both)
    assert [one.data for one in heard] == [True]
    assert [one.type for one in rig.graph.topics() if one.name == "/chat"] == [STRING, "std_msgs/msg/Bool"]
    [warning] = [one.text for one in rig.of(Text) if "carries" in one.text]
    assert warning.startswith("/chat carries std_msgs/msg/String (of /both), not std_msgs/msg/Bool")


def test_the_wrong_type_is_refused(rig: Any) -> None:
    def both() -> None:
        node = rig.graph.node("both")
        publisher = node.advertise("chat", STRING)
        with pytest.raises(UsageError, match=r"/chat carries std_msgs/msg/String, not std_msgs/msg/Bool"):
            publisher.publish(messages.new("std_msgs/Bool"))
        with pytest.raises(UsageError, match="did you mean"):
            node.advertise("other", "std_msgs/Sting")

    rig.run(both)


def test_closing_ends_a_connection(rig: Any) -> None:
    heard: list[Any] = []

    def both() -> None:
        node = rig.graph.node("both")
        publisher = node.advertise("chat", STRING)
        subscription = node.subscribe("chat", STRING, heard.append)
        assert (publisher.subscribers(), subscription.publishers()) == (1, 1)
        publisher.publish(string("forgotten"))
        subscription.close()
        publisher.publish(string("unheard"))
        assert publisher.subscribers() == 0
        publisher.close()
        with pytest.raises(UsageError, match="closed"):
            publisher.publish(string("x"))
        node.sleep(S)
        assert not node.spin_once(0)

    rig.run(both)
    assert heard == []


def test_a_thousand_topics(rig: Any) -> None:
    heard: list[str] = []
    count = 1000

    def listener() -> None:
        node = rig.graph.node("listener")
        for number in range(count):
            node.subscribe(f"t{number}", STRING, lambda m: heard.append(m.data))
        while len(heard) < count:
            node.spin_once()

    def talker() -> None:
        node = rig.graph.node("talker")
        publishers = [node.advertise(f"t{number}", STRING) for number in range(count)]
        node.sleep(S)
        for number, publisher in enumerate(publishers):
            publisher.publish(string(str(number)))

    rig.run(listener, talker)
    assert heard == [str(number) for number in range(count)]
    assert len(rig.graph.topics()) == count


def test_the_clock_is_published_while_it_has_subscribers(rig: Any) -> None:
    ticks: list[int] = []

    def listener() -> None:
        node = rig.graph.node("listener")
        clock = node.subscribe(
            "/clock", "rosgraph_msgs/Clock", lambda m: ticks.append(m.clock.to_nsec()), QoS(100)
        )
        node.sleep(55 * MS)
        while node.spin_once(0):
            pass
        clock.close()
        node.sleep(S)

    rig.run(listener)
    assert ticks == [0, 10 * MS, 20 * MS, 30 * MS, 40 * MS, 50 * MS]
    assert rig.of(Published) == []


def test_ros_time_counts_from_the_epoch(rig: Any) -> None:
    graph = rig.new_graph(epoch=1_000 * S)

    def both() -> None:
        node = graph.node("both")
        node.sleep(S)
        assert node.now() == 1_001 * S

    rig.run(both)


def test_qos_refuses_nonsense() -> None:
    for wrong in ({"depth": 0}, {"reliability": "sometimes"}, {"durability": "forever"}):
        with pytest.raises(UsageError, match=str(next(iter(wrong.values())))):
            QoS(**wrong)
