"""A ring of rclpy nodes: each publishes at 50 Hz and subscribes to its predecessor; all in one executor."""

import sys

import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.executors import SingleThreadedExecutor

NODES, PERIOD_S = 100, 0.02


def main(seconds, began=lambda: None):
    """Run for *seconds* of the nodes' time; return how many messages arrived."""
    rclpy.init()
    executor = SingleThreadedExecutor()
    received = [0]

    def take(message):
        received[0] += 1

    for number in range(NODES):
        node = rclpy.create_node(f"node_{number}")
        publisher = node.create_publisher(TwistStamped, f"topic_{number}", 10)
        node.create_subscription(TwistStamped, f"topic_{(number - 1) % NODES}", take, 10)

        def publish(node=node, publisher=publisher, number=number):
            message = TwistStamped()
            message.header.stamp = node.get_clock().now().to_msg()
            message.twist.linear.x = float(number)
            publisher.publish(message)

        node.create_timer(PERIOD_S, publish)
        executor.add_node(node)
    clock = node.get_clock()
    began()
    end = clock.now().nanoseconds + seconds * 10**9
    while clock.now().nanoseconds < end:
        executor.spin_once(timeout_sec=0.1)
    return received[0]


if __name__ == "__main__":
    import time

    start = [0.0]

    def began():
        start[0] = time.process_time()

    count = main(int(sys.argv[1]), began)
    print(time.process_time() - start[0], count)
