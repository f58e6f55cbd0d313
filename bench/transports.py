"""From publish to callback on the embedded graph, and on real ROS 1 and ROS 2, on this machine in one run.

The same functions talk and listen everywhere: on the embedded graph as components that import our ``rospy``
and ``rclpy``, on real ROS as two processes that import the real ones. Latency is the wall's time from just
before ``publish`` to the begin of the callback, one message at a time; throughput is how many of a burst are
received a second; CPU is what a message of the burst takes of both processes' time, which a busy machine
disturbs least. Medians over rounds that take turns. What is not installed is left out, and said.

    python bench/transports.py [--quick]
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.base.time import S
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.client_libraries.importable_modules import importable_modules
from volery.ros.graph import EmbeddedGraph
from volery.ros.messages import message_class
from volery.ros.transports.ros1 import Roscore, available

SPACING_S = 0.005
TIMEOUT_S = 120
DISTRIBUTIONS = ("jazzy", "kilted")


class Taken(NamedTuple):
    """Median latency in us; messages received per second; us of CPU time per message."""

    latency: float
    throughput: float
    cpu: float


@dataclass
class Received:
    """What a listener notes: seconds from publish to callback, a burst's times of arrival, its CPU time."""

    latencies: list[float] = field(default_factory=list)
    burst: list[float] = field(default_factory=list)
    begun: float = 0.0
    cpu: float = 0.0
    ended: bool = False

    def add(self, message: Any) -> None:
        now, sent, phase = perf_counter(), message.pose.position.x, message.header.frame_id
        if phase == "single":
            self.latencies.append(now - sent)
        elif phase == "burst":
            if not self.burst:
                self.begun, self.cpu = sent, -process_time()
            self.burst.append(now)
        elif phase == "end":
            self.cpu += process_time()
            self.ended = True

    def result(self, cpu: float) -> Taken:
        """*cpu*: seconds that the burst took of all processes."""
        received, lasted = len(self.burst), self.burst[-1] - self.begun
        return Taken(median(self.latencies) * 1e6, received / lasted, cpu / received * 1e6)


def talk(
    pose: Any,
    publish: Callable[[Any], None],
    listeners: Callable[[], int],
    pause: Callable[[float], None],
    count: int,
) -> float:
    """Singles, a burst, and the end, while there is a subscriber; gives the CPU seconds of the burst."""
    while not listeners():
        pause(0.05)
    pause(0.5)
    used = {}
    for phase, gap in (("single", SPACING_S), ("burst", 0.0), ("end", 0.0)):
        pose.header.frame_id = phase
        before = process_time()
        for _ in range({"single": count // 20, "burst": count, "end": 1}[phase]):
            pose.pose.position.x = perf_counter()
            publish(pose)
            if gap:
                pause(gap)
        pause(1.0)
        used[phase] = process_time() - before
    while listeners():
        pause(0.05)
    return used["burst"]


def rospy_talker(rospy: Any, kind: Any, count: int) -> float:
    rospy.init_node("talker", disable_signals=True)
    publisher = rospy.Publisher("pose", kind, queue_size=count)
    return talk(kind(), publisher.publish, publisher.get_num_connections, rospy.sleep, count)


def rospy_listener(rospy: Any, kind: Any, received: Received, count: int) -> None:
    rospy.init_node("listener", disable_signals=True)
    subscriber = rospy.Subscriber("pose", kind, received.add, queue_size=count, tcp_nodelay=True)
    while not received.ended:
        rospy.sleep(0.05)
    subscriber.unregister()


def rclpy_talker(rclpy: Any, kind: Any, count: int) -> float:
    rclpy.init()
    node = rclpy.create_node("talker")
    publisher = node.create_publisher(kind, "pose", count)
    clock = node.get_clock()

    def pause(seconds: float) -> None:
        clock.sleep_for(rclpy.duration.Duration(seconds=seconds))

    return talk(kind(), publisher.publish, publisher.get_subscription_count, pause, count)


def rclpy_listener(rclpy: Any, kind: Any, received: Received, count: int) -> None:
    rclpy.init()
    node = rclpy.create_node("listener")
    node.create_subscription(kind, "pose", received.add, count)
    while not received.ended:
        rclpy.spin_once(node, timeout_sec=0.5)
    node.destroy_node()


TALKERS: Mapping[str, Any] = {"rospy": rospy_talker, "rclpy": rclpy_talker}
LISTENERS: Mapping[str, Any] = {"rospy": rospy_listener, "rclpy": rclpy_listener}


def embedded(library: str, recorded: bool, count: int) -> Taken:
    """Both as components of one run in virtual time, so that the talker's CPU time is that of both."""
    kernel = VirtualKernel()
    graph = EmbeddedGraph(kernel, unrecorded=not recorded)
    module = importable_modules(graph)[library]
    kind, received = message_class("geometry_msgs/msg/PoseStamped"), Received()
    kernel.spawn(
        lambda: LISTENERS[library](module, kind, received, count),
        "listener",
        ExecutionContext("listener"),
    )
    used: list[float] = []
    kernel.spawn(
        lambda: used.append(TALKERS[library](module, kind, count)),
        "talker",
        ExecutionContext("talker"),
    )
    kernel.call_at(TIMEOUT_S * S + 1, lambda: None)  # the listener's threads wait for ever: no deadlock
    kernel.run(TIMEOUT_S * S)
    return received.result(used[0])


def peer(library: str, role: str, count: int) -> None:
    """One of the two processes on real ROS; each prints its CPU time, the listener all that it has found."""
    real = importlib.import_module(library)
    kind = importlib.import_module("geometry_msgs.msg").PoseStamped
    if role == "talker":
        print(TALKERS[library](real, kind, count), flush=True)
    else:
        received = Received()
        LISTENERS[library](real, kind, received, count)
        print(json.dumps(received.result(received.cpu)), flush=True)
    os._exit(0)  # the libraries' own ends take seconds and are not measured


def real_ros(python: str, library: str, surroundings: Mapping[str, str], count: int) -> Taken:
    """Two processes that import the real library."""
    asked = [python, __file__, "--count", str(count), "--library", library, "--role"]
    with ExitStack() as stack:
        processes = {}
        for role in ("listener", "talker"):
            started = subprocess.Popen([*asked, role], env=surroundings, stdout=subprocess.PIPE, text=True)
            processes[role] = stack.enter_context(started)
            stack.callback(started.kill)
        listened = Taken(*json.loads(processes["listener"].communicate(timeout=TIMEOUT_S)[0]))
        talking = float(processes["talker"].communicate(timeout=TIMEOUT_S)[0])
    return listened._replace(cpu=listened.cpu + talking / count * 1e6)


Measure = Callable[[], Taken]


def ros1(stack: ExitStack, count: int) -> dict[str, Measure]:
    if not available():
        print("no rospy here: scripts/debian-packages ros1, scripts/ros1-modules .venv")
        return {}
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        uri = f"http://127.0.0.1:{free.getsockname()[1]}"
    try:
        stack.enter_context(Roscore(uri))
    except UsageError as error:
        print(error)
        return {}
    surroundings = {**os.environ, "ROS_MASTER_URI": uri, "ROS_IP": "127.0.0.1"}
    return {"rospy": lambda: real_ros(sys.executable, "rospy", surroundings, count)}


def ros2(count: int) -> dict[str, Measure]:
    found: dict[str, Measure] = {}
    surroundings = {
        **{key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")},
        "ROS_DOMAIN_ID": str(20 + os.getpid() % 200),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }
    for distribution in DISTRIBUTIONS:
        python = Path(sys.prefix) / f"ros2-{distribution}" / "bin" / "python"
        if python.exists():
            found[f"rclpy ({distribution})"] = lambda python=python: real_ros(
                str(python), "rclpy", surroundings, count
            )
        else:
            print(f"no ROS 2 {distribution} here: scripts/ros2-venv {sys.prefix} {distribution}")
    return found


def show(taken: Mapping[str, list[Taken]]) -> None:
    print(f"{'':<28}{'latency':>11}{'':>8}{'throughput':>14}{'':>8}{'CPU':>12}")
    for name, values in taken.items():
        library = name.split()[-1] if name.startswith("embedded") else name.partition(" ")[0]
        base = Taken(*map(median, zip(*taken[f"embedded, {library}"], strict=True)))
        here = Taken(*map(median, zip(*values, strict=True)))
        print(
            f"{name:<28}{here.latency:>8.1f} us{here.latency / base.latency:>6.1f} x"
            f"{here.throughput:>10.0f} 1/s{base.throughput / here.throughput:>6.1f} x"
            f"{here.cpu:>9.1f} us{here.cpu / base.cpu:>6.1f} x"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer messages and rounds")
    parser.add_argument("--library", help=argparse.SUPPRESS)
    parser.add_argument("--role", help=argparse.SUPPRESS)
    parser.add_argument("--count", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.role:
        peer(given.library, given.role, given.count)
    count, rounds = (2_000, 1) if given.quick else (10_000, 5)
    with ExitStack() as stack:
        what: dict[str, Measure] = {
            "embedded, rospy": lambda: embedded("rospy", False, count),
            "embedded, recorded, rospy": lambda: embedded("rospy", True, count),
            "embedded, rclpy": lambda: embedded("rclpy", False, count),
            "embedded, recorded, rclpy": lambda: embedded("rclpy", True, count),
            **ros1(stack, count),
            **ros2(count),
        }
        taken: dict[str, list[Taken]] = {name: [] for name in what}
        for _ in range(rounds):
            for name, measure in what.items():
                taken[name].append(measure())
    show(taken)


if __name__ == "__main__":
    main()
