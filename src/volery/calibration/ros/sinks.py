"""Peers of a ROS 1 probe: a program that runs during a campaign until its standard input ends.

Eight nodes in one process. Topic ``calibration/to_N`` has N subscribers, ``calibration/quiet`` a publisher
that never publishes, ``calibration/feed`` one that publishes twenty times a second.
"""

from __future__ import annotations

import sys
import threading
from importlib import import_module
from typing import Any

from volery.ros.transports.ros1.rospy_copy import rospy_copy

MOST = 8
FEED_S = 0.05


def _ignore(message: Any) -> None:
    """Receive a message."""


def _node(number: int) -> Any:
    rospy = rospy_copy()
    rospy.init_node(f"calibration_sink_{number}", disable_signals=True)
    for count in range(number, MOST + 1):
        rospy.Subscriber(f"calibration/to_{count}", rospy.AnyMsg, _ignore)
    return rospy


def _until_left(over: threading.Event) -> None:
    sys.stdin.read()
    over.set()


def main() -> None:
    """Stay until standard input ends."""
    message: Any = import_module("std_msgs.msg").Float64MultiArray
    nodes = [_node(number) for number in range(1, MOST + 1)]
    quiet = nodes[0].Publisher("calibration/quiet", message, queue_size=10)
    feed = nodes[0].Publisher("calibration/feed", message, queue_size=10)
    over = threading.Event()
    threading.Thread(target=_until_left, args=(over,), daemon=True).start()
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    while not over.wait(FEED_S):
        feed.publish(message(data=[0.0] * 4))
    del quiet
    for rospy in nodes:
        rospy.signal_shutdown("the campaign is over")


if __name__ == "__main__":
    main()
