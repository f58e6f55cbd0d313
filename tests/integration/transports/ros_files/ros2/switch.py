"""Answers requests, as the service of the ROS 2 documentation does."""

import rclpy
from rclpy.node import Node
from std_srvs.srv import SetBool


class Switch(Node):
    def __init__(self):
        super().__init__("switch")
        self.on = False
        self.srv = self.create_service(SetBool, "switch", self.answer)

    def answer(self, request, response):
        response.success = request.data != self.on
        response.message = f"was {self.on}, is {request.data}"
        self.on = request.data
        self.get_logger().info(response.message)
        return response


def main():
    rclpy.init()
    rclpy.spin(Switch())
    rclpy.shutdown()


if __name__ == "__main__":
    main()
