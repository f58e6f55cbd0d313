"""Recorder of a graph's topics, and playback of a recording into a graph."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import MS, Ns, S, from_seconds
from volery.ros.graph.interface import (
    AS_OFFERED,
    BEST_EFFORT,
    CLOCK,
    RELIABLE,
    TRANSIENT_LOCAL,
    VOLATILE,
    Node,
    Publisher,
    QoS,
    RosGraph,
    Subscription,
)
from volery.ros.messages import RosMessage, new
from volery.ros.messages.bags import Bag, BagConnection, BagWriter, qos_profile
from volery.ros.messages.containers import Offer

_DISCOVERY_PERIOD: Ns = 500 * MS
_QUEUED: QoS = QoS(1000, AS_OFFERED.reliability, AS_OFFERED.durability)


class Recorder:
    """Records the messages of a graph. Call ``run`` in a task, ``stop`` from anywhere.

    Args:
        graph: Graph whose topics are discovered.
        node: Node that subscribes to them.
        writer: Recording to add the messages to.
        topics: Names of the topics to record; None for all, each from its discovery on.
        on_message: Called with the topic of each recorded message.

    Attributes:
        counts: Number of recorded messages by topic.
        problems: Reasons why a topic cannot be recorded, by topic.
    """

    def __init__(
        self,
        graph: RosGraph,
        node: Node,
        writer: BagWriter,
        *,
        topics: Collection[str] | None = None,
        on_message: Callable[[str], None] = lambda topic: None,
    ) -> None:
        self._graph, self._node, self._writer = graph, node, writer
        self._topics = None if topics is None else frozenset(node.resolve(topic) for topic in topics)
        self._on_message = on_message
        self._seen: set[str] = set()
        self._subscriptions: dict[str, Subscription] = {}
        self._offers: dict[str, Offer] = {}
        self._stopped = False
        self.counts: dict[str, int] = {}
        self.problems: dict[str, str] = {}

    def run(self) -> None:
        """Record until ``stop``."""
        looked: Ns | None = None
        while not self._stopped and not self._node.closed:
            now = self._node.now()
            if looked is None or now - looked >= _DISCOVERY_PERIOD:
                looked = now
                self._discover()
            self._node.spin_once(_DISCOVERY_PERIOD)
        for topic, subscription in self._subscriptions.items():
            if subscription.dropped:
                self.problems.setdefault(topic, f"{subscription.dropped} messages came too fast")

    def stop(self) -> None:
        """Stop recording; ``run`` returns within half a second."""
        self._stopped = True

    def _discover(self) -> None:
        for topic in self._graph.topics():
            wanted = topic.publishers and (self._topics is None or topic.name in self._topics)
            if wanted:
                self._offers[topic.name] = _offer(self._graph.offered(topic.name))
            if not wanted or topic.name in self._seen:
                continue
            self._seen.add(topic.name)
            try:
                self._subscriptions[topic.name] = self._node.subscribe(
                    topic.name, topic.type, partial(self._write, topic.name), _QUEUED
                )
            except UsageError as error:
                self.problems[topic.name] = str(error)

    def _write(self, topic: str, message: RosMessage) -> None:
        if topic in self.problems:
            return
        offer = self._offers[topic]
        subscription = self._subscriptions.get(topic)
        sender, latched = subscription.latest_sender() if subscription is not None else ("", False)
        if sender:
            offer = Offer(latched, sender)
        try:
            self._writer.write(topic, self._node.now(), message, offer)
        except UsageError as error:
            self.problems[topic] = str(error)
            return
        self.counts[topic] = self.counts.get(topic, 0) + 1
        self._on_message(topic)


def _offer(offered: Collection[QoS]) -> Offer:
    """Return what the publishers of a topic offer, as recordings state it."""
    profiles = [
        qos_profile(one.reliability != BEST_EFFORT, one.durability == TRANSIENT_LOCAL, one.depth or 0)
        for one in offered
    ]
    latched = any(one.durability == TRANSIENT_LOCAL for one in offered)
    return Offer(latched, "", tuple(dict.fromkeys(profiles)))


_DEPTH = 100
_CLOCK_PERIOD: Ns = 10 * MS
_LOOK_PERIOD: Ns = 50 * MS
_LATCHED = frozenset({"/tf_static", "/robot_description", "/map"})
"""Topics that are latched by ROS's conventions, for recordings that do not state it."""


@dataclass(frozen=True)
class PlayOptions:
    """How to play a recording.

    Attributes:
        rate: Recorded seconds per second, above 0.
        topics: Names of the topics to play; None for all that can be decoded, without those of a run's trace.
        after: Recorded time to skip at the start, s.
        clock: Publish the recorded time on ``/clock``.
        delay: Time between advertising and the first message, and after the last one, s; connecting takes
            time on a real graph.
        wait_for_subscribers: Wait until each topic has a subscriber, before the delay.
        on_message: Called for each message with the number of played messages and its recorded time, ns.
        loop: Begin again at the end, until the node is closed.
        restamped: Move the stamps of headers by the difference of the graph's time to the recorded one.
    """

    rate: float = 1.0
    topics: Collection[str] | None = None
    after: float = 0.0
    clock: bool = False
    delay: float = 0.0
    wait_for_subscribers: bool = False
    on_message: Callable[[int, Ns], None] = lambda played, at: None
    loop: bool = False
    restamped: bool = False

    def __post_init__(self) -> None:
        if not 0.0 < self.rate < float("inf"):
            raise UsageError(f"a rate of {self.rate:g}: give recorded seconds per second, above 0")
        if not 0.0 <= self.delay < float("inf"):
            raise UsageError(f"a delay of {self.delay:g}: give seconds, 0 or more")


def play(node: Node, bag: Bag, how: PlayOptions = PlayOptions()) -> int:
    """Publish a recording in time and block until its end; return the number of published messages.

    Topics are offered as they were recorded: latched or transient local, best effort. Of a topic with several
    types the one with most messages is played, as nodes of a graph are connected by one type.

    Raises:
        UsageError: a requested topic was not recorded or cannot be decoded.
    """
    publishers = _advertise(node, bag, how)
    clock = node.advertise(CLOCK, "rosgraph_msgs/msg/Clock", QoS(1)) if how.clock else None
    while how.wait_for_subscribers and not all(publisher.subscribers() for publisher in publishers.values()):
        node.sleep(_LOOK_PERIOD)
    node.sleep(from_seconds(how.delay))
    played = _pass(node, bag, how, publishers, clock)
    while how.loop and not node.closed:
        played += _pass(node, bag, how, publishers, clock)
    node.sleep(from_seconds(how.delay))
    return played


def _pass(
    node: Node, bag: Bag, how: PlayOptions, publishers: Mapping[str, Publisher], clock: Publisher | None
) -> int:
    """Publish a recording once, from now on; return the number of messages."""
    begin = bag.start + from_seconds(how.after)
    started = node.now()
    ticked: Ns = begin - _CLOCK_PERIOD
    played = 0
    for recorded in bag.messages(list(publishers)):
        publisher = publishers[recorded.topic]
        if recorded.at < begin or recorded.message.__msgtype__ != publisher.type:
            continue
        while clock is not None and ticked + _CLOCK_PERIOD <= recorded.at:
            ticked += _CLOCK_PERIOD
            _wait(node, started, ticked - begin, how.rate)
            clock.publish(_clock(ticked))
        _wait(node, started, recorded.at - begin, how.rate)
        if how.restamped:
            _move_stamps(recorded.message, started + round((recorded.at - begin) / how.rate) - recorded.at)
        publisher.publish(recorded.message)
        played += 1
        how.on_message(played, recorded.at)
    return played


_HEADER = "std_msgs/msg/Header"


def _move_stamps(value: Any, by: Ns) -> None:
    """Add *by* to the stamps of all headers in a message; one that is 0 states no time and stays."""
    if isinstance(value, RosMessage) and value.__msgtype__ == _HEADER:
        header: Any = value
        stamp = header.stamp
        at = stamp.sec * S + stamp.nanosec
        if at:
            stamp.sec, stamp.nanosec = divmod(max(at + by, 0), S)
    elif isinstance(value, RosMessage):
        for name in value.__match_args__:
            _move_stamps(getattr(value, name), by)
    elif isinstance(value, list) and value and isinstance(value[0], RosMessage):
        for each in value:
            _move_stamps(each, by)


def check_topics(bag: Bag, how: PlayOptions) -> None:
    """Raise ``UsageError`` if a topic that is to be played was not recorded, or cannot be decoded."""
    there = [topic.name for topic in bag.topics]
    for name in how.topics or ():
        if name in bag.omitted and name not in there:
            raise UsageError(bag.omission([name]))
        if name not in there:
            hint = did_you_mean(name, there)
            raise UsageError(f"{bag.path} has no topic {name!r}{hint}; it has {choices(there)}")
        if name in bag.unreadable and name not in bag.usual:
            raise UsageError(f"{bag.path}: {name} cannot be played: {bag.unreadable[name]}")


def _advertise(node: Node, bag: Bag, how: PlayOptions) -> dict[str, Publisher]:
    check_topics(bag, how)
    wanted = set(bag.usual if how.topics is None else how.topics)
    if how.clock:
        wanted -= {CLOCK}
    made = {}
    for name in sorted(wanted):
        connections = [
            connection
            for connection in bag.connections
            if connection.source.topic == name and not connection.problem
        ]
        counts: dict[str, int] = {}
        for one in connections:
            counts[one.source.type] = counts.get(one.source.type, 0) + one.messages
        kind = max(counts, key=lambda one: counts[one])
        others = [count for count in counts if count != kind]
        if others:
            bag.note(f"{name} has several types; {kind} is played, {', '.join(others)} is not")
        played = [connection for connection in connections if connection.source.type == kind]
        made[name] = node.advertise(name, kind, _offered(name, played))
    return made


def _offered(name: str, connections: Collection[BagConnection]) -> QoS:
    """Return the QoS of a topic as it was recorded."""
    profiles = [profile for connection in connections for profile in connection.source.offer.qos]
    unreliable = bool(profiles) and all(profile.reliability.name == "BEST_EFFORT" for profile in profiles)
    reliability = BEST_EFFORT if unreliable else RELIABLE
    latched = [connection for connection in connections if connection.source.offer.latched]
    if latched or (name in _LATCHED and not profiles):
        depth = max(len(latched), 1, *(profile.depth for profile in profiles))
        return QoS(depth, reliability, TRANSIENT_LOCAL)
    return QoS(_DEPTH, reliability, VOLATILE)


def _wait(node: Node, started: Ns, elapsed: Ns, rate: float) -> None:
    left = started + round(elapsed / rate) - node.now()
    if left > 0:
        node.sleep(left)


def _clock(at: Ns) -> object:
    seconds, rest = divmod(at, S)
    return new("rosgraph_msgs/msg/Clock", clock=new("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest))
