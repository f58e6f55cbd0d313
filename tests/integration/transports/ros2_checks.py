"""Run in an environment with rclpy: all checks of transports, then faults; prints what was found as JSON."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import S
from volery.kernel.wall import WallKernel
from volery.ros.graph import LATCHED, QoS
from volery.ros.graph.interface import BEST_EFFORT, TRANSIENT_LOCAL
from volery.ros.graph.rosbag import Recorder
from volery.ros.messages import new, request, service
from volery.ros.messages.bags import create_bag, open_bag
from volery.ros.transports.ros2 import carried, ros2_graph
from volery.ros.transports.ros2.rclpy_types import rclpy_class
from volery.testing.checks import demand, raising
from volery.testing.transport_conformance import ROS2, Site, no_fault, run_checks
from volery.testing.transport_site import LIMIT
from volery.trace.events import Text

STRING = "std_msgs/msg/String"
RANGE = "sensor_msgs/msg/Range"
STATE, SET_MODE = "mavros_msgs/msg/State", "mavros_msgs/srv/SetMode"


@contextmanager
def surroundings(**changed: str) -> Iterator[None]:
    """These variables of the environment for a while."""
    before = {name: os.environ.get(name) for name in changed}
    os.environ.update(changed)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def a_type_without_support(site: Site, texts: list[str]) -> None:
    """It is carried as bytes, and its services are; where that cannot be, it is said what is missing."""
    node, other = site.node("node"), site.spinning(site.node("other"))
    with TemporaryDirectory() as nothing, surroundings(CXX="no-compiler", XDG_CACHE_HOME=nothing):
        with raising(UsageError, naming="mavros_msgs") as caught:
            node.advertise("state", STATE)
        words = ("no type support", "colcon", "no C++ compiler")
        demand(all(one in caught.text for one in words), caught.text)
    heard: list[str] = []
    other.subscribe("state", STATE, lambda one: heard.append(one.mode))
    publisher = node.advertise("state", STATE, LATCHED)
    publisher.publish(new(STATE, mode="GUIDED"))
    site.until(other, lambda: heard == ["GUIDED"], "it hears the mode")
    kind = service(SET_MODE)
    node.serve("set_mode", SET_MODE, lambda asked: kind.response(asked.custom_mode == "LAND"))
    site.spinning(node)
    client = other.client("set_mode", SET_MODE)
    demand(client.wait(LIMIT), "it is served")
    demand(client.call(request(SET_MODE, custom_mode="LAND"), LIMIT).mode_sent, "it is answered")


def a_type_with_other_fields(site: Site, texts: list[str]) -> None:
    """A class of rclpy that is not that of the distribution, as of a workspace with a changed package."""
    from geometry_msgs.msg import Pose2D

    cls: Any = Pose2D
    given = cls.get_fields_and_field_types
    cls.get_fields_and_field_types = classmethod(lambda cls: {**given(), "height": "double"})
    rclpy_class.cache_clear()  # an earlier check has exchanged it
    try:
        with raising(UsageError, naming="geometry_msgs/msg/Pose2D") as caught:
            site.node("node").advertise("pose", "geometry_msgs/msg/Pose2D")
    finally:
        cls.get_fields_and_field_types = given
    demand("height" in caught.text and "definitions of" in caught.text, caught.text)


def fields_of_this_distribution(site: Site, texts: list[str]) -> None:
    """A range finder's message has a variance since Iron; it is exchanged and recorded with it."""
    node, other = site.node("node"), site.spinning(site.node("other"))
    heard: list[Any] = []
    other.subscribe("range", RANGE, heard.append)
    publisher = node.advertise("range", RANGE, QoS(1, BEST_EFFORT, TRANSIENT_LOCAL))
    site.until(node, publisher.subscribers, "they connect")
    kernel = site.graph.kernel
    with TemporaryDirectory() as folder:
        path = Path(folder) / "bag"
        with create_bag(path) as writer:
            recorder = Recorder(site.graph, site.node("recorder"), writer, topics=[publisher.topic])
            kernel.call_at(kernel.now() + 2 * S, lambda: publish(publisher))
            kernel.call_at(kernel.now() + 4 * S, recorder.stop)
            recorder.run()
        demand(not recorder.problems, str(recorder.problems))
        bag = open_bag(path)
        (read,) = bag.messages()
        (profile,) = bag.connections[0].source.offer.qos
    demand(read.message.variance == 0.25, str(read))
    offered = profile.reliability.name, profile.durability.name, bag.connections[0].source.offer.latched
    demand(offered == ("BEST_EFFORT", "TRANSIENT_LOCAL", True), str(offered))
    demand([one.variance for one in heard] == [0.25], str(heard))


def publish(publisher: Any) -> None:
    publisher.publish(new(RANGE, range=1.5, variance=0.25))


def a_flood(site: Site, texts: list[str]) -> None:
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[str] = []
    kept = QoS(depth=10)
    subscription: Any = listener.subscribe("chat", STRING, lambda one: heard.append(one.data), kept)
    publisher = speaker.advertise("chat", STRING, kept)
    site.until(speaker, publisher.subscribers, "they connect")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    block = "x" * 10_000
    for _ in range(5_000):
        publisher.publish(new(STRING, data=block))
    publisher.publish(new(STRING, data="end"))
    site.until(speaker, lambda: b"end" in subscription._queue[-1].data, "the last has come")
    demand(len(subscription._queue) <= 10, f"{len(subscription._queue)} messages wait")
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    demand(grown < 60, f"memory has grown by {grown:.0f} MB")
    site.spin_until(listener, lambda: heard[-1:] == ["end"], "the newest are heard")


def a_message_that_is_none(site: Site, texts: list[str]) -> None:
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[Any] = []
    subscription: Any = listener.subscribe("imu", "sensor_msgs/msg/Imu", heard.append)
    publisher: Any = speaker.advertise("imu", "sensor_msgs/msg/Imu")
    site.until(speaker, publisher.subscribers, "they connect")
    for data in (b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 20):
        publisher._publisher.send(data)
    publisher.publish(new("sensor_msgs/msg/Imu"))
    site.spin_until(listener, lambda: heard, "the good one arrives")
    demand(subscription.garbled == 2, f"{subscription.garbled} of 2 were found out")
    told = [text for text in texts if "/imu" in text and "dropped" in text]
    demand(len(told) == 2, f"told {told}")


@contextmanager
def stranger(what: str, topic: str) -> Iterator[Any]:
    """Plain rclpy in a process of its own that does what it should not."""
    program = str(Path(__file__).with_name("rclpy_stranger.py"))
    process = subprocess.Popen([sys.executable, program, what, topic], stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def a_subscriber_that_never_reads(site: Site, texts: list[str]) -> None:
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[str] = []
    listener.subscribe("chat", STRING, lambda one: heard.append(one.data[:3]))
    publisher = speaker.advertise("chat", STRING)
    with stranger("deaf", publisher.topic) as process:
        site.until(speaker, lambda: publisher.subscribers() == 2, "both connect")
        demand(process.stdout.readline() == "deaf\n", "it did not get so far")
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        for _ in range(2_000):
            publisher.publish(new(STRING, data="x" * 10_000))
        publisher.publish(new(STRING, data="end"))
        site.spin_until(listener, lambda: heard[-1:] == ["end"], "who reads hears the last")
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
        demand(grown < 60, f"memory has grown by {grown:.0f} MB")


def another_type_on_our_topic(site: Site, texts: list[str]) -> None:
    listener = site.node("listener")
    heard: list[Any] = []
    subscription: Any = listener.subscribe("chat", STRING, heard.append)
    with stranger("numbers", subscription.topic):
        site.until(listener, lambda: any("std_msgs/msg/Int32" in one for one in texts), "the warning arrives")
    told = next(one for one in texts if "std_msgs/msg/Int32" in one)
    demand(f"{subscription.topic} carries several types" in told and "Int32 of /stranger" in told, told)
    demand(not heard, f"heard {heard}")


def a_thousand_topics(site: Site, texts: list[str]) -> None:
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[str] = []
    publishers = [speaker.advertise(f"t{number}", STRING) for number in range(500)]
    for number in range(500):
        listener.subscribe(f"t{number}", STRING, lambda one: heard.append(one.data))
    site.until(speaker, lambda: all(one.subscribers() for one in publishers), "all connect", 300 * S)
    for number, publisher in enumerate(publishers):
        publisher.publish(new(STRING, data=str(number)))
    site.spin_until(listener, lambda: len(heard) == 500, "all are heard")


def a_node_that_cannot_be_destroyed(site: Site, texts: list[str]) -> None:
    """Whatever rclpy waits for in it, our node has left, and others come and go."""
    node, goes_on = site.node("stuck"), threading.Event()
    of_rclpy: Any = node.library._node  # type: ignore[attr-defined]
    destroy = of_rclpy.destroy_node
    of_rclpy.destroy_node = lambda: goes_on.wait() and destroy()
    node.close()
    demand(node.closed, "it is closed")
    site.node("next").close()
    goes_on.set()


def a_part_that_cannot_be_taken(site: Site, texts: list[str]) -> None:
    """Where rclpy fails to take one part of a node, the others go on, and it is said."""
    speaker, listener = site.node("speaker"), site.spinning(site.node("listener"))
    heard: list[str] = []
    broken: Any = listener.subscribe("broken", STRING, lambda one: None)

    def fail() -> None:
        raise RuntimeError("not to be taken")

    for handler in broken.subscription._subscription.event_handlers:
        handler.take_data = fail
    listener.subscribe("chat", STRING, lambda one: heard.append(one.data))
    speaker.advertise("broken", STRING)
    site.until(speaker, lambda: any("not to be taken" in one for one in texts), "it is said")
    publisher = speaker.advertise("chat", STRING)
    site.until(speaker, publisher.subscribers, "they connect")
    publisher.publish(new(STRING, data="still here"))
    site.until(speaker, lambda: heard == ["still here"], "the other topic is heard")
    kind = service(SET_MODE)
    speaker.serve("set_mode", SET_MODE, lambda asked: kind.response(True))
    site.spinning(speaker)
    client = listener.client("set_mode", SET_MODE)
    demand(client.wait(LIMIT), "it is served")
    demand(client.call(request(SET_MODE, custom_mode="LAND"), LIMIT).mode_sent, "its calls are answered")


FAULTS = (
    a_type_without_support,
    a_type_with_other_fields,
    fields_of_this_distribution,
    a_flood,
    a_message_that_is_none,
    a_subscriber_that_never_reads,
    another_type_on_our_topic,
    a_thousand_topics,
    a_part_that_cannot_be_taken,
    a_node_that_cannot_be_destroyed,
)


def main() -> None:
    texts: list[str] = []
    kernel = WallKernel(lambda event: texts.append(event.text) if isinstance(event, Text) else None)
    with kernel.adopt("checks"):
        graph = ros2_graph(kernel)
        found = run_checks(graph, replace(ROS2, carries=carried))
        for body in FAULTS:
            name = body.__name__.replace("_", "-")
            with no_fault(name) as faults, Site(graph, f"fault-{name}", ROS2) as site:
                body(site, texts)
            found[f"fault-{name}"] = "; ".join(faults)
        graph.close()
    found["the-end"] = ", ".join(kernel.close())
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
