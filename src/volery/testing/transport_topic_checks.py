"""What topics must do on any graph."""

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
    """A publisher that somebody hears."""
    publisher = speaker.advertise(topic, kind, qos)
    site.until(speaker, publisher.subscribers, f"a subscription of {publisher.topic} connects")
    return publisher


def say(publisher: Publisher, *texts: str) -> None:
    """Publish strings."""
    for text in texts:
        publisher.publish(new(STRING, data=text))


@check
def messages_arrive_in_order(site: Site) -> None:
    """What one node publishes another hears, all of it, in order."""
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[str] = []
    listener.subscribe("chat", STRING, lambda one: heard.append(one.data), PATIENT)
    publisher = talk(site, speaker, "chat")
    said = [str(number) for number in range(50)]
    say(publisher, *said)
    site.spin_until(listener, lambda: len(heard) >= 50, "50 messages arrive")
    demand(heard == said, f"heard {heard}")


@check
def a_node_hears_itself(site: Site) -> None:
    """A node that subscribes to what it publishes gets it."""
    node = site.node("node")
    heard: list[str] = []
    node.subscribe("chat", STRING, lambda one: heard.append(one.data))
    say(talk(site, node, "chat"), "me")
    site.spin_until(node, lambda: heard, "its own message arrives")


@check
def what_is_sent_is_a_copy(site: Site) -> None:
    """A message that is changed after it was published arrives as it was."""
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[str] = []
    listener.subscribe("chat", STRING, lambda one: heard.append(one.data))
    publisher = talk(site, speaker, "chat")
    message = new(STRING, data="before")
    publisher.publish(message)
    message.data = "after"
    site.spin_until(listener, lambda: heard, "the message arrives")
    demand(heard == ["before"], f"heard {heard}")


@check
def each_subscription_hears(site: Site) -> None:
    """Two subscriptions, in one node or in two, each get every message."""
    speaker, one, two = site.node("speaker"), site.node("one"), site.node("two")
    heard: list[list[str]] = [[], [], []]
    one.subscribe("chat", STRING, lambda message: heard[0].append(message.data), PATIENT)
    two.subscribe("chat", STRING, lambda message: heard[1].append(message.data), PATIENT)
    two.subscribe("chat", STRING, lambda message: heard[2].append(message.data), PATIENT)
    publisher = speaker.advertise("chat", STRING, PATIENT)
    site.until(speaker, lambda: publisher.subscribers() >= 2, "both nodes connect")
    speaker.sleep(200 * MS)  # of the two in one node each may connect by itself
    say(publisher, "a", "b")
    site.spin_until(one, lambda: len(heard[0]) == 2, "both messages arrive")
    site.spin_until(
        two, lambda: len(heard[1]) == len(heard[2]) == 2, "both subscriptions of a node hear both"
    )
    demand(all(into == ["a", "b"] for into in heard), f"heard {heard}")


@check
def a_full_queue_drops_the_oldest(site: Site) -> None:
    """A subscription that does not spin keeps the newest messages, as many as its depth says."""
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[str] = []
    arrived: list[str] = []
    listener.subscribe("chat", STRING, lambda one: heard.append(one.data), QoS(depth=3))
    watch = site.spinning(site.node("watch"))
    watch.subscribe("chat", STRING, lambda one: arrived.append(one.data), PATIENT)
    publisher = speaker.advertise("chat", STRING, PATIENT)
    site.until(speaker, lambda: publisher.subscribers() == 2, "both connect")
    say(publisher, *[str(number) for number in range(20)])
    site.until(speaker, lambda: len(arrived) == 20, "all messages arrive where they are taken")
    speaker.sleep(200 * MS)
    site.listen(listener)
    demand(heard == ["17", "18", "19"], f"of 20 messages a depth of 3 kept {heard}")


@check
def a_latched_message_waits_for_who_comes_late(site: Site) -> None:
    """A subscription that comes late gets the last message of a transient local publisher, once."""
    speaker, listener = site.node("speaker"), site.node("listener")
    say(speaker.advertise("map", STRING, LATCHED), "old", "new")
    heard: list[str] = []
    listener.subscribe("map", STRING, lambda one: heard.append(one.data))
    site.spin_until(listener, lambda: heard, "the latched message arrives")
    site.listen(listener)
    demand(heard == ["new"], f"heard {heard}")


@check
def as_many_are_kept_as_the_depth_says(site: Site) -> None:
    """A transient local publisher with a depth of 2 keeps two messages (ROS 1: one)."""
    speaker, listener = site.node("speaker"), site.node("listener")
    say(speaker.advertise("map", STRING, QoS(2, durability=TRANSIENT_LOCAL)), "1", "2", "3")
    heard: list[str] = []
    listener.subscribe("map", STRING, lambda one: heard.append(one.data))
    expected = ["2", "3"] if site.traits.keeps_depth else ["3"]
    site.spin_until(listener, lambda: len(heard) >= len(expected), "what is kept arrives")
    site.listen(listener)
    demand(heard == expected, f"heard {heard}, not {expected}")


@check
def what_is_volatile_is_gone(site: Site) -> None:
    """A subscription that comes late gets nothing of a volatile publisher's past."""
    speaker, listener = site.node("speaker"), site.node("listener")
    publisher = speaker.advertise("chat", STRING)
    say(publisher, "missed")
    heard: list[str] = []
    listener.subscribe("chat", STRING, lambda one: heard.append(one.data))
    site.until(speaker, publisher.subscribers, "it connects")
    say(publisher, "heard")
    site.spin_until(listener, lambda: heard, "the next message arrives")
    demand(heard == ["heard"], f"heard {heard}")


@check
def a_plain_subscription_takes_what_is_offered(site: Site) -> None:
    """A subscription without QoS hears reliable, best effort, volatile and latched publishers."""
    listener, speaker = site.node("listener"), site.node("speaker")
    offers = {"a": QoS(), "b": QoS(reliability=BEST_EFFORT), "c": LATCHED}
    heard: list[str] = []
    for topic in offers:
        listener.subscribe(topic, STRING, lambda one: heard.append(one.data))
    for topic, qos in offers.items():
        say(talk(site, speaker, topic, qos), topic)
    site.spin_until(listener, lambda: len(heard) == 3, f"all three arrive, heard {heard}")


@check
def a_qos_that_does_not_fit_is_not_heard(site: Site) -> None:
    """A reliable subscription does not hear a best effort publisher (in ROS 1 it does)."""
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[str] = []
    subscription = listener.subscribe(
        "chat", STRING, lambda one: heard.append(one.data), QoS(reliability=RELIABLE)
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
    demand(bool(heard) != site.traits.qos, f"heard {heard}")


@check
def both_sides_count_their_peers(site: Site) -> None:
    """``subscribers`` and ``publishers`` follow who comes and goes."""
    speaker, listener = site.node("speaker"), site.node("listener")
    publisher = speaker.advertise("chat", STRING)
    demand(publisher.subscribers() == 0, "somebody is counted before anybody has come")
    subscription = listener.subscribe("chat", STRING, lambda one: None)
    site.until(speaker, lambda: publisher.subscribers() == 1, "the publisher counts 1")
    site.until(speaker, lambda: subscription.publishers() == 1, "the subscription counts 1")
    subscription.close()
    site.until(speaker, lambda: publisher.subscribers() == 0, "the publisher counts 0 again")
    other = listener.subscribe("chat", STRING, lambda one: None)
    site.until(speaker, lambda: other.publishers() == 1, "a new subscription counts 1")
    publisher.close()
    site.until(speaker, lambda: other.publishers() == 0, "it counts 0 when the publisher has gone")


@check
def a_closed_subscription_is_silent(site: Site) -> None:
    """After ``close`` its callback is not called, not even with what waited."""
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[str] = []
    subscription = listener.subscribe("chat", STRING, lambda one: heard.append(one.data))
    publisher = talk(site, speaker, "chat")
    say(publisher, "waits")
    speaker.sleep(200 * MS)
    subscription.close()
    say(publisher, "late")
    site.listen(listener)
    demand(not heard, f"heard {heard}")


@check
def a_closed_publisher_says_so(site: Site) -> None:
    """``publish`` after ``close`` is a ``UsageError`` that names the topic."""
    node = site.node("node")
    publisher = node.advertise("chat", STRING)
    publisher.close()
    with raising(UsageError, naming=publisher.topic):
        say(publisher, "x")


@check
def another_type_is_refused(site: Site) -> None:
    """Publishing another type than the topic's, or none at all, is a ``UsageError`` that names both."""
    publisher = site.node("node").advertise("chat", STRING)
    with raising(UsageError, naming=STRING):
        publisher.publish(new("std_msgs/msg/Bool"))
    with raising(UsageError, naming=STRING):
        publisher.publish("text")


@check
def a_value_that_does_not_fit_is_refused(site: Site) -> None:
    """A value outside its field's range is a ``UsageError`` that names the field; the next message goes."""
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[int] = []
    listener.subscribe("n", "std_msgs/msg/UInt8", lambda one: heard.append(one.data))
    publisher = talk(site, speaker, "n", kind="std_msgs/msg/UInt8")
    with raising(UsageError, naming="data"):
        publisher.publish(new("std_msgs/msg/UInt8", data=300))
    publisher.publish(new("std_msgs/msg/UInt8", data=200))
    site.spin_until(listener, lambda: heard == [200], f"200 arrives, heard {heard}")


@check
def a_topic_has_one_type(site: Site) -> None:
    """Advertising or subscribing to a topic as another type is a ``UsageError`` naming both and the users."""
    one, two = site.node("one"), site.node("two")
    publisher = one.advertise("chat", STRING)
    site.until(two, lambda: any(t.name == publisher.topic for t in site.graph.topics()), "the topic is known")
    with raising(UsageError, naming=publisher.topic) as caught:
        two.advertise("chat", "std_msgs/msg/Bool")
    demand(one.name in caught.text and "Bool" in caught.text, f"it does not name both: {caught.text}")
    with raising(UsageError, naming=publisher.topic):
        two.subscribe("chat", "std_msgs/msg/Bool", lambda message: None)


@check
def an_unknown_type_is_refused(site: Site) -> None:
    """A message type that does not exist is a ``UsageError`` that names it."""
    node = site.node("node")
    with raising(UsageError, naming="Sting"):
        node.advertise("chat", "std_msgs/msg/Sting")


PUBLISHED = ("std_msgs", "geometry_msgs", "sensor_msgs", "nav_msgs", "mavros_msgs", "geographic_msgs",
             "diagnostic_msgs", "tf2_msgs")  # fmt: skip
"""The packages of what we publish."""


def sample(name: str) -> Any:
    """A message in which no field has its default, as far as types allow."""
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
    """Each type of the packages that we publish goes over with all its values."""
    speaker, listener = site.node("speaker"), site.node("listener")
    names = [one for one in types() if one.split("/")[0] in PUBLISHED and site.traits.carries(one)]
    heard: dict[str, Any] = {}
    publishers = {}
    for number, name in enumerate(names):
        listener.subscribe(f"t{number}", name, partial(heard.__setitem__, name))
        publishers[name] = speaker.advertise(f"t{number}", name)
    for name, publisher in publishers.items():
        site.until(speaker, publisher.subscribers, f"{name} connects")
        publisher.publish(sample(name))
    site.spin_until(listener, lambda: len(heard) == len(names), "all types arrive", within=30 * S)
    wrong = [name for name in names if heard[name] != sample(name).copy()]
    demand(len(names) > 40, f"only {len(names)} types were carried")
    demand(not wrong, f"changed on the way: {wrong}")
