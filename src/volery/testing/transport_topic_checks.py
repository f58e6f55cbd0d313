"""Checks of topics on any graph."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.ros.graph.interface import BEST_EFFORT, LATCHED, RELIABLE, TRANSIENT_LOCAL, Node, Publisher, QoS
from volery.ros.messages import message_class, new, types
from volery.testing.checks import demand, raising
from volery.testing.transport_site import Site, check

STRING = "std_msgs/msg/String"
PATIENT = QoS(depth=None)


def talk(site: Site, speaker: Node, topic: str, qos: QoS = PATIENT, kind: str = STRING) -> Publisher:
    """Return a publisher that is connected to a subscription."""
    publisher = speaker.advertise(topic, kind, qos)
    site.until(speaker, publisher.subscribers, f"a subscription of {publisher.topic} connects")
    return publisher


def say(publisher: Publisher, *texts: str) -> None:
    """Publish `texts` as strings."""
    for text in texts:
        publisher.publish(new(STRING, data=text))


@check
def messages_arrive_in_order(site: Site) -> None:
    """Check that all messages of one node arrive at another, in order."""
    speaker, listener = site.node("speaker"), site.node("listener")
    received: list[str] = []
    listener.subscribe("chat", STRING, lambda one: received.append(one.data), PATIENT)
    publisher = talk(site, speaker, "chat")
    said = [str(number) for number in range(50)]
    say(publisher, *said)
    site.spin_until(listener, lambda: len(received) >= 50, "50 messages arrive")
    demand(received == said, f"received {received}")


@check
def a_node_hears_itself(site: Site) -> None:
    """Check that a node receives its own messages."""
    node = site.node("node")
    received: list[str] = []
    node.subscribe("chat", STRING, lambda one: received.append(one.data))
    say(talk(site, node, "chat"), "me")
    site.spin_until(node, lambda: received, "its own message arrives")


@check
def what_is_sent_is_a_copy(site: Site) -> None:
    """Check that changes of a message after ``publish`` have no effect."""
    speaker, listener = site.node("speaker"), site.node("listener")
    received: list[str] = []
    listener.subscribe("chat", STRING, lambda one: received.append(one.data))
    publisher = talk(site, speaker, "chat")
    message = new(STRING, data="before")
    publisher.publish(message)
    message.data = "after"
    site.spin_until(listener, lambda: received, "the message arrives")
    demand(received == ["before"], f"received {received}")


@check
def each_subscription_hears(site: Site) -> None:
    """Check that two subscriptions, in one node or in two, each receive every message."""
    speaker, one, two = site.node("speaker"), site.node("one"), site.node("two")
    received: list[list[str]] = [[], [], []]
    one.subscribe("chat", STRING, lambda message: received[0].append(message.data), PATIENT)
    two.subscribe("chat", STRING, lambda message: received[1].append(message.data), PATIENT)
    two.subscribe("chat", STRING, lambda message: received[2].append(message.data), PATIENT)
    publisher = speaker.advertise("chat", STRING, PATIENT)
    site.until(speaker, lambda: publisher.subscribers() >= 2, "both nodes connect")
    speaker.sleep(200 * MS)  # of the two in one node each may connect by itself
    say(publisher, "a", "b")
    site.spin_until(one, lambda: len(received[0]) == 2, "both messages arrive")
    site.spin_until(
        two, lambda: len(received[1]) == len(received[2]) == 2, "both subscriptions of a node hear both"
    )
    demand(all(into == ["a", "b"] for into in received), f"received {received}")


@check
def a_full_queue_drops_the_oldest(site: Site) -> None:
    """Check that a subscription that is not spun keeps the newest messages, as many as its depth."""
    speaker, listener = site.node("speaker"), site.node("listener")
    received: list[str] = []
    arrived: list[str] = []
    listener.subscribe("chat", STRING, lambda one: received.append(one.data), QoS(depth=3))
    watch = site.spinning(site.node("watch"))
    watch.subscribe("chat", STRING, lambda one: arrived.append(one.data), PATIENT)
    publisher = speaker.advertise("chat", STRING, PATIENT)
    site.until(speaker, lambda: publisher.subscribers() == 2, "both connect")
    say(publisher, *[str(number) for number in range(20)])
    site.until(speaker, lambda: len(arrived) == 20, "all messages arrive where they are taken")
    speaker.sleep(200 * MS)
    site.listen(listener)
    demand(received == ["17", "18", "19"], f"of 20 messages a depth of 3 kept {received}")


@check
def a_latched_message_waits_for_who_comes_late(site: Site) -> None:
    """Check that a late subscription receives the last message of a transient-local publisher, once."""
    speaker, listener = site.node("speaker"), site.node("listener")
    say(speaker.advertise("map", STRING, LATCHED), "old", "new")
    received: list[str] = []
    listener.subscribe("map", STRING, lambda one: received.append(one.data))
    site.spin_until(listener, lambda: received, "the latched message arrives")
    site.listen(listener)
    demand(received == ["new"], f"received {received}")


@check
def as_many_are_kept_as_the_depth_says(site: Site) -> None:
    """Check that a transient-local publisher with a depth of 2 keeps two messages (ROS 1: one)."""
    speaker, listener = site.node("speaker"), site.node("listener")
    say(speaker.advertise("map", STRING, QoS(2, durability=TRANSIENT_LOCAL)), "1", "2", "3")
    received: list[str] = []
    listener.subscribe("map", STRING, lambda one: received.append(one.data))
    expected = ["2", "3"] if site.traits.keeps_depth else ["3"]
    site.spin_until(listener, lambda: len(received) >= len(expected), "what is kept arrives")
    site.listen(listener)
    demand(received == expected, f"received {received}, not {expected}")


@check
def what_is_volatile_is_gone(site: Site) -> None:
    """Check that a late subscription receives no earlier messages of a volatile publisher."""
    speaker, listener = site.node("speaker"), site.node("listener")
    publisher = speaker.advertise("chat", STRING)
    say(publisher, "missed")
    received: list[str] = []
    listener.subscribe("chat", STRING, lambda one: received.append(one.data))
    site.until(speaker, publisher.subscribers, "it connects")
    say(publisher, "received")
    site.spin_until(listener, lambda: received, "the next message arrives")
    demand(received == ["received"], f"received {received}")


@check
def a_plain_subscription_takes_what_is_offered(site: Site) -> None:
    """Check that a subscription without QoS receives from publishers of every QoS."""
    listener, speaker = site.node("listener"), site.node("speaker")
    offers = {"a": QoS(), "b": QoS(reliability=BEST_EFFORT), "c": LATCHED}
    received: list[str] = []
    for topic in offers:
        listener.subscribe(topic, STRING, lambda one: received.append(one.data))
    for topic, qos in offers.items():
        say(talk(site, speaker, topic, qos), topic)
    site.spin_until(listener, lambda: len(received) == 3, f"all three arrive, received {received}")


@check
def a_qos_that_does_not_fit_is_not_heard(site: Site) -> None:
    """Check that a reliable subscription receives nothing from a best-effort publisher (except in ROS 1)."""
    speaker, listener = site.node("speaker"), site.node("listener")
    received: list[str] = []
    subscription = listener.subscribe(
        "chat", STRING, lambda one: received.append(one.data), QoS(reliability=RELIABLE)
    )
    publisher = speaker.advertise("chat", STRING, QoS(reliability=BEST_EFFORT))
    if site.traits.qos:
        speaker.sleep(S)
        demand(publisher.subscribers() == 0, "the publisher counts it as connected")
        demand(subscription.publishers() == 0, "the subscription counts it as connected")
    else:
        site.until(speaker, publisher.subscribers, "it connects")
    say(publisher, "x")
    site.listen(listener)
    demand(bool(received) != site.traits.qos, f"received {received}")


@check
def both_sides_count_their_peers(site: Site) -> None:
    """Check that ``subscribers`` and ``publishers`` count the present connections."""
    speaker, listener = site.node("speaker"), site.node("listener")
    publisher = speaker.advertise("chat", STRING)
    demand(publisher.subscribers() == 0, "a subscription is counted before there is one")
    subscription = listener.subscribe("chat", STRING, lambda one: None)
    site.until(speaker, lambda: publisher.subscribers() == 1, "the publisher counts 1")
    site.until(speaker, lambda: subscription.publishers() == 1, "the subscription counts 1")
    subscription.close()
    site.until(speaker, lambda: publisher.subscribers() == 0, "the publisher counts 0 again")
    other = listener.subscribe("chat", STRING, lambda one: None)
    site.until(speaker, lambda: other.publishers() == 1, "a new subscription counts 1")
    site.until(speaker, lambda: publisher.subscribers() == 1, "the publisher counts the new one")
    publisher.close()
    site.until(speaker, lambda: other.publishers() == 0, "it counts 0 when the publisher has gone")


@check
def a_closed_subscription_is_silent(site: Site) -> None:
    """Check that a callback is not called after ``close``, not even with waiting messages."""
    speaker, listener = site.node("speaker"), site.node("listener")
    received: list[str] = []
    subscription = listener.subscribe("chat", STRING, lambda one: received.append(one.data))
    publisher = talk(site, speaker, "chat")
    say(publisher, "waits")
    speaker.sleep(200 * MS)
    subscription.close()
    say(publisher, "late")
    site.listen(listener)
    demand(not received, f"received {received}")


@check
def a_closed_publisher_says_so(site: Site) -> None:
    """Check that ``publish`` after ``close`` is a ``UsageError`` that names the topic."""
    node = site.node("node")
    publisher = node.advertise("chat", STRING)
    publisher.close()
    with raising(UsageError, naming=publisher.topic):
        say(publisher, "x")


@check
def another_type_is_refused(site: Site) -> None:
    """Check that publishing another type, or no message, is a ``UsageError`` that names both."""
    publisher = site.node("node").advertise("chat", STRING)
    with raising(UsageError, naming=STRING):
        publisher.publish(new("std_msgs/msg/Bool"))
    with raising(UsageError, naming=STRING):
        publisher.publish("text")


@check
def a_value_that_does_not_fit_is_refused(site: Site) -> None:
    """Check that a value outside its field's range is a ``UsageError`` that names the field."""
    speaker, listener = site.node("speaker"), site.node("listener")
    received: list[int] = []
    listener.subscribe("n", "std_msgs/msg/UInt8", lambda one: received.append(one.data))
    publisher = talk(site, speaker, "n", kind="std_msgs/msg/UInt8")
    with raising(UsageError, naming="data"):
        publisher.publish(new("std_msgs/msg/UInt8", data=300))
    publisher.publish(new("std_msgs/msg/UInt8", data=200))
    site.spin_until(listener, lambda: received == [200], f"200 arrives, received {received}")


@check
def nodes_of_two_types_are_not_connected(site: Site) -> None:
    """Check that a topic's second type is refused, naming both, or has its own connections."""
    one, two = site.node("one"), site.node("two")
    publisher = one.advertise("chat", STRING)
    site.until(two, lambda: any(t.name == publisher.topic for t in site.graph.topics()), "the topic is known")
    try:
        second = two.advertise("chat", "std_msgs/msg/Bool")
    except UsageError as error:
        text = str(error)
        named = all(part in text for part in (publisher.topic, one.name, "Bool"))
        demand(named, f"it does not name both: {text}")
        with raising(UsageError, naming=publisher.topic):
            two.subscribe("chat", "std_msgs/msg/Bool", lambda message: None)
        return
    one.subscribe("chat", "std_msgs/msg/Bool", lambda message: None)
    site.until(two, lambda: second.subscribers() == 1, "nodes of the second type are connected")
    demand(publisher.subscribers() == 0, "nodes of different types are connected")


@check
def an_unknown_type_is_refused(site: Site) -> None:
    """Check that an unknown message type is a ``UsageError`` that names it."""
    node = site.node("node")
    with raising(UsageError, naming="Sting"):
        node.advertise("chat", "std_msgs/msg/Sting")


PUBLISHED = ("std_msgs", "geometry_msgs", "sensor_msgs", "nav_msgs", "mavros_msgs", "geographic_msgs",
             "diagnostic_msgs", "tf2_msgs")  # fmt: skip
"""Packages whose types volery publishes."""


def sample(name: str) -> Any:
    """Return a message in which no field has its default, as far as types allow."""
    message = message_class(name)()
    for number, field in enumerate(message.__match_args__, start=1):
        setattr(message, field, _sample(getattr(message, field), number))
    return message


def _sample(value: Any, number: int) -> Any:
    if isinstance(value, bool):
        return True
    if isinstance(value, (int, float)):
        return type(value)(number)
    if isinstance(value, str):
        return f"text {number} ü"
    if isinstance(value, np.ndarray):
        return np.arange(number, number + (value.size or 3)).astype(value.dtype)
    if hasattr(value, "__msgtype__"):
        return sample(value.__msgtype__)
    return [_sample(one, number + index) for index, one in enumerate(value)]


@check
def every_type_arrives_as_it_was(site: Site) -> None:
    """Check that messages of each type in ``PUBLISHED`` arrive with all their values."""
    speaker, listener = site.node("speaker"), site.node("listener")
    names = [kind for kind in types() if kind.split("/")[0] in PUBLISHED and site.traits.carries(kind)]
    received: dict[str, Any] = {}
    publishers = {}
    for number, name in enumerate(names):
        listener.subscribe(f"t{number}", name, partial(received.__setitem__, name))
        publishers[name] = speaker.advertise(f"t{number}", name)
    for name, publisher in publishers.items():
        site.until(speaker, publisher.subscribers, f"{name} connects")
        publisher.publish(sample(name))
    site.spin_until(listener, lambda: len(received) == len(names), "all types arrive", within=30 * S)
    wrong = [name for name in names if received[name] != sample(name).copy()]
    demand(len(names) > 40, f"only {len(names)} types were carried")
    demand(not wrong, f"changed on the way: {wrong}")
