"""Peers of an rclpy probe, with the topics of ``volery.calibration.ros.sinks`` (for ROS 1).

A program of its own for the Python that has rclpy: it does not import volery.
"""

from __future__ import annotations

import sys
import threading
from importlib import import_module
from typing import Any

MOST = 8
FEED_S = 0.05


def _until_left(over: threading.Event) -> None:
    sys.stdin.read()
    over.set()


def main() -> None:
    """Run until the standard input ends."""
    rclpy: Any = import_module("rclpy")
    kind: Any = import_module("std_msgs.msg").Float64MultiArray
    rclpy.init()
    nodes = [rclpy.create_node(f"calibration_sink_{number}") for number in range(1, MOST + 1)]
    executor = rclpy.executors.SingleThreadedExecutor()
    for number, node in enumerate(nodes, 1):
        executor.add_node(node)
        for count in range(number, MOST + 1):
            node.create_subscription(kind, f"calibration/to_{count}", lambda message: None, 10)
    quiet = nodes[0].create_publisher(kind, "calibration/quiet", 10)
    feed = nodes[0].create_publisher(kind, "calibration/feed", 10)
    nodes[0].create_timer(FEED_S, lambda: feed.publish(kind(data=[0.0] * 4)))
    over = threading.Event()
    threading.Thread(target=_until_left, args=(over,), daemon=True).start()
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    while not over.is_set():
        executor.spin_once(timeout_sec=0.5)
    del quiet
    rclpy.shutdown()


if __name__ == "__main__":
    main()
