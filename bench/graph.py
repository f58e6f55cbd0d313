"""What a message costs the simulation itself: publish to callback on the embedded graph, and a vehicle node.

Times are CPU time of this machine, medians over rounds that take turns; the ratio is to encoding the same
message to CDR (by rosbags), which recording does anyway. An image of 320 x 240 for 1, 2 and 4 subscribers is
compared with handing over its bytes through queues. Nothing is written to disk.

    python bench/graph.py [--quick]
"""

from __future__ import annotations

import argparse
import tracemalloc
from collections import deque
from collections.abc import Callable
from statistics import median
from time import process_time
from typing import Any

from volery.base.time import MS, S
from volery.bridge import serve_vehicle
from volery.cost import Tariff, load_catalogue
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.ros import messages
from volery.ros.graph import EmbeddedGraph, free
from volery.ros.graph.graph_context import Recorded
from volery.ros.messages.encodings import copied_to_cdr

POSE = "geometry_msgs/msg/PoseStamped"
IMAGE = "sensor_msgs/msg/Image"
PIXELS = bytes(320 * 240 * 3)


def graph_on(kernel: VirtualKernel, priced: bool, recorded: bool) -> EmbeddedGraph:
    tariff = Tariff(load_catalogue().processor("rpi4-cortex-a72").ros_law("roscpp"), 1500)
    tariffs = (lambda node: tariff) if priced else free
    level = Recorded.SHORT if recorded else Recorded.NOTHING
    return EmbeddedGraph(kernel, tariffs, records=lambda topic: level)


def publishing(count: int, priced: bool, recorded: bool, kind: str = POSE, **fields: Any) -> float:
    """Microseconds from publish to the end of the callback, one subscriber."""
    kernel = VirtualKernel()
    graph = graph_on(kernel, priced, recorded)
    place = ExecutionContext("both", Processor(kernel, "cpu", cores=4) if priced else None)
    took = [0.0]

    def both() -> None:
        node = graph.node("both")
        node.subscribe("topic", kind, lambda message: None)
        publisher = node.advertise("topic", kind)
        message = messages.new(kind, **fields)
        start = process_time()
        for _ in range(count):
            publisher.publish(message)
            node.spin_once()
        took[0] = process_time() - start

    kernel.spawn(both, "both", place)
    kernel.run(10**15)
    return took[0] / count * 1e6


def image_to(subscribers: int, count: int) -> float:
    """Microseconds from publishing an image, recorded as in a run, to the end of the last callback."""
    kernel = VirtualKernel()
    graph = graph_on(kernel, priced=False, recorded=True)
    took = [0.0]

    def all_of_them() -> None:
        node = graph.node("all")
        for _ in range(subscribers):
            node.subscribe("image", IMAGE, lambda message: None)
        publisher = node.advertise("image", IMAGE)
        message = messages.new(IMAGE, height=240, width=320, encoding="rgb8", step=960, data=PIXELS)
        start = process_time()
        for _ in range(count):
            publisher.publish(message)
            node.spin_available()
        took[0] = process_time() - start

    kernel.spawn(all_of_them, "all", ExecutionContext("all"))
    kernel.run(10**15)
    return took[0] / count * 1e6


def bytes_to(subscribers: int, count: int) -> float:
    """The same by queues of bytes, without ROS."""
    queues: list[deque[bytes]] = [deque() for _ in range(subscribers)]
    start = process_time()
    for _ in range(count):
        for queue in queues:
            queue.append(PIXELS)
        for queue in queues:
            queue.popleft()
    return (process_time() - start) / count * 1e6


def growth_of_memory(count: int) -> float:
    """Return how many kB more are in use after *count* images than after the first hundred."""
    image_to(2, 100)
    tracemalloc.start()
    image_to(2, 100)
    before, _ = tracemalloc.get_traced_memory()
    image_to(2, count)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return (after - before) / 1e3


def encoding(count: int) -> float:
    """Microseconds to encode the message alone."""
    message = messages.new(POSE)
    start = process_time()
    for _ in range(count):
        copied_to_cdr(message)
    return (process_time() - start) / count * 1e6


def serving(seconds: int) -> float:
    """CPU milliseconds per simulated second of a vehicle node with an autopilot that streams at 10 Hz."""
    kernel = VirtualKernel()
    graph = graph_on(kernel, priced=True, recorded=True)
    ours, theirs = in_process_pair(kernel)

    def say(name: str, **fields: Any) -> None:
        theirs.send(Frame(name, fields, 1, 1))

    def stream() -> None:
        say("GLOBAL_POSITION_INT", hdg=9000)
        say("LOCAL_POSITION_NED")

    def instruments() -> None:
        say("HEARTBEAT", type=2, autopilot=3)
        for name in ("ATTITUDE", "SYS_STATUS", "VFR_HUD", "GPS_RAW_INT", "RAW_IMU", "EXTENDED_SYS_STATE"):
            say(name)

    kernel.every(100 * MS, stream)
    kernel.every(S, instruments)
    serve_vehicle(graph, ours, "drone_1", ExecutionContext("mavros", Processor(kernel, "cpu", cores=4)))
    kernel.run(5 * S)
    start = process_time()
    kernel.run(kernel.now() + seconds * S)
    return (process_time() - start) / seconds * 1e3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer rounds")
    quick = parser.parse_args().quick
    count, rounds = (2_000, 3) if quick else (10_000, 7)
    what: dict[str, Callable[[], float]] = {
        "encode to CDR alone": lambda: encoding(count),
        "publish to callback": lambda: publishing(count, priced=False, recorded=False),
        "publish to callback, Twist": lambda: publishing(count, False, False, "geometry_msgs/msg/Twist"),
        "publish to callback, Odometry": lambda: publishing(count, False, False, "nav_msgs/msg/Odometry"),
        "publish to callback, LaserScan of 720": lambda: publishing(
            count, False, False, "sensor_msgs/msg/LaserScan", ranges=[0.5] * 720
        ),
        "publish to callback, Image of 640 x 480": lambda: publishing(
            count // 20, False, False, "sensor_msgs/msg/Image", data=bytes(640 * 480 * 3)
        ),
        "publish to callback, content recorded": lambda: publishing(count, priced=False, recorded=True),
        "publish to callback, recorded and executed on a processor": lambda: publishing(count, True, True),
    }
    taken: dict[str, list[float]] = {name: [] for name in what}
    for _ in range(rounds):
        for name, measure in what.items():
            taken[name].append(measure())
    reference = median(taken["encode to CDR alone"])
    for name, values in taken.items():
        print(f"{name:<60}{median(values):>8.2f} us{median(values) / reference:>8.1f} x")
    for subscribers in (1, 2, 4):
        pairs = [
            (image_to(subscribers, count // 10), bytes_to(subscribers, count // 10)) for _ in range(rounds)
        ]
        ours, plain = (median(column) for column in zip(*pairs, strict=True))
        print(
            f"{f'image of 320 x 240 to {subscribers}':<60}{ours:>8.2f} us{ours / plain:>8.1f} x bytes alone"
        )
    print(f"{'memory after further images':<60}{growth_of_memory(count // 4):>8.1f} kB")
    served = median(serving(20 if quick else 60) for _ in range(3))
    print(f"{'a vehicle node, per simulated second':<60}{served:>8.2f} ms")


if __name__ == "__main__":
    main()
