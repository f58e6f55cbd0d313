"""Asks the switch, blocking first and then from callbacks that wait, and tells what it was told."""

import rclpy
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import SetBool


class Asker(Node):
    def __init__(self):
        super().__init__("asker")
        self.listeners = self.declare_parameter("listeners", 1).value
        self.told = self.create_publisher(String, "told", 10)
        self.client = self.create_client(SetBool, "switch", callback_group=MutuallyExclusiveCallbackGroup())
        while not self.client.wait_for_service(timeout_sec=1.0):
            self.get_logger().info("the service is not there yet")
        self.request = SetBool.Request()
        self.asked = 0

    def ask(self, on):
        self.request.data = on
        future = self.client.call_async(self.request)
        rclpy.spin_until_future_complete(self, future)
        return future.result()

    def tell(self, answer):
        self.told.publish(String(data=f"{answer.success}: {answer.message}"))

    def start(self):
        self.timer = self.create_timer(0.05, self.again)

    async def again(self):
        if self.told.get_subscription_count() < self.listeners:
            return
        self.asked += 1
        if self.asked > 8:
            self.timer.cancel()
            return
        self.tell(await self.client.call_async(SetBool.Request(data=self.asked % 3 == 0)))


def main():
    rclpy.init()
    asker = Asker()
    while asker.told.get_subscription_count() < asker.listeners:
        rclpy.spin_once(asker, timeout_sec=0.05)
    for on in (True, True, False):
        asker.tell(asker.ask(on))
    asker.start()
    executor = MultiThreadedExecutor()
    executor.add_node(asker)
    executor.spin()


if __name__ == "__main__":
    main()
