"""Plain rclpy that does what it should not.

rclpy_stranger.py numbers TOPIC   publishes Int32 where others have strings
rclpy_stranger.py deaf TOPIC      subscribes, says "deaf" when it is connected, and stops itself
"""

import os
import signal
import sys

import rclpy
from std_msgs.msg import Int32, String


def main(what, topic):
    rclpy.init()
    node = rclpy.create_node("stranger")
    if what == "numbers":
        publisher = node.create_publisher(Int32, topic, 10)
        node.create_timer(0.05, lambda: publisher.publish(Int32(data=1)))
        rclpy.spin(node)
    subscription = node.create_subscription(String, topic, lambda one: None, 10)
    while not subscription.get_publisher_count():
        rclpy.spin_once(node, timeout_sec=0.05)
    sys.stdout.write("deaf\n")
    sys.stdout.flush()
    os.kill(os.getpid(), signal.SIGSTOP)


if __name__ == "__main__":
    main(*sys.argv[1:])
