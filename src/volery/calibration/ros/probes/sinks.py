"""Peers of a probe: a program that runs during a campaign until its standard input ends.

``sinks.py rospy`` or ``sinks.py rclpy``: eight nodes in one process. Topic ``calibration/to_N`` has N
subscribers, and so has ``calibration/next_K_N`` for each K; ``calibration/quiet`` has a publisher that never
publishes, ``calibration/feed_MS_K`` for each K one that publishes every 20 or 50 ms, all K at once. Service
``calibration/served`` answers; ``calibration/answer``, a service of the probe, is called twenty times a
second while it is there.
For rclpy it does not import volery: that runs in the Python that has rclpy.
"""

from __future__ import annotations

import sys
import threading
from importlib import import_module
from typing import Any

MOST = 8
FOLLOWING, COUNTS = 4, (2, 8)
"""Topics that probes publish just after another, and their numbers of subscribers."""
FEEDS_MS, FEED_TOPICS = (20, 50), 5
"""Periods of the topics that are fed, and how many topics of each are published at once."""
REQUEST_S, ABSENT_S = 0.05, 0.25


def _ignore(message: Any) -> None:
    """Receive a message."""


def _over() -> threading.Event:
    """Report that the peers are ready; return an event that is set when standard input ends."""
    over = threading.Event()

    def wait() -> None:
        sys.stdin.read()
        over.set()

    threading.Thread(target=wait, daemon=True).start()
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    return over


def _topics(number: int) -> list[str]:
    """Return the topics of a probe that a node subscribes to."""
    after = [
        f"calibration/next_{one}_{count}" for one in range(FOLLOWING) for count in COUNTS if count >= number
    ]
    return [*(f"calibration/to_{count}" for count in range(number, MOST + 1)), *after]


def _feed(period_ms: int) -> list[str]:
    """Return the topics that are published at once with one period."""
    return [f"calibration/feed_{period_ms}_{number}" for number in range(FEED_TOPICS)]


def _rospy_node(number: int) -> Any:
    rospy = import_module("volery.ros.transports.ros1.rospy_copy").rospy_copy()
    rospy.init_node(f"calibration_sink_{number}", disable_signals=True)
    for topic in _topics(number):
        rospy.Subscriber(topic, rospy.AnyMsg, _ignore)
    return rospy


def run_rospy() -> None:
    """Run the peers of a ROS 1 probe, each on its own copy of rospy."""
    message: Any = import_module("std_msgs.msg").Float64MultiArray
    nodes = [_rospy_node(number) for number in range(1, MOST + 1)]
    quiet = nodes[0].Publisher("calibration/quiet", message, queue_size=10)
    trigger: Any = import_module("std_srvs.srv")
    nodes[1].Service("calibration/served", trigger.Trigger, lambda request: trigger.TriggerResponse())
    call = nodes[1].ServiceProxy("calibration/answer", trigger.Trigger)
    over = _over()

    def request() -> None:
        wait = REQUEST_S
        while not over.wait(wait):
            try:
                call()
                wait = REQUEST_S
            except Exception:  # rospy's own errors, of each copy of rospy: the probe does not serve now
                wait = ABSENT_S

    def feed(period_ms: int) -> None:
        topics = [nodes[0].Publisher(topic, message, queue_size=10) for topic in _feed(period_ms)]
        while not over.wait(period_ms / 1e3):
            for topic in topics:
                topic.publish(message(data=[0.0] * 4))

    threading.Thread(target=request, daemon=True).start()
    for period_ms in FEEDS_MS:
        threading.Thread(target=feed, args=(period_ms,), daemon=True).start()
    over.wait()
    del quiet
    for rospy in nodes:
        rospy.signal_shutdown("the campaign is over")


def run_rclpy() -> None:
    """Run the peers of an rclpy probe."""
    rclpy: Any = import_module("rclpy")
    kind: Any = import_module("std_msgs.msg").Float64MultiArray
    rclpy.init()
    nodes = [rclpy.create_node(f"calibration_sink_{number}") for number in range(1, MOST + 1)]
    executor = rclpy.executors.SingleThreadedExecutor()
    for number, node in enumerate(nodes, 1):
        executor.add_node(node)
        for topic in _topics(number):
            node.create_subscription(kind, topic, _ignore, 10)
    quiet = nodes[0].create_publisher(kind, "calibration/quiet", 10)

    def feed(period_ms: int) -> None:
        topics = [nodes[0].create_publisher(kind, topic, 10) for topic in _feed(period_ms)]
        publish = lambda: [topic.publish(kind(data=[0.0] * 4)) for topic in topics]  # noqa: E731 - a callback
        nodes[0].create_timer(period_ms / 1e3, publish)

    for period_ms in FEEDS_MS:
        feed(period_ms)
    trigger: Any = import_module("std_srvs.srv").Trigger
    nodes[1].create_service(trigger, "calibration/served", lambda request, response: response)
    caller = nodes[1].create_client(trigger, "calibration/answer")
    request = lambda: caller.service_is_ready() and caller.call_async(trigger.Request())  # noqa: E731 - a callback
    nodes[1].create_timer(REQUEST_S, request)
    over = _over()
    while not over.is_set():
        executor.spin_once(timeout_sec=0.5)
    del quiet
    rclpy.shutdown()


if __name__ == "__main__":
    {"rospy": run_rospy, "rclpy": run_rclpy}[sys.argv[1]]()
