"""Says something ten times a second, as the publisher of the ROS 2 documentation does."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String


class Talker(Node):
    def __init__(self):
        super().__init__("talker")
        self.publisher_ = self.create_publisher(String, "topic", 10)
        self.listeners = self.declare_parameter("listeners", 1).value
        self.timer = self.create_timer(0.1, self.talk)
        self.number = 0

    def talk(self):
        if self.number == 0 and self.publisher_.get_subscription_count() < self.listeners:
            return
        message = String()
        message.data = f"hello, number {self.number}"
        self.publisher_.publish(message)
        self.get_logger().info(f'publishing: "{message.data}"')
        self.number += 1


def main(args=None):
    rclpy.init(args=args)
    talker = Talker()
    try:
        rclpy.spin(talker)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        talker.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
