"""A ground station in plain rclpy: waits for a fix, arms, and says as JSON what it saw.

rclpy_ground.py NAMESPACE
"""

import json
import sys
import time

import rclpy
from sensor_msgs.msg import NavSatFix
from std_srvs.srv import Empty

LIMIT_S = 100.0


def main(namespace: str) -> None:
    rclpy.init()
    node = rclpy.create_node("ground")
    fixes: list[NavSatFix] = []
    node.create_subscription(NavSatFix, f"{namespace}/gps", fixes.append, 10)
    arm = node.create_client(Empty, f"{namespace}/arm")
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end and not (fixes and fixes[-1].status.status == 0):
        rclpy.spin_once(node, timeout_sec=0.2)
    answered = arm.wait_for_service(LIMIT_S)
    if answered:
        rclpy.spin_until_future_complete(node, future := arm.call_async(Empty.Request()), timeout_sec=LIMIT_S)
        answered = future.done()
    while time.monotonic() < end and len(node.get_node_names()) < 2:  # names may come after topics
        rclpy.spin_once(node, timeout_sec=0.2)
    last = fixes[-1] if fixes else NavSatFix()
    place = [last.latitude, last.longitude, last.altitude]
    sys.stdout.write(json.dumps({"place": place, "armed": answered, "nodes": node.get_node_names()}))


if __name__ == "__main__":
    main(sys.argv[1])
