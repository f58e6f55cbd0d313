"""Probe of rospy or rclpy: CPU time of calls into the client library.

A program of its own for the Python that has the client library: it does not import volery. Its arguments are
the name of the library and those of ``roscpp.cpp``; its output is that of ``roscpp.cpp``.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple, Protocol

CONNECT_S, SETTLE_S, GLANCE_S = 10.0, 0.1, 0.05
SPIN_BLOCKS = 2.5
"""Blocks of waiting and of receiving every 50 ms, which are longer since messages are rarer than cycles."""
FEEDS_MS, FEED_TOPICS = (50, 20), 5
"""Periods of the peers' topics, and how many of each are published at once."""
HALF_S = 0.5
FEW, MANY = 2.0, 8.0
"""Subscribers of topics that are published just after another."""
FOLLOWING = 4
"""Topics that are published just after another: more than one, for a difference above the noise."""
NODE, DEPTH = "calibration_probe", 10

received = [0]


def on_message(message: Any) -> None:
    """Count a message of any subscription, or a request."""
    received[0] += 1


class Ends(NamedTuple):
    """A publisher or a subscription: functions that publish, count its peers and close it."""

    publish: Callable[[], Any]
    peers: Callable[[], int]
    close: Callable[[], Any]


class Client(Protocol):
    """Calls into a client library that are measured."""

    @property
    def spin_once(self) -> Callable[[], Any] | None:
        """Return the call that executes one callback, or None where the library has none."""

    def init(self) -> None:
        """Register with the library, as a program does at its start."""

    def node_handle(self) -> None:
        """Create the node, where that is a step of its own."""

    def advertise(self, topic: str) -> Ends:
        """Create a publisher of a short array of numbers."""

    def subscribe(self, topic: str) -> Ends:
        """Create a subscription whose callback counts messages."""

    def service_client(self) -> object:
        """Create a client of a service that does not exist."""

    def advertise_service(self) -> object:
        """Create a service that is not called."""

    def caller(self) -> Callable[[], Any]:
        """Return a function that calls the peers' service and waits for the response."""

    def serve(self) -> Callable[[], Any]:
        """Serve the peers' requests; return the function that ends it."""

    def sleeper(self, seconds: float) -> Callable[[], Any]:
        """Return a function that sleeps to the end of a period of so many seconds."""

    def wait(self, seconds: float) -> None:
        """Wait in the library's spin for so many seconds."""


class Rospy:
    """rospy: ``init_node`` creates the node, callbacks run in threads of their own."""

    spin_once = None

    def __init__(self) -> None:
        self._rospy = import_module("rospy")
        self._type: Any = import_module("std_msgs.msg").Float64MultiArray
        self._service: Any = import_module("std_srvs.srv").Trigger

    def init(self) -> None:
        """Create the node."""
        self._rospy.init_node(NODE)

    def node_handle(self) -> None:
        """Do nothing: ``init_node`` has created the node."""

    def advertise(self, topic: str) -> Ends:
        """Create a publisher whose ``publish`` returns before the message is sent."""
        publisher = self._rospy.Publisher(topic, self._type, queue_size=DEPTH)
        message = self._type(data=[0.0] * 4)
        return Ends(lambda: publisher.publish(message), publisher.get_num_connections, publisher.unregister)

    def subscribe(self, topic: str) -> Ends:
        """Create a subscription."""
        subscriber = self._rospy.Subscriber(topic, self._type, on_message, queue_size=DEPTH)
        return Ends(lambda: None, subscriber.get_num_connections, subscriber.unregister)

    def service_client(self) -> object:
        """Create a proxy of a service."""
        return self._rospy.ServiceProxy("calibration/absent", self._service)

    def advertise_service(self) -> object:
        """Create a service."""
        return self._rospy.Service("calibration/service", self._service, lambda request: None)

    def caller(self) -> Callable[[], Any]:
        """Return a call of the peers' service, with a connection of its own as is usual."""
        self._rospy.wait_for_service("calibration/served", CONNECT_S)
        call: Callable[[], Any] = self._rospy.ServiceProxy("calibration/served", self._service)
        return call

    def serve(self) -> Callable[[], Any]:
        """Serve the requests of the peers; return what ends it."""
        response = import_module("std_srvs.srv").TriggerResponse

        def answer(request: Any) -> Any:
            on_message(request)
            return response()

        service = self._rospy.Service("calibration/answer", self._service, answer)
        return lambda: service.shutdown("measured")

    def sleeper(self, seconds: float) -> Callable[[], Any]:
        """Return ``Rate.sleep``."""
        sleep: Callable[[], Any] = self._rospy.Rate(1.0 / seconds).sleep
        return sleep

    def wait(self, seconds: float) -> None:
        """Wait as ``rospy.spin`` does: in sleeps of half a second."""
        for _ in range(max(1, round(seconds / HALF_S))):
            self._rospy.rostime.wallsleep(min(seconds, HALF_S))


class Rclpy:
    """rclpy: callbacks run where it is spun."""

    def __init__(self) -> None:
        self._rclpy = import_module("rclpy")
        self._duration: Any = import_module("rclpy.duration").Duration
        self._type: Any = import_module("std_msgs.msg").Float64MultiArray
        self._service: Any = import_module("std_srvs.srv").Trigger
        self._node: Any = None

    def init(self) -> None:
        """Create the context."""
        self._rclpy.init()

    def node_handle(self) -> None:
        """Create the node."""
        self._node = self._rclpy.create_node(NODE)

    def advertise(self, topic: str) -> Ends:
        """Create a reliable publisher."""
        publisher = self._node.create_publisher(self._type, topic, DEPTH)
        message = self._type(data=[0.0] * 4)
        return Ends(
            lambda: publisher.publish(message),
            publisher.get_subscription_count,
            lambda: self._node.destroy_publisher(publisher),
        )

    def subscribe(self, topic: str) -> Ends:
        """Create a reliable subscription."""
        subscription = self._node.create_subscription(self._type, topic, on_message, DEPTH)
        peers = lambda: self._node.count_publishers(topic)  # noqa: E731 - one of three that belong together
        return Ends(lambda: None, peers, lambda: self._node.destroy_subscription(subscription))

    def service_client(self) -> object:
        """Create a client."""
        client: object = self._node.create_client(self._service, "calibration/absent")
        return client

    def advertise_service(self) -> object:
        """Create a service."""
        service: object = self._node.create_service(
            self._service, "calibration/service", lambda request, response: response
        )
        return service

    def caller(self) -> Callable[[], Any]:
        """Return a call of the peers' service that spins until the answer is there."""
        client = self._node.create_client(self._service, "calibration/served")
        client.wait_for_service(CONNECT_S)
        spin = self._rclpy.spin_until_future_complete
        return lambda: spin(self._node, client.call_async(self._service.Request()))

    def serve(self) -> Callable[[], Any]:
        """Serve the requests of the peers; return what ends it."""

        def answer(request: Any, response: Any) -> Any:
            on_message(request)
            return response

        service = self._node.create_service(self._service, "calibration/answer", answer)
        return lambda: self._node.destroy_service(service)

    def sleeper(self, seconds: float) -> Callable[[], Any]:
        """Return ``Clock.sleep_for``."""
        clock, duration = self._node.get_clock(), self._duration(seconds=seconds)
        return lambda: clock.sleep_for(duration)

    def spin_once(self) -> None:
        """Run the callbacks that are ready."""
        self._rclpy.spin_once(self._node, timeout_sec=0.0)

    def wait(self, seconds: float) -> None:
        """Wait as ``rclpy.spin`` does."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._rclpy.spin_once(self._node, timeout_sec=left)


CLIENTS: dict[str, Callable[[], Client]] = {"rospy": Rospy, "rclpy": Rclpy}


class Measured:
    """Readings of the clocks between construction and ``report``."""

    def __init__(self) -> None:
        self._start = _clocks()

    def report(self, what: str, x: float, cycles: int) -> None:
        """Print the differences."""
        waited, process, caller = (now - then for now, then in zip(_clocks(), self._start, strict=True))
        line = {"what": what, "x": x, "cycles": cycles, "waited_ns": waited}
        sys.stdout.write(json.dumps({**line, "process_ns": process, "caller_ns": caller}) + "\n")
        sys.stdout.flush()


def _clocks() -> tuple[int, int, int]:
    return time.monotonic_ns(), time.process_time_ns(), time.thread_time_ns()


def nothing() -> None:
    """Do nothing, as the call of an idle cycle."""


def once(what: str, call: Callable[[], Any], done: Callable[[], bool] = lambda: True, x: float = 0) -> None:
    """Measure one call and the work of the library shortly after it."""
    measured = Measured()
    call()
    _until(done)
    time.sleep(SETTLE_S)
    measured.report(what, x, 1)


def _until(done: Callable[[], bool]) -> None:
    end = time.monotonic() + CONNECT_S
    while not done() and time.monotonic() < end:
        time.sleep(GLANCE_S)


def _connected(first: Ends, others: list[Ends], count: float) -> Callable[[], bool]:
    return lambda: first.peers() > 0 and all(other.peers() >= count for other in others)


def _together(calls: list[Callable[[], Any]]) -> Callable[[], Any]:
    return lambda: [call() for call in calls]


class Probe:
    """One pass through everything that is measured."""

    def __init__(self, client: Client, block_s: float, periods_s: list[float]) -> None:
        self._client = client
        self._block_s, self._periods_s = block_s, periods_s
        self._kept: list[object] = []

    def _block(self, what: str, x: float, period_s: float, call: Callable[[], Any]) -> None:
        """As many cycles of a call and a sleep as fit into a block."""
        cycles = max(3, int(self._block_s / period_s))
        sleep = self._client.sleeper(period_s)
        for _ in range(2):
            call()
            sleep()
        measured = Measured()
        for _ in range(cycles):
            call()
            sleep()
        measured.report(what, x, cycles)

    def joining(self) -> None:
        """Measure the creation of the node."""
        once("nothing", nothing)
        once("init", self._client.init)
        once("node_handle", self._joined)
        once("settle", lambda: time.sleep(5 * SETTLE_S))

    def _joined(self) -> None:
        self._client.node_handle()
        time.sleep(3 * SETTLE_S)  # until it is connected to rosout

    def registrations(self) -> None:
        """Each first call of its kind."""
        client, keep = self._client, self._kept.append
        once("advertise", lambda: keep(client.advertise("calibration/unused")))
        once("subscribe", lambda: keep(client.subscribe("calibration/silent")))
        hearing: list[Ends] = []
        once(
            "connect",
            lambda: hearing.append(client.subscribe("calibration/quiet")),
            lambda: hearing[0].peers() > 0,
        )
        once("service_client", lambda: keep(client.service_client()))
        once("advertise_service", lambda: keep(client.advertise_service()))
        once("settle", nothing)
        if client.spin_once is not None:
            measured = Measured()
            client.spin_once()
            measured.report("spin_once_first", 0, 1)

    def sleeping(self, times_ms: list[float]) -> None:
        """Measure idle cycles of several lengths."""
        for ms in times_ms:
            self._block("sleep", ms * 1000.0, ms / 1000.0, nothing)

    def publishing(self, counts: list[float]) -> None:
        """Measure publishing and idle cycles for several numbers of subscribers."""
        for count in counts:
            made: list[Ends] = []
            once(
                "accept",
                lambda count=count, made=made: made.append(  # type: ignore[misc]  # bound now
                    self._client.advertise(f"calibration/to_{count:.0f}")
                ),
                lambda count=count, made=made: made[0].peers() >= count,  # type: ignore[misc]
                count,
            )
            for period_s in self._periods_s:
                self._block("idle", 0, period_s, nothing)
                self._block("publish", count, period_s, made[0].publish)
            made[0].close()
            time.sleep(SETTLE_S)

    def spinning(self, counts: list[float]) -> None:
        """Measure cycles that publish once, on several topics, and spin: later calls find warm threads."""
        first = self._client.advertise("calibration/to_1")
        spin = self._client.spin_once
        for count in counts:
            others = [
                self._client.advertise(f"calibration/next_{number}_{count:.0f}")
                for number in range(FOLLOWING)
            ]
            _until(_connected(first, others, count))
            time.sleep(SETTLE_S)
            both = [first.publish, *(other.publish for other in others)]
            for period_s in self._periods_s:
                self._block("publish_alone", 0, period_s, first.publish)
                self._block("publish_both", count, period_s, _together(both))
            if spin is not None and count == counts[0]:
                self._block("spin_once", 0, self._periods_s[0], _together([*both, spin]))
            for other in others:
                other.close()
            time.sleep(SETTLE_S)
        first.close()

    def calling(self) -> None:
        """Measure cycles that call a service and idle cycles."""
        call = self._client.caller()
        call()
        self._block("idle_before_call", 0, self._periods_s[0], nothing)
        self._block("call_service", 0, self._periods_s[0], call)

    def serving(self) -> None:
        """Measure waiting with requests."""
        end = self._client.serve()
        self._receive("serve", SPIN_BLOCKS, 1)
        end()

    def receiving(self) -> None:
        """Measure waiting without messages, with those of one topic, and of several published at once."""
        wait = self._client.wait
        time.sleep(SETTLE_S)
        measured = Measured()
        wait(SPIN_BLOCKS * self._block_s)
        measured.report("wait", 0, 1)
        for period_ms in FEEDS_MS:
            blocks = SPIN_BLOCKS * period_ms / FEEDS_MS[0]
            feeds = [self._feed(period_ms, 0)]
            self._receive("receive", blocks, 1)
            feeds += [self._feed(period_ms, number) for number in range(1, FEED_TOPICS)]
            self._receive("receive_burst", blocks, FEED_TOPICS)
            for feed in feeds:
                feed.close()

    def _feed(self, period_ms: int, number: int) -> Ends:
        """Subscribe to one of the peers' topics; return when it is connected."""
        feed = self._client.subscribe(f"calibration/feed_{period_ms}_{number}")
        _until(lambda: feed.peers() > 0)
        return feed

    def _receive(self, what: str, blocks: float, topics: int) -> None:
        """Measure waiting with messages of so many topics."""
        wait, none = self._client.wait, received[0]
        _until(lambda: (wait(GLANCE_S), received[0] > none)[1])
        wait(SETTLE_S)
        before = received[0]
        measured = Measured()
        wait(blocks * self._block_s)
        measured.report(what, topics, max(1, received[0] - before))


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split(",")]


def main(library: str, block_ms: str, periods: str, sleeps: str, counts: str) -> None:
    """Make all measurements in the order of ``roscpp.cpp``."""
    probe = Probe(CLIENTS[library](), float(block_ms) / 1000.0, [ms / 1000.0 for ms in _numbers(periods)])
    probe.joining()
    probe.registrations()
    probe.sleeping(_numbers(sleeps))
    probe.publishing(_numbers(counts))
    probe.spinning([FEW, MANY])
    probe.calling()
    probe.receiving()
    probe.receiving()
    probe.serving()
    probe.serving()


if __name__ == "__main__":
    main(*sys.argv[1:])
