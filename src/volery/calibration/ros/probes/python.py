"""What calls of rospy or rclpy cost this process.

A program of its own, run by whichever Python has the client library: it needs that and nothing of volery's.
Arguments and output are those of ``roscpp.cpp``, behind the name of the library.
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
"""Messages are rarer than cycles."""
HALF_S = 0.5
NODE, DEPTH = "calibration_probe", 10

heard = [0]


def hear(message: Any) -> None:
    """The callback of every subscription."""
    heard[0] += 1


class Ends(NamedTuple):
    """A publisher or a subscription: what it does, to how many it is connected, how it is closed."""

    publish: Callable[[], Any]
    peers: Callable[[], int]
    close: Callable[[], Any]


class Client(Protocol):
    """What a probe asks of a client library. ``spin_once`` is ``None`` where the library has none."""

    @property
    def spin_once(self) -> Callable[[], Any] | None: ...  # noqa: D102 - each is the library's own
    def init(self) -> None: ...  # noqa: D102
    def node_handle(self) -> None: ...  # noqa: D102
    def advertise(self, topic: str) -> Ends: ...  # noqa: D102
    def subscribe(self, topic: str) -> Ends: ...  # noqa: D102
    def service_client(self) -> object: ...  # noqa: D102
    def advertise_service(self) -> object: ...  # noqa: D102
    def sleeper(self, seconds: float) -> Callable[[], Any]: ...  # noqa: D102
    def wait(self, seconds: float) -> None: ...  # noqa: D102


class Rospy:
    """rospy: its node begins with ``init_node``, its callbacks run in threads of their own."""

    spin_once = None

    def __init__(self) -> None:
        self._rospy = import_module("rospy")
        self._type: Any = import_module("std_msgs.msg").Float64MultiArray
        self._service: Any = import_module("std_srvs.srv").Trigger

    def init(self) -> None:
        """Join."""
        self._rospy.init_node(NODE)

    def node_handle(self) -> None:
        """Nothing: ``init_node`` has done it."""

    def advertise(self, topic: str) -> Ends:
        """A publisher whose ``publish`` returns before the message is sent."""
        made = self._rospy.Publisher(topic, self._type, queue_size=DEPTH)
        message = self._type(data=[0.0] * 4)
        return Ends(lambda: made.publish(message), made.get_num_connections, made.unregister)

    def subscribe(self, topic: str) -> Ends:
        """A subscription."""
        made = self._rospy.Subscriber(topic, self._type, hear, queue_size=DEPTH)
        return Ends(lambda: None, made.get_num_connections, made.unregister)

    def service_client(self) -> object:
        """A proxy of a service."""
        return self._rospy.ServiceProxy("calibration/nobody", self._service)

    def advertise_service(self) -> object:
        """A service."""
        return self._rospy.Service("calibration/service", self._service, lambda request: None)

    def sleeper(self, seconds: float) -> Callable[[], Any]:
        """``Rate.sleep``."""
        sleep: Callable[[], Any] = self._rospy.Rate(1.0 / seconds).sleep
        return sleep

    def wait(self, seconds: float) -> None:
        """As ``rospy.spin`` does it: half seconds of sleep."""
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
        """Begin a context."""
        self._rclpy.init()

    def node_handle(self) -> None:
        """Make the node."""
        self._node = self._rclpy.create_node(NODE)

    def advertise(self, topic: str) -> Ends:
        """A reliable publisher."""
        made = self._node.create_publisher(self._type, topic, DEPTH)
        message = self._type(data=[0.0] * 4)
        return Ends(
            lambda: made.publish(message),
            made.get_subscription_count,
            lambda: self._node.destroy_publisher(made),
        )

    def subscribe(self, topic: str) -> Ends:
        """A reliable subscription."""
        made = self._node.create_subscription(self._type, topic, hear, DEPTH)
        peers = lambda: self._node.count_publishers(topic)  # noqa: E731 - one of three that belong together
        return Ends(lambda: None, peers, lambda: self._node.destroy_subscription(made))

    def service_client(self) -> object:
        """A client."""
        made: object = self._node.create_client(self._service, "calibration/nobody")
        return made

    def advertise_service(self) -> object:
        """A service."""
        made: object = self._node.create_service(
            self._service, "calibration/service", lambda request, response: response
        )
        return made

    def sleeper(self, seconds: float) -> Callable[[], Any]:
        """``Clock.sleep_for``."""
        clock, duration = self._node.get_clock(), self._duration(seconds=seconds)
        return lambda: clock.sleep_for(duration)

    def spin_once(self) -> None:
        """Run what is ready."""
        self._rclpy.spin_once(self._node, timeout_sec=0.0)

    def wait(self, seconds: float) -> None:
        """As ``rclpy.spin`` does it."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._rclpy.spin_once(self._node, timeout_sec=left)


CLIENTS: dict[str, Callable[[], Client]] = {"rospy": Rospy, "rclpy": Rclpy}


class Measured:
    """What passes between its making and ``tell``."""

    def __init__(self) -> None:
        self._start = _clocks()

    def tell(self, what: str, x: float, cycles: int) -> None:
        """Print it."""
        waited, process, caller = (now - then for now, then in zip(_clocks(), self._start, strict=True))
        told = {"what": what, "x": x, "cycles": cycles, "waited_ns": waited}
        sys.stdout.write(json.dumps({**told, "process_ns": process, "caller_ns": caller}) + "\n")
        sys.stdout.flush()


def _clocks() -> tuple[int, int, int]:
    return time.monotonic_ns(), time.process_time_ns(), time.thread_time_ns()


def nothing() -> None:
    """An idle cycle's call."""


def once(what: str, call: Callable[[], Any], done: Callable[[], bool] = lambda: True, x: float = 0) -> None:
    """One call, and what it makes the library do shortly after."""
    measured = Measured()
    call()
    _until(done)
    time.sleep(SETTLE_S)
    measured.tell(what, x, 1)


def _until(done: Callable[[], bool]) -> None:
    end = time.monotonic() + CONNECT_S
    while not done() and time.monotonic() < end:
        time.sleep(GLANCE_S)


class Probe:
    """One pass through everything that is measured."""

    def __init__(self, client: Client, block_s: float, period_s: float) -> None:
        self._client = client
        self._block_s, self._period_s = block_s, period_s
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
        measured.tell(what, x, cycles)

    def joining(self) -> None:
        """A node begins."""
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
        once("advertise", lambda: keep(client.advertise("calibration/unheard")))
        once("subscribe", lambda: keep(client.subscribe("calibration/unsaid")))
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
            measured.tell("spin_once_first", 0, 1)

    def sleeping(self, times_ms: list[float]) -> None:
        """Idle cycles of several lengths."""
        for ms in times_ms:
            self._block("sleep", ms * 1000.0, ms / 1000.0, nothing)

    def publishing(self, counts: list[float]) -> None:
        """Whole cycles and idle cycles, to so many subscribers."""
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
            self._block("idle", 0, self._period_s, nothing)
            self._block("publish", count, self._period_s, made[0].publish)
            made[0].close()
            time.sleep(SETTLE_S)

    def spinning(self) -> None:
        """Cycles that publish once, twice, and twice with a spin: who comes next finds the library awake."""
        first = self._client.advertise("calibration/to_1")
        other = self._client.advertise("calibration/to_2")
        _until(lambda: first.peers() > 0 and other.peers() > 1)
        time.sleep(SETTLE_S)
        self._block("publish_alone", 0, self._period_s, first.publish)
        self._block("publish_both", 2, self._period_s, lambda: (first.publish(), other.publish()))
        spin = self._client.spin_once
        if spin is not None:
            both = (first.publish, other.publish, spin)
            self._block("spin_once", 0, self._period_s, lambda: [call() for call in both])
        first.close()
        other.close()

    def receiving(self) -> None:
        """Waiting for messages where none come and where some do."""
        wait = self._client.wait
        time.sleep(SETTLE_S)
        measured = Measured()
        wait(SPIN_BLOCKS * self._block_s)
        measured.tell("wait", 0, 1)
        feed = self._client.subscribe("calibration/feed")
        none = heard[0]
        _until(lambda: (wait(GLANCE_S), heard[0] > none)[1])
        wait(SETTLE_S)
        before = heard[0]
        measured = Measured()
        wait(SPIN_BLOCKS * self._block_s)
        measured.tell("receive", 0, max(1, heard[0] - before))
        feed.close()


def _numbers(text: str) -> list[float]:
    return [float(one) for one in text.split(",")]


def main(library: str, block_ms: str, period_ms: str, sleeps: str, counts: str) -> None:
    """All of it, in the order of ``roscpp.cpp``."""
    probe = Probe(CLIENTS[library](), float(block_ms) / 1000.0, float(period_ms) / 1000.0)
    probe.joining()
    probe.registrations()
    probe.sleeping(_numbers(sleeps))
    probe.publishing(_numbers(counts))
    probe.spinning()
    probe.receiving()
    probe.receiving()


if __name__ == "__main__":
    main(*sys.argv[1:])
