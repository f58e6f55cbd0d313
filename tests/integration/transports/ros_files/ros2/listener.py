"""Hears what the talker says, and repeats it; it ends by itself when it has heard enough."""

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

ENOUGH = 25


class Listener(Node):
    def __init__(self):
        super().__init__("listener")
        self.heard = 0
        self.repeated = self.create_publisher(String, "repeated", qos_profile=10)
        kept = QoSProfile(
            depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
        )
        self.last = self.create_publisher(String, "last", kept)
        listeners = self.declare_parameter("listeners", 1).value
        while self.repeated.get_subscription_count() < listeners:
            rclpy.spin_once(self, timeout_sec=0.05)
        self.create_subscription(String, "topic", self.hear, 10)

    def hear(self, message):
        self.heard += 1
        self.get_logger().info(f'heard: "{message.data}"')
        self.repeated.publish(String(data=f"{self.get_name()} heard: {message.data}"))
        if self.heard == ENOUGH:
            self.last.publish(message)


def main():
    rclpy.init()
    listener = Listener()
    while rclpy.ok() and listener.heard < ENOUGH:
        rclpy.spin_once(listener, timeout_sec=0.5)
    rclpy.spin(listener)


if __name__ == "__main__":
    main()
