"""Long arrays in rclpy: each subscriber's message is its own, as there."""

from __future__ import annotations

from array import array
from typing import Any

from volery.base.time import S
from volery.ros import messages

RCLPY = """
import array
import copy
import numpy as np
import rclpy
from sensor_msgs.msg import Image, LaserScan
"""


def test_rclpy_has_an_array_of_its_own_for_each_subscriber(stage: Any) -> None:
    stage.modules |= messages.modules(library="rclpy")
    stage.component(
        "one",
        RCLPY
        + """
rclpy.init()
node = rclpy.create_node("one")
def changing(message):
    message.data[0] = 77
    np.frombuffer(message.data, np.uint8)[1:] = 78
    out(("changed", message.data[0], message.data[1]))
node.create_subscription(Image, "image", changing, 10)
def reading(message):
    out((type(message.data), message.data.typecode, message.data[0]))
node.create_subscription(Image, "image", reading, 10)
def copied(message):
    out(copy.deepcopy(message) == message)
node.create_subscription(Image, "image", copied, 10)
rclpy.spin_once(node, timeout_sec=1)
rclpy.spin_once(node, timeout_sec=1)
rclpy.spin_once(node, timeout_sec=1)
""",
    )
    stage.component(
        "talker",
        RCLPY
        + """
rclpy.init()
node = rclpy.create_node("talker")
publisher = node.create_publisher(Image, "image", 10)
node.create_timer(0.1, lambda: None)
rclpy.spin_once(node)
message = Image()
given = array.array("B", bytes(6000))
message.data = given
given[0] = 5  # rclpy keeps the array itself
publisher.publish(message)
message.data[0] = 6
given[1] = 6
""",
    )
    found = stage.run(3 * S)

    assert found == [("changed", 77, 78), (array, "B", 5), True]
