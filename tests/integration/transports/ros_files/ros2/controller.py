"""The controller of ros1/controller.py, for rclpy: a PID controller on each axis and on yaw."""

import math

import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from rclpy.node import Node
from rclpy.time import Time
from std_msgs.msg import Int32

TOLERANCE = 0.05
SQUARE = [(1.0, 0.0, 1.0, 0.0), (1.0, 1.0, 1.0, 90.0), (0.0, 1.0, 1.0, 180.0), (0.0, 0.0, 1.0, -90.0)]


def yaw_of(q):
    return math.degrees(math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z)))


def wrapped(angle):
    return angle - 360.0 * math.ceil((angle - 180.0) / 360.0)


class Pid:
    def __init__(self, gains):
        self.p, self.i, self.d = gains
        self.total = 0.0
        self.last = None

    def next(self, error, elapsed):
        self.total += error * elapsed
        slope = (error - self.last) / elapsed if self.last is not None and elapsed > 0 else 0.0
        self.last = error
        return self.p * error + self.i * self.total + self.d * slope


class Controller(Node):
    def __init__(self):
        super().__init__("controller")
        gains = [self.declare_parameter(f"gains.{one}", 1.0).value for one in "pid"]
        self.pids = [Pid(gains) for _ in range(4)]
        self.stamp = None
        self.goal = 0
        self.commands = self.create_publisher(Twist, "cmd_vel", 100)
        self.reached = self.create_publisher(Int32, "reached", 10)
        listeners = self.declare_parameter("listeners", 1).value
        while (
            min(self.commands.get_subscription_count() - 1, self.reached.get_subscription_count()) < listeners
        ):
            rclpy.spin_once(self, timeout_sec=0.05)
        self.create_subscription(PoseStamped, "pose", self.steer, 1)

    def steer(self, pose):
        stamp = Time.from_msg(pose.header.stamp)
        elapsed = (stamp - self.stamp).nanoseconds / 1e9 if self.stamp else 0.0
        self.stamp = stamp
        goal = SQUARE[self.goal % len(SQUARE)]
        at = pose.pose.position
        errors = [goal[0] - at.x, goal[1] - at.y, goal[2] - at.z]
        errors.append(wrapped(goal[3] - yaw_of(pose.pose.orientation)) / 90.0)
        x, y, z, turn = [pid.next(error, elapsed) for pid, error in zip(self.pids, errors, strict=True)]
        command = Twist()
        command.linear.x, command.linear.y, command.linear.z = x, y, z
        command.angular.z = turn
        self.commands.publish(command)
        if max(abs(error) for error in errors) < TOLERANCE:
            self.goal += 1
            self.get_logger().info(f"way point {self.goal} is reached")
            self.reached.publish(Int32(data=self.goal))


def main():
    rclpy.init()
    rclpy.spin(Controller())


if __name__ == "__main__":
    main()
